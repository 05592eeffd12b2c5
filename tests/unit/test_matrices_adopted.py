"""Matrices of one's own making are taken over without a copy, and only as long as nobody touches them."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.errors import ProblemError
from cpbench.foundation import matrices


def fresh() -> sp.csr_array:
    return sp.csr_array(np.array([[1.0, 0.0], [2.0, 3.0]]))


def test_an_adopted_matrix_is_shared_and_frozen() -> None:
    M = matrices.adopt(fresh())
    assert matrices.matrix(M) is M
    with pytest.raises(ValueError, match="read-only"):
        M.data[0] = 5.0


def test_a_matrix_once_taken_is_not_copied_again() -> None:
    given = fresh()
    taken = matrices.matrix(given)
    assert not np.shares_memory(taken.data, given.data)
    assert matrices.matrix(taken) is taken


@pytest.mark.parametrize("what", ["thawed", "replaced", "pickled", "copied"])
def test_whoever_touches_it_gets_a_copy(what: str) -> None:
    M = matrices.adopt(fresh())
    if what == "thawed":
        M.data.setflags(write=True)
    elif what == "replaced":
        M.data = np.array([1.0, np.nan, 3.0])
        matrices.freeze(M.data)
    else:
        M = pickle.loads(pickle.dumps(M)) if what == "pickled" else M.copy()
    if what == "replaced":
        with pytest.raises(ProblemError, match="1 non-finite"):
            matrices.matrix(M)
    else:
        assert not np.shares_memory(matrices.matrix(M).data, M.data)


def test_settle_takes_only_what_keeps_the_promise() -> None:
    good = matrices.settle(fresh())
    assert matrices.matrix(good) is good
    doubled = sp.csr_array((np.ones(2), np.array([1, 1]), np.array([0, 2])), shape=(1, 2))
    assert matrices.matrix(matrices.settle(doubled)).nnz == 1
    spoilt = fresh()
    spoilt.data[1] = np.inf
    with pytest.raises(ProblemError, match="non-finite"):
        matrices.matrix(matrices.settle(spoilt))


def test_finite_entries_whose_sum_overflows_are_finite() -> None:
    assert matrices.vector(np.full(3, 1e308)).size == 3
    with pytest.raises(ProblemError, match="2 non-finite entries, the first at 0"):
        matrices.vector([np.inf, -np.inf, 1.0])
