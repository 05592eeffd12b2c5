"""Lemke's method on many MLCPs of one size."""

import numpy as np

from cpbench.foundation.kernels import DATA, DATA_2D, DATA_3D, float64, int64, kernel, void
from cpbench_solvers.kernels.mlcp_pivoting import HEAD, lemke_mixed, workspace


@kernel(void(DATA_3D, DATA_2D, DATA_2D, DATA_2D, DATA, int64, float64[:, ::1]))
def mlcp_batch(K, k, row_unit, unit, head, max_pivots, answers):
    """Run `lemke_mixed` on each of K (p, N, N), k, row_unit and unit (p, N); writes answers (p, N).

    head : (HEAD,) what `lemke_mixed` reads first. Its errors are of nothing here: another judges the answers.
    """
    N = k.shape[1]
    data = np.zeros(HEAD + N * (N + 3) + workspace(N, N - int(head[0])))
    data[:HEAD] = head  # the same for all: one size, one set of tolerances
    for p in range(k.shape[0]):
        at = HEAD
        for i in range(N):
            for j in range(N):
                data[at] = K[p, i, j]
                at += 1
        for i in range(N):
            data[at + i], data[at + N + i], data[at + 2 * N + i] = k[p, i], row_unit[p, i], unit[p, i]
            answers[p, i] = 0.0
        lemke_mixed(data, answers[p], max_pivots, 0.0)
