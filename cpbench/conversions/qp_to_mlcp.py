"""QP → MLCP by its optimality conditions, Karush–Kuhn–Tucker (equation (3)).

Source  min ½zᵀQz + pᵀz  subject to  Az ≥ b (λ),  Cz = d (μ),  lb ≤ z ≤ ub (ν, positive at lb).
        Finite bounds become rows: E = [A; I_lb; −I_ub], e = [b; lb; −ub]; a variable with lb = ub is one more
        equality, F = [C; I_fixed], g = [d; lb], instead of two inequalities with unbounded multipliers.
Target  u = (z, μ) free, v = λ:  Qz − Fᵀμ − Eᵀλ + p = 0,  Fz − g = 0,  0 ≤ λ ⟂ Ez − e ≥ 0.
Lift    z, λ and μ of A and C; ν = ν_lb − ν_ub + μ_fixed.        Push  the same, backwards.
Kind    equivalent when Q is positive semidefinite, otherwise necessary (stationary points).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench import matrices
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.formulations.qp import QP, QPPoint
from cpbench.matrices import Matrix


@conversions.register("qp-mlcp")
@dataclass(frozen=True)
class QPtoMLCP(Conversion):
    """Stationarity and complementarity of a QP.

    Trace: `n`, `m`, `k` (sizes of z, λ, μ), and the indices `lower`, `upper`, `fixed` of the bounds that became rows.
    """

    name = "qp-mlcp"
    source = "qp"
    target = "mlcp"
    equation = "(3)"
    kind = Kind.NECESSARY
    best_kind = Kind.EQUIVALENT
    cost = 1.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, QP)
        return self.best_kind if problem.convex else self.kind

    def apply(self, problem: QP) -> tuple[MLCP, Trace]:
        Q, lb, ub, n = problem.Q, problem.lb, problem.ub, problem.p.size
        fixed = np.flatnonzero(lb == ub)
        lower = np.flatnonzero(np.isfinite(lb) & (lb < ub))
        upper = np.flatnonzero(np.isfinite(ub) & (lb < ub))
        E = _stack(problem.A, _rows(lower, n, Q), -_rows(upper, n, Q))
        F = _stack(problem.C, _rows(fixed, n, Q))
        e = np.concatenate([problem.b, lb[lower], -ub[upper]])
        g = np.concatenate([problem.d, lb[fixed]])
        target = MLCP(
            A=matrices.block([[Q, -matrices.transpose(F)], [F, matrices.zeros(g.size, g.size, Q)]]),
            B=matrices.zeros(e.size, e.size, Q),
            C=matrices.block([[-matrices.transpose(E)], [matrices.zeros(g.size, e.size, Q)]]),
            D=matrices.block([[E, matrices.zeros(e.size, g.size, Q)]]),
            a=np.concatenate([problem.p, -g]),
            b=-e,
        )
        sizes = {"n": n, "m": problem.b.size, "k": problem.d.size}
        return target, sizes | {"lower": lower, "upper": upper, "fixed": fixed}

    def lift(self, point: MLCPPoint, trace: Trace) -> QPPoint:
        n, m, k, lower = trace["n"], trace["m"], trace["k"], trace["lower"]
        nu = np.zeros(n)
        nu[lower] += point.v[m : m + lower.size]
        nu[trace["upper"]] -= point.v[m + lower.size :]
        nu[trace["fixed"]] += point.u[n + k :]
        return QPPoint(z=point.u[:n], lam=point.v[:m], mu=point.u[n : n + k], nu=nu)

    def push(self, point: QPPoint, trace: Trace) -> MLCPPoint:
        nu = point.nu
        return MLCPPoint(
            u=np.concatenate([point.z, point.mu, nu[trace["fixed"]]]),
            v=np.concatenate(
                [point.lam, np.maximum(nu[trace["lower"]], 0.0), np.maximum(-nu[trace["upper"]], 0.0)],
            ),
        )


def _rows(which: NDArray[Any], n: int, like: Matrix) -> Matrix:
    """The rows `which` of the identity."""
    ones = (np.ones(which.size), (np.arange(which.size), which))
    rows = sp.csr_array(ones, shape=(which.size, n))
    return rows if matrices.is_sparse(like) else matrices.dense(rows)


def _stack(*parts: Matrix) -> Matrix:
    return matrices.block([[part] for part in parts])
