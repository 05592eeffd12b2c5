"""A sparse QP without what can be read off it, and the way back of its answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.programs import QP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench_solvers.kernels import qp_presolve, qp_sparse
from cpbench_solvers.qp.claims import Parts
from cpbench_solvers.qp.kkt_system import Entries, entries


@dataclass(frozen=True, eq=False)
class SparseQP:
    """Data as the kernels take them: G has the rows of A and then of C. The names are those of `QP`."""

    Q: Entries
    G: Entries
    p: Vector
    b: Vector
    d: Vector
    lb: Vector
    ub: Vector


def sparse_data(problem: QP) -> SparseQP:
    """Return the data of a problem; dense matrices lose their zeros."""
    G = qp_sparse.stacked(entries(problem.A), entries(problem.C))
    return SparseQP(entries(problem.Q), G, problem.p, problem.b, problem.d, problem.lb, problem.ub)


def dense_problem(data: SparseQP) -> QP:
    """Return the data as a QP with dense matrices."""
    n, m, r = data.p.size, data.b.size, data.b.size + data.d.size
    Q, G = (matrices.dense(sp.csr_array((M[2], M[1], M[0]), shape=(k, n))) for M, k in ((data.Q, n), (data.G, r)))
    return QP(Q=Q, p=data.p, A=G[:m], b=data.b, C=G[m:], d=data.d, lb=data.lb, ub=data.ub)


def presolved(data: SparseQP) -> tuple[SparseQP, Callable[[Parts], Parts]] | None:
    """Return what is left of a QP and the way back; None where nothing is done or there seems to be no solution."""
    kernel = qp_presolve
    n, m, r = data.p.size, data.b.size, data.b.size + data.d.size
    right = np.concatenate([data.b, data.d])
    p, b, lb, ub = data.p.copy(), right.copy(), data.lb.copy(), data.ub.copy()
    rows, columns = np.ones(r, dtype=bool), np.ones(n, dtype=bool)
    z, y, ops, numbers = np.zeros(n), np.zeros(r), np.zeros((n + 2 * r, 4), dtype=np.int64), np.zeros((n + 2 * r, 1))
    Gt = kernel.transposed(data.G, n)
    count = kernel.reduce(data.Q, data.G, Gt, m, p, b, lb, ub, rows, columns, z, y, ops, numbers)
    if count < 0 or (rows.all() and columns.all()):
        return None
    first, last = rows[:m], rows[m:]
    left = SparseQP(
        kernel.left_of(data.Q, columns, columns),
        kernel.left_of(data.G, rows, columns),
        p[columns],
        b[:m][first],
        b[m:][last],
        lb[columns],
        ub[columns],
    )

    def lift(parts: Parts) -> Parts:
        whole_z, whole_y, nu = z.copy(), y.copy(), np.zeros(n)
        whole_z[columns], nu[columns] = parts[0], parts[3]
        whole_y[rows] = np.concatenate([parts[1], parts[2]])
        kernel.restore(data.Q, data.G, Gt, m, data.p, right, whole_z, whole_y, nu, ops, numbers, count)
        return whole_z, whole_y[:m], whole_y[m:], nu

    return left, lift
