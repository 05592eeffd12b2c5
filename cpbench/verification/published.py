"""Clarabel's measure of programs, which reports print beside the error of an answer; it decides nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.base import Problem
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Vector, max_abs, norm
from cpbench.verification import sets

CONTACT = ("fc", "fcm", "gfc", "nfc")
"""Formulations of Coulomb's law with one coefficient a contact."""
BESIDE: Mapping[str, str] = {
    **dict.fromkeys(("qp", "coneqp"), "clarabel"),
    **dict.fromkeys(("lcp", "relay"), "natural"),
    "mlcp": "siconos_mlcp",
    "ncp": "natural_absolute",
    **dict.fromkeys((*CONTACT, "rfc", "afc", "grfc"), "fclib2018"),
}
"""The one number of others that a report prints beside the error of each formulation: of Clarabel, Siconos, FCLIB."""

OPTIMALITY_GAP = "optimality_gap"
"""Number of an answer to a qp whose optimal value is proved, which a report prints in the same way."""


def rows_of(P: Any, point: Any) -> tuple[Vector, Vector, Vector, Vector]:
    """Return (z, Az, Cz) of an answer to a qp, their lower and upper sides, and their multipliers."""
    low, high = np.concatenate([P.lb, P.b, P.d]), np.concatenate([P.ub, np.full(P.b.size, np.inf), P.d])
    low, high = np.where(low <= -sets.INFINITE, -np.inf, low), np.where(high >= sets.INFINITE, np.inf, high)
    value = np.concatenate([point.z, P.A @ point.z, P.C @ point.z])
    return value, low, high, np.concatenate([point.nu, point.lam, point.mu])


def force(P: Any, dual: Vector) -> Vector:
    """Return what multipliers of these rows add up to in the gradient."""
    n, m = P.p.size, P.b.size
    return dual[:n] + P.A.T @ dual[n : n + m] + P.C.T @ dual[n + m :]


@dataclass(frozen=True, eq=False)
class Conic:
    """An answer to min ½xᵀQx + pᵀx subject to s = Ax + b ∈ K, with the multiplier y ∈ K* of s. Solvers of cone programs
    keep s and y in their cones; of an answer s is the point of K nearest to Ax + b."""

    K: ProductCone
    x: Vector
    y: Vector
    Qx: Vector
    p: Vector
    Aty: Vector
    Ax: Vector
    b: Vector
    s: Vector

    @property
    def products(self) -> tuple[float, float, float]:
        """Return xᵀQx, pᵀx and bᵀy: the primal objective less the dual one is their sum."""
        return float(self.x @ self.Qx), float(self.p @ self.x), float(self.b @ self.y)


def conic(P: Any, point: Any, *, moved: bool = True) -> Conic:
    """Return an answer to a qp or coneqp. The part of a multiplier of a qp with the sign of a side that is infinite is
    left out, so that it is an error of the gradient; y of a coneqp is moved into K* unless `moved` is False."""
    if P.node == "coneqp":
        y, Ax = P.K.project_dual(point.y) if moved else point.y, P.A @ point.x
        return Conic(P.K, point.x, y, P.Q @ point.x, P.p, P.A.T @ y, Ax, P.b, P.K.project(Ax + P.b))
    value, low, high, dual = rows_of(P, point)
    equal = low == high
    above, below = np.isfinite(low) & ~equal, np.isfinite(high) & ~equal
    K = ProductCone.of((Cone.NONNEGATIVE, 1, int(above.sum() + below.sum())), (Cone.ZERO, 1, int(equal.sum())))
    up, down = np.where(above, np.maximum(dual, 0.0), 0.0), np.where(below, np.maximum(-dual, 0.0), 0.0)
    y, Ax, b = (
        np.concatenate([one[above], two[below], three[equal]])
        for one, two, three in ((up, down, dual), (value, -value, value), (-low, high, -low))
    )
    Aty = force(P, np.where(equal, dual, up - down))
    return Conic(K, point.z, y, P.Q @ point.z, P.p, Aty, Ax, b, K.project(Ax + b))


def clarabel(a: Conic) -> dict[str, float]:
    """Return Clarabel's relative residuals and gap (its `info`: res_primal, res_dual, gap_rel), in the 2-norm."""
    xQx, px, by = a.products
    primal, dual = 0.5 * xQx + px, -0.5 * xQx - by
    return {
        "clarabel_primal": norm(a.Ax + a.b - a.s) / max(1.0, max_abs(a.b) + norm(a.x) + norm(a.s)),
        "clarabel_dual": norm(a.Qx + a.p - a.Aty) / max(1.0, max_abs(a.p) + norm(a.x) + norm(a.y)),
        "clarabel_gap": abs(primal - dual) / max(1.0, min(abs(primal), abs(dual))),
    }


def beside(problem: Problem, point: Any) -> dict[str, float]:
    """Return the number of `BESIDE`, by name, where `Problem.residuals` does not have it; NaN is ∞, and there is none
    of a coneqp with factors that are no cones."""
    if BESIDE.get(problem.node) != "clarabel" or not getattr(problem, "K", ProductCone.of()).conical:
        return {}
    with np.errstate(all="ignore"):
        worst = max(math.inf if math.isnan(x) else x for x in clarabel(conic(problem, point)).values())
    return {"clarabel": worst}


def named(numbers: Mapping[str, float]) -> dict[str, float]:
    """Return the numbers of an answer by what a user calls them: without their units."""
    return {name.split(" [")[0]: value for name, value in numbers.items()}
