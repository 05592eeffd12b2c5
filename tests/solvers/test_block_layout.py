"""W by rows of blocks against W as a dense array: patterns that are not symmetric, blocks that are not full."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation.matrices import adopt
from cpbench_solvers.contact.sweeps import block_rows


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("density", [0.03, 0.4, 1.0])
@pytest.mark.parametrize("index", [np.int32, np.int64, None])
def test_rows_of_blocks_are_those_of_the_matrix(
    rng: np.random.Generator, dimension: int, density: float, index: Any
) -> None:
    d, nc = dimension, 9
    entries = rng.standard_normal((d * nc, d * nc)) * (rng.random((d * nc, d * nc)) < density)
    W: Any = entries
    if index is not None:
        W = sp.csr_array(entries)
        W = adopt(sp.csr_array((W.data, W.indices.astype(index), W.indptr.astype(index)), shape=W.shape))
    rows = block_rows(FrictionContact(W=W, q=np.ones(d * nc), mu=np.ones(nc), dimension=d))
    found = np.zeros((nc, d, nc, d))
    for i in range(nc):
        found[i, :, i, :] = rows.diagonal[i].reshape(d, d)
        columns = rows.column[int(rows.start[i]) : int(rows.start[i + 1])]
        assert list(columns) == sorted(set(columns) - {i})
        for k, j in enumerate(columns, int(rows.start[i])):
            block = rows.blocks[d * d * k : d * d * (k + 1)].reshape(d, d)
            assert block.any()
            found[i, :, j, :] = block.T if d == 3 else block
    np.testing.assert_array_equal(found.reshape(d * nc, d * nc), entries)


def test_sweeps_beyond_the_caches_are_those_within(rng: np.random.Generator) -> None:
    """A sweep asks for rows ahead when there are many, which changes no bit: many copies of a small problem."""
    from cpbench_solvers.contact.sweeps import Sweeps
    from cpbench_solvers.kernels import gauss_seidel

    A = rng.standard_normal((90, 90))
    small = sp.csr_array(A @ A.T)
    copies = 2 * gauss_seidel.CACHED // small.nnz
    few, many = (
        FrictionContact(
            W=sp.csr_array(sp.block_diag([small] * count)), q=np.tile(A[0], count), mu=np.full(30 * count, 0.5)
        )
        for count in (1, copies)
    )
    answers = [np.zeros(few.q.size), np.zeros(many.q.size)]
    for problem, r in zip((few, many), answers, strict=True):
        rows = block_rows(problem)
        assert (rows.blocks.size > gauss_seidel.CACHED) == (problem is many)
        Sweeps(rows).sweep(r, 3, 0.0)
    np.testing.assert_array_equal(answers[1].reshape(copies, -1), np.tile(answers[0], (copies, 1)))
