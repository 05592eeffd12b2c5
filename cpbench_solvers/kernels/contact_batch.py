"""Accelerated Gauss–Seidel sweeps on many frictional contact problems of one size."""

import numpy as np

from cpbench.foundation.kernels import DATA_2D, DATA_3D, float64, int64, kernel, void
from cpbench_solvers.kernels.anderson import ANSWER, accelerated
from cpbench_solvers.kernels.block_layout import from_dense
from cpbench_solvers.kernels.sweep_progress import CONTINUE


@kernel(void(DATA_3D, DATA_2D, DATA_2D, int64, int64, float64, int64, float64[::1], float64[:, ::1]))
def contact_batch(W, q, mu, dimension, memory, tolerance, most, work, r):
    """Solve each of W (k, n, n), q (k, n), mu (k, nc) by at most so many sweeps; writes r (k, n).

    work : (`work_size` of `anderson`,), workspace.
    """
    n, nc, d = q.shape[1], mu.shape[1], dimension
    start, column = np.empty(nc + 1, np.uint64), np.empty(nc * (nc - 1), np.uint32)
    blocks = np.empty(column.size * d * d + (1 if d == 3 else 0))
    diagonal, local = np.empty((nc, d, d)), np.empty((nc if d == 3 else 0, 12))
    flat = diagonal.reshape(nc, d * d)
    rho, order = np.empty(nc), np.arange(nc)
    for p in range(q.shape[0]):
        from_dense(W[p], start, column, blocks, diagonal, local, rho)
        work[0] = 0.0
        outcome, done = CONTINUE, 0
        while outcome == CONTINUE and done < most:
            outcome, done, _, _ = accelerated(
                start, column, blocks, flat, local, q[p], mu[p], rho, order, memory, d, work, tolerance, most, False
            )
        for a in range(n):
            r[p, a] = work[ANSWER + a]
