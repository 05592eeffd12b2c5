"""Certificates of problems without a solution: infeasible ones, and programs without a least value.

`cpbench.proofs` looks for multipliers, points and rays to rounding, with a margin. Here they become rational numbers
that meet the equalities exactly which they meet to rounding, so that the proof is one in exact arithmetic.
"""

from __future__ import annotations

import json
import math
import time
import zlib
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench import proofs
from cpbench.formulations.base import Problem
from cpbench.foundation.matrices import Vector
from cpbench.proofs.margins import contradiction, falling, optimality
from cpbench.proofs.polyhedra import Polyhedron, Sizes
from cpbench_lab.certificates.certificate import INFEASIBLE, TOLERANCE, UNBOUNDED, Certificate
from cpbench_lab.certificates.exact_rows import ExactRows, nearest, rational, solve_near

ROUNDING = (1e-9, 1e-12, 1e-6)
"""What is this small among the terms it is made of may be meant to be 0."""
SHARE = 0.99
"""Share of the margin, as it is to rounding, that is claimed."""


def without_solution(
    problem: Problem, seconds: float = proofs.SECONDS, tolerance: float = TOLERANCE
) -> Certificate | None:
    """Look for a proof that the problem is infeasible or unbounded, for about so many seconds; None without.

    The evidence is the proof, its vectors as fractions of hexadecimal integers in compressed JSON, by how much `sides`
    and `bounds` change at a margin of 1 besides their own size, and R (`reach`), up to which solutions are excluded
    then (`cpbench.proofs.margins`).
    """
    began = time.perf_counter()
    for kind in (INFEASIBLE, UNBOUNDED):
        attempt = proofs.prove(problem, kind, seconds=seconds / 2, tolerance=tolerance)
        exact = None if attempt.proof is None else _exact(problem, attempt.proof)
        if exact is None or exact[1] < tolerance:
            continue
        vectors, margin, sizes = exact
        packed = json.dumps({name: [f"{int(v.p):x}/{int(v.q):x}" for v in part] for name, part in vectors.items()})
        evidence = {
            "proof": np.frombuffer(zlib.compress(packed.encode()), dtype=np.uint8),
            "sides": sizes.rows,
            "bounds": sizes.unknowns,
            "reach": sizes.reach,
        }
        return Certificate(
            problem.node,
            problem.fingerprint,
            kind,
            np.zeros(0),
            evidence=evidence,
            seconds=time.perf_counter() - began,
            tolerance=tolerance,
            margin=margin,
        )
    return None


def _exact(problem: Problem, proof: proofs.Proof) -> tuple[dict[str, list[Any]], float, Sizes] | None:
    """Return exact vectors of a proof, their margin, and the sizes in which it is measured: those of the conditions, or
    of those of optimality; none of a ray along which the objective curves down."""
    known, goal = proofs.conditions(problem), proofs.objective(problem)
    if known is None:
        return None
    if isinstance(proof, proofs.Infeasible):
        y = _multipliers(known, proof.multipliers)
        return None if y is None else ({"multipliers": y}, SHARE * contradiction(known, _doubles(y)), known.sizes)
    point = _point(known, proof.point)
    if goal is None or point is None:
        return None
    optimal = optimality(known, goal)
    flat = contradiction(optimal, proof.ray) > 0.0
    ray = _multipliers(optimal, proof.ray) if flat else _point(known.recession, proof.ray)
    if ray is None:
        return None
    margin = SHARE * falling(known, goal, optimal, _doubles(ray))
    return {"point": point, "ray": ray}, margin, optimal.sizes if flat else Sizes(*[np.zeros(0)] * 3)


def _doubles(x: list[Any]) -> Vector:
    return np.array([nearest(value) for value in x])


def _multipliers(known: Polyhedron, y: Vector) -> list[Any] | None:
    """Return multipliers near y whose sum leaves no unknown without a bound, exactly."""
    m = known.h.size
    y = y / np.ldexp(1.0, math.frexp(float(np.abs(y).max()))[1])
    rows: Any = sp.vstack([sp.csr_array(known.G), sp.csr_array(known.E)], format="csr")
    columns = ExactRows.of(sp.csr_array(rows.T))
    sizes = np.asarray(abs(rows).max(axis=1).toarray()).ravel() if rows.nnz else np.ones(y.size)
    below, above = np.isneginf(known.lb), np.isposinf(known.ub)
    for rounding in (0.0, *ROUNDING):
        large = np.abs(y) * sizes > rounding * float((np.abs(y) * sizes).max(initial=0.0))
        support = np.flatnonzero((large | (rounding == 0.0) | (np.arange(y.size) >= m)) & (y != 0.0))
        kept = np.zeros_like(y)
        kept[support] = y[support]
        nu, terms = rows.T @ kept, abs(rows).T @ np.abs(kept)
        near_zero = (below & above) | (np.abs(nu) <= rounding * terms)
        tight = np.flatnonzero((terms > 0.0) & (below | above) & near_zero)
        part = solve_near(sp.csr_array(rows[support][:, tight].T), [rational(0.0)] * tight.size, kept[support])
        if part is None:
            continue
        whole = [rational(0.0)] * y.size
        for i, value in zip(support.tolist(), part, strict=True):
            whole[i] = value
        sums = columns.products(whole)  # −ν: positive where an upper bound takes the place of the unknown
        bounded = all(
            not (v > 0 and no_ub) and not (v < 0 and no_lb) for v, no_lb, no_ub in zip(sums, below, above, strict=True)
        )
        if bounded and all(value >= 0 for value in whole[:m]):
            return whole
    return None


def _point(known: Polyhedron, x: Vector) -> list[Any] | None:
    """Return a point near x that meets all conditions exactly; with those that x meets to rounding as equalities."""
    G: Any = sp.csr_array(known.G)
    for rounding in (0.0, *ROUNDING):
        size = np.maximum(np.abs(x), max(float(np.abs(x).max(initial=0.0)), 1.0) * rounding)
        low = (known.lb == known.ub) | (x - known.lb <= rounding * size)
        high = ~low & (known.ub - x <= rounding * size)
        near = np.where(low, known.lb, np.where(high, known.ub, x))
        finite = np.isfinite(known.h)
        terms = abs(G) @ np.abs(near) + np.abs(np.where(finite, known.h, 0.0))
        active = np.flatnonzero(finite & (G @ near - known.h <= rounding * terms) & (rounding > 0.0))
        rows: Any = sp.csr_array(sp.vstack([sp.csr_array(known.E), G[active]]))
        point, free = [rational(value) for value in near.tolist()], np.flatnonzero(~(low | high))
        bound = [value if fixed else rational(0.0) for value, fixed in zip(point, low | high, strict=True)]
        sides = [rational(value) for value in np.concatenate([known.f, known.h[active]]).tolist()]
        right = [b - a for a, b in zip(ExactRows.of(rows).products(bound), sides, strict=True)]
        part = solve_near(sp.csr_array(rows[:, free]), right, near[free])
        if part is None:
            continue
        for j, value in zip(free.tolist(), part, strict=True):
            point[j] = value
        if _inside(known, point):
            return point
    return None


def _inside(known: Polyhedron, x: list[Any]) -> bool:
    """Return whether x meets every condition exactly."""

    def above(values: list[Any], sides: Vector, sign: int = 1) -> bool:
        pairs = zip(values, sides.tolist(), strict=True)
        return all(math.isinf(side) or sign * (value - rational(side)) >= 0 for value, side in pairs)

    rows, equalities = ExactRows.of(sp.csr_array(known.G)), ExactRows.of(sp.csr_array(known.E))
    level = equalities.products(x) == [rational(value) for value in known.f.tolist()]
    return level and above(rows.products(x), known.h) and above(x, known.lb) and above(x, known.ub, -1)
