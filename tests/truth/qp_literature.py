"""Residuals of the literature for quadratic programs, computed by NumPy alone; the judge is measured against them.

They share no code with `cpbench.verification`. Multipliers are first brought to the signs that optimality demands
(λ ≥ 0, ν ≥ 0 where there is no upper bound, ν ≤ 0 where there is no lower one), so that a wrong sign counts in the
gradient. A bound or right side of 1e19 or more is none, as in the files of Maros and Mészáros (1999).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

NO_BOUND = 1e19
"""Bounds and right sides of this size stand for infinity in the files."""
LIVE = 1e-6
"""A row whose terms are a smaller share of ‖a_i‖∞‖z*‖∞ is a row of zeros."""
OWN = 1e-9
"""A part of a program has an objective of its own down to this share of the largest; below, it is rounding."""
SPEAKING = 1e-3
"""A row whose terms are a smaller share of ‖a_i‖∞‖z*‖∞ says nothing of the size of its unknowns."""

Array = np.ndarray


@dataclass(frozen=True)
class Reference:
    """A solution that two methods agree on: `z` (n,), its objective, the terms of it, where it comes from."""

    z: Array
    objective: float
    terms: float
    source: str


@dataclass(frozen=True)
class Literature:
    """Numbers of one answer without unit, each 0 at a solution.

    Attributes
    ----------
    rows : the worst row of Az ≥ b, Cz = d over its own terms Σ|a_ij z_j| + |b_i|. rows_norm : the worst over the
        largest terms of any row.
    bounds : the worst bound over max(|bound|, |z_i|, ‖z‖∞).
    gradient : the worst row of Qz + p − Aᵀλ − Cᵀμ − ν over its own terms. gradient_norm : over the largest terms.
    gap : |f − dual objective| over max(|f|, |dual objective|). gap_terms : over Σ|p_i z_i| + ½zᵀQz + |f|. Both are
        those of the worst part: programs side by side in one file are right where each of them is. A part whose
        objective is below OWN of the largest, or 0, is compared with that.
    objective : f itself.
    """

    rows: float
    rows_norm: float
    bounds: float
    gradient: float
    gradient_norm: float
    gap: float
    gap_terms: float
    objective: float

    def worst(self, by_row: bool) -> float:
        """Return the largest number: rows and gradient each over its own terms, or over the largest terms."""
        primal, dual = (self.rows, self.gradient) if by_row else (self.rows_norm, self.gradient_norm)
        return max(primal, self.bounds, dual, self.gap)


def over(numbers: Array, sizes: Array | float) -> Array:
    """Divide; 0 over 0 is 0, another number over 0 is infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(numbers == 0, 0.0, np.abs(numbers) / sizes)


def largest(numbers: Array) -> float:
    return float(np.max(numbers, initial=0.0))


def objective_terms(problem: Any, z: Array) -> float:
    """Return Σ|p_i z_i| + ½zᵀQz + |f|."""
    half = 0.5 * float(z @ (problem.Q @ z))
    return float(np.abs(problem.p * z).sum()) + half + abs(half + float(problem.p @ z))


def row_misses(problem: Any, z: Array, other: Array | None = None) -> tuple[Array, Array]:
    """Return by how much z misses each row of Az ≥ b and Cz = d, and the terms of each row.

    `other` : a second point; the terms are the larger of both points'.
    """
    used = problem.b > -NO_BOUND
    missed = np.concatenate(
        [np.where(used, np.maximum(problem.b - problem.A @ z, 0.0), 0.0), np.abs(problem.C @ z - problem.d)]
    )
    sizes = [np.abs(x) for x in (z, other) if x is not None]
    added = [np.concatenate([abs(problem.A) @ size, abs(problem.C) @ size]) for size in sizes]
    constants = np.concatenate([np.where(used, np.abs(problem.b), 0.0), np.abs(problem.d)])
    return missed, np.max(added, axis=0) + constants


def bound_misses(problem: Any, z: Array, other: Array | None = None) -> tuple[Array, Array]:
    """Return by how much z misses its bounds, and the sizes: |bound|, |z_i| and ‖z‖∞, the larger of both points'."""
    size = max(largest(np.abs(x)) for x in (z, other) if x is not None)
    below, above = np.maximum(problem.lb - z, 0.0), np.maximum(z - problem.ub, 0.0)
    bound = np.where(below > 0, np.abs(problem.lb), np.where(above > 0, np.abs(problem.ub), 0.0))
    return np.maximum(below, above), np.maximum(bound, size)


def multipliers(problem: Any, point: Any) -> tuple[Array, Array]:
    """Return λ and ν with the signs that optimality demands."""
    lam = np.where(problem.b > -NO_BOUND, np.maximum(point.lam, 0.0), 0.0)
    nu = np.where(problem.lb > -NO_BOUND, np.maximum(point.nu, 0.0), 0.0)
    return lam, nu + np.where(problem.ub < NO_BOUND, np.minimum(point.nu, 0.0), 0.0)


def _or_largest(objectives: Array) -> Array:
    """Return the objectives of parts, of the largest where one is below OWN of it."""
    return np.where(objectives > OWN * largest(objectives), objectives, largest(objectives))


def _parts(problem: Any) -> Array:
    """Return the number of the connected part of each unknown, of each row of A and of each row of C."""
    rows = sp.csr_array(sp.vstack([sp.csr_array(problem.A), sp.csr_array(problem.C)]))
    graph = sp.block_array([[sp.csr_array(problem.Q), rows.T], [rows, None]])
    return connected_components(graph, directed=False)[1]


def literature(problem: Any, point: Any) -> Literature:
    """Measure an answer (z, λ, μ, ν) of a convex QP; infinite numbers where it is not finite."""
    if not point.finite:
        return Literature(*[np.inf] * 8)
    z, mu = point.z, point.mu
    lam, nu = multipliers(problem, point)
    missed, terms = row_misses(problem, z)
    outside, sizes = bound_misses(problem, z)
    r = problem.Q @ z + problem.p - problem.A.T @ lam - problem.C.T @ mu - nu
    parts = abs(problem.Q) @ np.abs(z) + np.abs(problem.p) + abs(problem.A).T @ lam
    parts = parts + abs(problem.C).T @ np.abs(mu) + np.abs(nu)
    half, priced = 0.5 * z * (problem.Q @ z), problem.p * z
    bound = np.where(nu > 0, problem.lb, np.where(nu < 0, problem.ub, 0.0))
    sides = np.concatenate([bound * nu - half, np.where(lam > 0, problem.b, 0.0) * lam, problem.d * mu])
    part, of_z = _parts(problem), z.size
    primal, dual = np.bincount(part[:of_z], half + priced, part.max() + 1), np.bincount(part, sides)
    added = np.bincount(part[:of_z], half + np.abs(priced), primal.size) + np.abs(primal)
    objectives = np.maximum(np.abs(primal), np.abs(dual))
    gaps = np.abs(primal - dual)
    return Literature(
        rows=largest(over(missed, terms)),
        rows_norm=largest(over(missed, largest(terms))),
        bounds=largest(over(outside, sizes)),
        gradient=largest(over(r, parts)),
        gradient_norm=largest(over(r, largest(parts))),
        gap=largest(over(gaps, _or_largest(objectives))),
        gap_terms=largest(over(gaps, _or_largest(added))),
        objective=float(primal.sum()),
    )


def off(problem: Any, z: Array, reference: Reference) -> float:
    """Return by how much the objective at z is off, over the terms of the objective at the reference."""
    f = 0.5 * float(z @ (problem.Q @ z)) + float(problem.p @ z)
    return float(over(np.asarray(f - reference.objective), reference.terms))


def _live(rows: Any, constants: Array, z: Array, share: float) -> tuple[Array, Array]:
    """Return the terms of each row at z, and which rows have terms above `share` of ‖a_i‖∞‖z‖∞."""
    terms = rows @ np.abs(z) + constants
    return terms, terms > share * rows.max(axis=1).toarray().ravel() * largest(np.abs(z))


def _absolute(*parts: Any) -> Any:
    """Return |entries| of matrices, one under the other, as CSR."""
    return sp.csr_array(abs(sp.csr_array(sp.vstack([sp.csr_array(part) for part in parts]))))


def unknown_sizes(problem: Any, reference: Reference) -> Array:
    """Return the size of each unknown, shape (n,): |z*_j|, or the change of z_j that alters a row by all its terms.

    An unknown that is 0 at the reference has no size of its own. Of all rows of A, C and Q whose terms at the
    reference are more than SPEAKING of ‖a_i‖∞‖z*‖∞, the smallest terms_i / |a_ij| is its size; ‖z*‖∞ where there is no
    such row.
    """
    z = np.abs(reference.z)
    rows = _absolute(problem.A, problem.C, problem.Q)
    used = np.where(np.abs(problem.b) < NO_BOUND, np.abs(problem.b), 0.0)
    constants = np.concatenate([used, np.abs(problem.d), np.abs(problem.p)])
    terms, live = _live(rows, constants, z, SPEAKING)
    entries = sp.coo_array(rows)
    i, j, value = entries.row, entries.col, entries.data
    keep = live[i] & (value > 0)
    sizes = np.full(z.size, np.inf)
    np.minimum.at(sizes, j[keep], terms[i[keep]] / value[keep])
    return np.maximum(z, np.minimum(sizes, largest(z)))


def misses(problem: Any, z: Array, reference: Reference, sizes: Array) -> tuple[float, float]:
    """Return the worst row or bound missed by z: of those that have terms, and of those of zeros.

    Terms are those at z or at the reference, the larger; of a bound they are |bound| + |z_i|. A row whose terms at the
    reference are at most LIVE of ‖a_i‖∞‖z*‖∞ is one of zeros, and so is a bound at 0: there the unknowns count with
    their `sizes`.
    """
    missed, terms = row_misses(problem, z, reference.z)
    used = np.where(np.abs(problem.b) < NO_BOUND, np.abs(problem.b), 0.0)
    constants = np.concatenate([used, np.abs(problem.d)])
    _, live = _live(_absolute(problem.A, problem.C), constants, reference.z, LIVE)
    larger = np.maximum(sizes, np.abs(z))
    with_sizes = row_misses(problem, z, larger)[1]
    below, above = np.maximum(problem.lb - z, 0.0), np.maximum(z - problem.ub, 0.0)
    bound = np.where(below > 0, np.abs(problem.lb), np.where(above > 0, np.abs(problem.ub), 0.0))
    outside = np.maximum(below, above)
    rows = over(missed, np.where(live, terms, with_sizes))
    bounds = over(outside, np.where(bound > 0, bound + np.maximum(np.abs(z), np.abs(reference.z)), larger))
    with_terms = max(largest(rows[live]), largest(bounds[bound > 0]))
    return with_terms, max(largest(rows[~live]), largest(bounds[bound == 0]))
