"""Answers to the linear formulations as systems to be measured: unknowns, rows, terms and sets of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector, transpose
from cpbench.registry import NodeTable
from cpbench.verification.linear import orientation
from cpbench.verification.rows import ROWS, STACKED, Frame, System, kept, term_sizes
from cpbench.verification.sets import INFINITE, Sets

BOUNDS: NodeTable[Callable[[Any], tuple[Any, Any]]] = NodeTable("bounds beside F")
"""Bounds of the unknowns, by formulation: those that are mixed complementarity problems without any conversion."""
BOUNDS.enter(lambda problem: (0.0, np.inf), "lcp", "ncp")
BOUNDS.enter(lambda problem: (problem.lb, problem.ub), "relay", "micp")
BOUNDS.enter(lambda problem: (-np.inf, np.inf), "equation")
BOUNDS.enter(lambda problem: (np.repeat([-np.inf, 0.0], [problem.a.size, problem.b.size]), np.inf), "mlcp")

STACKED.enter(True, "lcp", "mlcp", "qp")


@ROWS.of("lcp", "relay")
def relay(P: Any, point: Any) -> System:
    """Return z between bounds beside Mz + q; those of an LCP are 0 and ∞."""

    def frame() -> Frame:
        sets = Sets.of((P.q.size, *BOUNDS[P.node](P)))
        return Frame(term_sizes(P.M), np.abs(P.q), sets, P.q, None, *orientation(P.M))

    return System(kept(P, frame), point.z, P.M @ point.z + P.q)


@ROWS.of("mlcp")
def mlcp(problem: Any, point: Any) -> System:
    """Return (u, v) with v ≥ 0 beside Au + Cv + a and Du + Bv + b."""
    P, u, v = problem, point.u, point.v

    def frame() -> Frame:
        sets = Sets.of((u.size, -np.inf, np.inf), (v.size, 0.0, np.inf))
        constants = np.concatenate([P.a, P.b])
        J = matrices.block([[P.A, P.C], [P.D, P.B]])
        return Frame(term_sizes(J), np.abs(constants), sets, constants, None, *orientation(J))

    f = np.concatenate([P.A @ u + P.C @ v + P.a, P.D @ u + P.B @ v + P.b])
    return System(kept(P, frame), np.concatenate([u, v]), f)


@ROWS.of("avi")
def avi(problem: Any, point: Any) -> System:
    """Return z and the multipliers of its rows beside Mz + q less their forces, and the rows."""
    return _with_rows(problem, point, problem.M, problem.q)


@ROWS.of("qp")
def qp(problem: Any, point: Any) -> System:
    """Return z and the multipliers of its rows beside Qz + p less their forces, and the rows."""
    return _with_rows(problem, point, problem.Q, problem.p)


def _with_rows(P: Any, point: Any, M: Matrix, q: Vector) -> System:
    """Mz + q − Aᵀλ − Cᵀμ beside the box of z, Az − b beside λ, Cz − d beside μ; ν, where given, is the first."""
    z, mu = point.z, point.mu
    n, m, k = z.size, P.b.size, mu.size
    # a side from 1e19 on is none: nothing holds there, and its multiplier certifies nothing
    bound = P.b > -INFINITE
    endless = not bound.all()
    lam, b = (np.where(bound, point.lam, 0.0), np.where(bound, P.b, 0.0)) if endless else (point.lam, P.b)

    def frame() -> Frame:
        J = sp.block_array([[M, -transpose(P.A), -transpose(P.C)], [P.A, None, None], [P.C, None, None]])
        multiplier, program = np.arange(n + m + k) >= n, np.ones(n + m + k, dtype=bool)
        if P.node != "qp":
            multiplier, program = orientation(J)
        return Frame(
            terms=term_sizes(J),
            constants=np.abs(np.concatenate([q, b, P.d])),
            sets=Sets.of((n, P.lb, P.ub), (m, 0.0, np.inf), (k, -np.inf, np.inf)),
            signed=np.concatenate([q, -b, -P.d]),
            multiplier=multiplier,
            program=program,
            certifying=P.node == "qp",
            rows=sp.vstack([sp.csr_array(P.A), sp.csr_array(P.C)]) if P.node == "qp" and m + k > 1 else None,
        )

    force = M @ z + q - P.A.T @ lam - P.C.T @ mu
    rows = np.concatenate([P.A @ z - b, P.C @ z - P.d])
    if endless:
        rows[:m][~bound] = 0.0
    nu = getattr(point, "nu", None)
    return System(
        frame=kept(P, frame),
        x=np.concatenate([z, lam, mu]),
        f=np.concatenate([force, rows]),
        also=None if nu is None else (force - nu, slice(0, n)),
    )
