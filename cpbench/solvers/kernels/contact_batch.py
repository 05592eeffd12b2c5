"""Accelerated Gauss–Seidel sweeps on many frictional contact problems of one size."""

import numpy as np
from numba import float64, int64, njit, types, void

from cpbench.solvers.kernels.anderson import ANSWER, accelerated
from cpbench.solvers.kernels.array_types import COMPILED, DATA_2D
from cpbench.solvers.kernels.block_layout import one_contact_constants
from cpbench.solvers.kernels.sweep_progress import CONTINUE

DATA_3D = types.Array(float64, 3, "C", readonly=True)


@njit(void(DATA_3D, DATA_2D, DATA_2D, int64, int64, float64, int64, float64[::1], float64[:, ::1]), **COMPILED)
def contact_batch(W, q, mu, dimension, memory, tolerance, most, work, r):
    """Solve each of W (k, n, n), q (k, n), mu (k, nc) by at most so many sweeps; writes r (k, n).

    work : (`work_size` of `anderson`,), workspace.
    """
    n, nc, d = q.shape[1], mu.shape[1], dimension
    start, column = np.arange(nc + 1).astype(np.uint64), np.empty(nc * (nc - 1), np.uint32)
    for i in range(nc + 1):
        start[i] = np.uint64(i * (nc - 1))
    blocks = np.zeros(column.size * d * d + (1 if d == 3 else 0))
    # the kernel of 3×3 blocks reads them by columns
    down, right = (1, 3) if d == 3 else (d, 1)
    diagonal, D = np.empty((nc, d * d)), np.empty((nc, d, d))
    local = np.empty((nc if d == 3 else 0, 12))
    rho, order = np.empty(nc), np.arange(nc)
    for p in range(q.shape[0]):
        at = 0
        for i in range(nc):
            trace = 0.0
            for j in range(nc):
                for a in range(d):
                    for b in range(d):
                        entry = W[p, d * i + a, d * j + b]
                        if i == j:
                            D[i, a, b] = diagonal[i, d * a + b] = entry
                            trace += entry if a == b else 0.0
                        else:
                            blocks[d * d * at + down * a + right * b] = entry
                if i != j:
                    column[at] = j
                    at += 1
            rho[i] = d / trace if trace > 0.0 else 1.0
        if d == 3:
            one_contact_constants(D, local)
        work[0] = 0.0
        outcome, done = CONTINUE, 0
        while outcome == CONTINUE and done < most:
            outcome, done, _, _ = accelerated(
                start, column, blocks, diagonal, local, q[p], mu[p], rho, order, memory, d, work, tolerance, most, False
            )
        for a in range(n):
            r[p, a] = work[ANSWER + a]


READY = True
