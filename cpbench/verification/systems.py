"""Answers to the linear formulations as systems to be measured: unknowns, rows, terms and sets of each."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector, dense, transpose
from cpbench.verification.linear import orientation
from cpbench.verification.merit_functions import BOUNDS
from cpbench.verification.rows import ROWS, SMALL, STACKED, Frame, System, Terms, every, kept
from cpbench.verification.sets import INFINITE, Sets


def stack(blocks: list[list[Any]]) -> Any:
    """Return |K| of a matrix of blocks, None being zero: an array where it is small, else CSR."""
    heights = [next(B.shape[0] for B in row if B is not None) for row in blocks]
    widths = [next(B.shape[1] for B in column if B is not None) for column in zip(*blocks, strict=True)]
    tops, lefts = (np.cumsum([0, *sizes]).tolist() for sizes in (heights, widths))
    placed = [(B, tops[i], lefts[j]) for i, row in enumerate(blocks) for j, B in enumerate(row) if B is not None]
    shape = (tops[-1], lefts[-1])
    if shape[0] * shape[1] <= SMALL:
        K = np.zeros(shape)
        for B, i, j in placed:
            K[i : i + B.shape[0], j : j + B.shape[1]] = np.abs(dense(B))
        return K
    entries: Any = [(sp.coo_array(B), i, j) for B, i, j in placed]
    data = np.concatenate([np.abs(B.data) for B, _, _ in entries])
    rows, columns = (np.concatenate([B.coords[at] + first[at] for B, *first in entries]) for at in (0, 1))
    return sp.csr_array(sp.coo_array((data, (rows, columns)), shape=shape))


STACKED.enter(True, "lcp", "mlcp", "qp")


@ROWS.of("lcp", "relay")
def relay(P: Any, point: Any) -> System:
    """Return z between bounds beside Mz + q; those of an LCP are 0 and ∞."""

    def frame() -> Frame:
        own = Sets.of((P.q.size, *BOUNDS[P.node](P)))
        return Frame(Terms.of(abs(P.M)), np.abs(P.q), own, P.q, None, *orientation(P.M))

    return System(kept(P, frame), point.z, P.M @ point.z + P.q)


@ROWS.of("mlcp")
def mlcp(problem: Any, point: Any) -> System:
    """Return (u, v) with v ≥ 0 beside Au + Cv + a and Du + Bv + b."""
    P, u, v = problem, point.u, point.v

    def frame() -> Frame:
        own = Sets.of((u.size, -np.inf, np.inf), (v.size, 0.0, np.inf))
        constants = np.concatenate([P.a, P.b])
        J = [[P.A, P.C], [P.D, P.B]]
        return Frame(Terms.of(stack(J)), np.abs(constants), own, constants, None, *orientation(matrices.block(J)))

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
    endless = not every(bound)
    lam, b = (np.where(bound, point.lam, 0.0), np.where(bound, P.b, 0.0)) if endless else (point.lam, P.b)

    def frame() -> Frame:
        sizes = stack([[M, transpose(P.A), transpose(P.C)], [P.A, None, None], [P.C, None, None]])
        if P.node == "qp":
            multiplier, program = np.arange(n + m + k) >= n, np.ones(n + m + k, dtype=bool)
        else:
            J = [[M, -transpose(P.A), -transpose(P.C)], [P.A, None, None], [P.C, None, None]]
            multiplier, program = orientation(sp.block_array(J))
        return Frame(
            terms=Terms.of(sizes),
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
