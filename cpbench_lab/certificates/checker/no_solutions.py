"""Check a proof that a problem has no solution: multipliers that contradict its conditions, or a point and a ray.

Both have a margin t: the proof holds for every problem whose entries differ by at most t of themselves, and whose sides
and bounds by at most t of themselves and of the sizes that the certificate names, for unknowns up to R.
"""

from __future__ import annotations

import json
import zlib
from typing import Any

from certificate_file import exact, require
from flint import fmpq
from linear_conditions import conditions


def no_solution(own: dict[str, Any], data: dict[str, Any], evidence: dict[str, Any]) -> str:
    """Prove that the problem of a certificate has no solution, and return it in words; raises ValueError else."""
    require("sides" in evidence, "the certificate does not say by which sizes its margin is measured")
    vectors = {name: [_fraction(v) for v in part] for name, part in _unpacked(evidence["proof"]).items()}
    P, t = conditions(own["node"], data), exact(own["margin"])
    sizes = [[exact(v) for v in evidence[name].tolist()] for name in ("sides", "bounds", "reach")]
    require(own["tolerance"] <= own["margin"] < 1, "the margin is less than the tolerance")
    told = f"for all numbers within {own['margin']:.2g} of their sizes, up to {max(evidence['reach'], default=0.0):.3g}"
    if own["level"] == "infeasible":
        P.contradicted(vectors["multipliers"], t, *sizes)
        return f"infeasible: no point meets the conditions; {told}"
    require(own["node"] in ("qp", "coneqp"), "the problem has no objective")
    Q, x, d = data["Q"], vectors["point"], vectors["ray"]
    require(len(x) == len(d) == len(P.lo), "the point and the ray are not of this problem")
    P.feasible(x)
    P.recedes(d)
    terms = [exact(v) * d[i] * d[j] for i, row in enumerate(Q.rows) for j, v in row.items()]
    if sum(terms, fmpq(0)) + t * sum(map(abs, terms), fmpq(0)) < 0:
        return "unbounded: the objective curves down along a ray from a feasible point; " + told.split(", up")[0]
    P.optimality(Q, data["p"]).contradicted(d, t, *sizes)
    return f"unbounded: the objective falls along a ray from a feasible point; no stationary point {told}"


def _unpacked(packed: Any) -> dict[str, list[str]]:
    return json.loads(zlib.decompress(packed.tobytes()))


def _fraction(text: str) -> Any:
    numerator, denominator = text.split("/")
    return fmpq(int(numerator, 16), int(denominator, 16))
