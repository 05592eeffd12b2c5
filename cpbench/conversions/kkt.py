"""Finite bounds as rows, and first-order conditions as an MLCP: what the edges that leave `qp` and `avi` share.

With lb ≤ z ≤ ub, rows Az ≥ b, Cz = d and a map z ↦ Mz + q, the bounds become rows E = [A; I_lb; −I_ub],
e = [b; lb; −ub]; a variable with lb = ub is one more equality, F = [C; I_fixed], g = [d; lb], instead of two
inequalities with unbounded multipliers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.formulations.base import Trace
from cpbench.formulations.linear import AVI, MLCP
from cpbench.formulations.programs import QP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector

NOTHING = float(np.sqrt(np.finfo(float).eps))
"""Share of the terms of the gap below which a distance to a bound is taken for 0: its error falls by this factor."""


@dataclass(frozen=True)
class ConstraintRows:
    """E z ≥ e and F z = g of a problem with bounds, and `sizes`, what `split` needs to undo them."""

    E: Matrix
    e: Vector
    F: Matrix
    g: Vector
    sizes: Trace


def rows(problem: QP | AVI, like: Matrix) -> ConstraintRows:
    """Return all constraints as rows, stored as `like`."""
    lb, ub, n = problem.lb, problem.ub, problem.lb.size
    fixed = np.flatnonzero(lb == ub)
    lower = np.flatnonzero(np.isfinite(lb) & (lb < ub))
    upper = np.flatnonzero(np.isfinite(ub) & (lb < ub))
    return ConstraintRows(
        E=_stack(problem.A, _unit_rows(lower, n, like), -_unit_rows(upper, n, like)),
        e=np.concatenate([problem.b, lb[lower], -ub[upper]]),
        F=_stack(problem.C, _unit_rows(fixed, n, like)),
        g=np.concatenate([problem.d, lb[fixed]]),
        sizes={"n": n, "m": problem.b.size, "k": problem.d.size, "lower": lower, "upper": upper, "fixed": fixed},
    )


def split(inequality: Vector, equality: Vector, sizes: Trace) -> tuple[Vector, Vector, Vector]:
    """Return λ of A, μ of C and ν of the bounds, from the multipliers of E and F."""
    m, k, lower = sizes["m"], sizes["k"], sizes["lower"]
    nu = np.zeros(sizes["n"])
    nu[lower] += inequality[m : m + lower.size]
    nu[sizes["upper"]] -= inequality[m + lower.size :]
    nu[sizes["fixed"]] += equality[k:]
    return inequality[:m], equality[:k], nu


def join(lam: Vector, mu: Vector, nu: Vector, sizes: Trace) -> tuple[Vector, Vector]:
    """Return the multipliers of E and F, from λ, μ and ν."""
    below, above = np.maximum(nu[sizes["lower"]], 0.0), np.maximum(-nu[sizes["upper"]], 0.0)
    return np.concatenate([lam, below, above]), np.concatenate([mu, nu[sizes["fixed"]]])


def polyhedron(problem: QP | AVI) -> dict[str, Any]:
    """Return the fields that define the set: rows and bounds."""
    return {name: getattr(problem, name) for name in ("A", "b", "C", "d", "lb", "ub")}


def pressing(trace: Trace, z: Vector, lam: Vector, mu: Vector) -> Vector:
    """Return ν = Mz + q − Aᵀλ − Cᵀμ where a bound takes it, 0 where z is free to follow: there it is an error of z.

    Of the force and the distance to the bound that it presses against, both without units, the smaller counts as 0: the
    force over the terms that it is the sum of, and the distance by what it changes in some row, over that row's terms.
    A row of which all terms are rounding tells nothing: a distance that is nothing in the gap counts as 0 in any case.
    Trace: `M`, `q`, `A`, `b`, `C`, `d`, `lb`, `ub`.
    """
    M, A, C, lb, ub = (trace[name] for name in ("M", "A", "C", "lb", "ub"))
    with np.errstate(all="ignore"):
        nu = M @ z + trace["q"] - A.T @ lam - C.T @ mu
        terms = abs(M) @ abs(z) + abs(trace["q"]) + abs(A).T @ abs(lam) + abs(C).T @ abs(mu)
        rows_of_z = ((M, terms), (A, abs(A) @ abs(z) + abs(trace["b"])), (C, abs(C) @ abs(z) + abs(trace["d"])))
        effect = np.max([_largest_in_columns(matrix, sizes) for matrix, sizes in rows_of_z], axis=0)
        distance = np.where(nu > 0.0, z - lb, ub - z)
        # at the bound itself the effect may be infinite: ∞·0 would be no number
        pressed = (distance <= 0.0) | (abs(nu) >= effect * distance * terms) | (lb == ub)
        pressed |= distance * terms <= NOTHING * (terms @ abs(z))
    return np.where(pressed, nu, 0.0)


def _largest_in_columns(matrix: Matrix, sizes: Vector) -> Vector:
    """Return the largest |entry| of each column, each over the size of its row; ∞ where only that is 0."""
    result = np.zeros(matrix.shape[1])
    entries = sp.coo_array(matrix)
    np.fmax.at(result, entries.coords[1], abs(entries.data) / sizes[entries.coords[0]])
    return result


def conditions(M: Matrix, q: Vector, constraints: ConstraintRows) -> MLCP:
    """Build u = (z, μ) free, v = λ: Mz + q − Fᵀμ − Eᵀλ = 0, Fz − g = 0, 0 ≤ λ ⟂ Ez − e ≥ 0."""
    E, F, e, g = constraints.E, constraints.F, constraints.e, constraints.g
    return MLCP(
        A=matrices.block([[M, -matrices.transpose(F)], [F, matrices.zeros(g.size, g.size, M)]]),
        B=matrices.zeros(e.size, e.size, M),
        C=matrices.block([[-matrices.transpose(E)], [matrices.zeros(g.size, e.size, M)]]),
        D=matrices.block([[E, matrices.zeros(e.size, g.size, M)]]),
        a=np.concatenate([q, -g]),
        b=-e,
    )


def _unit_rows(which: NDArray[np.int64], n: int, like: Matrix) -> Matrix:
    """Return the rows `which` of the identity."""
    ones = (np.ones(which.size), (np.arange(which.size), which))
    unit = sp.csr_array(ones, shape=(which.size, n))
    return unit if matrices.is_sparse(like) else matrices.dense(unit)


def _stack(*parts: Matrix) -> Matrix:
    return matrices.block([[part] for part in parts])
