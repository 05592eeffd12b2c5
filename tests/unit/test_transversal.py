"""Full structural rank against SciPy's, on random patterns and on those that made SuperLU or SciPy fail."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csgraph

from cpbench import storage
from cpbench.conversions.base import make
from cpbench.foundation.matrices import sparse
from cpbench.foundation.transversal import has_full_structural_rank


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.integers(0, 30), st.floats(0.02, 0.3))
def test_agrees_with_scipy(seed, n, density):
    rng = np.random.default_rng(seed)
    A = sp.csr_array(sp.random_array((n, n), density=density, rng=rng) + sp.diags_array((rng.random(n) < 0.8) * 1.0))
    assert has_full_structural_rank(A) == (n == 0 or csgraph.structural_rank(A) == n)


def test_an_alternating_path_is_found_where_greed_fails():
    """Two even cycles joined: every greedy choice is a tie, and wrong ones leave rows over."""
    for seed in range(50):
        rng = np.random.default_rng(seed)
        n = 24
        A = np.zeros((n, n))
        A[np.arange(n), rng.permutation(n)] = 1.0
        A[rng.integers(0, n, 20), rng.integers(0, n, 20)] = 1.0
        assert has_full_structural_rank(sp.csr_array(A))
        A[:3, :] = 0.0
        A[:3, :2] = 1.0  # three rows for two columns
        assert not has_full_structural_rank(sp.csr_array(A))


@pytest.mark.parametrize(("name", "full"), [("QBEACONF", False), ("CONT-101", True), ("CVXQP1_M", True)])
def test_optimality_conditions_of_real_programs(shared_data, name, full):
    """QBEACONF's made SuperLU crash, CONT-101's keep SciPy's structural_rank busy for minutes."""
    conditions = make("qp-mlcp").step(storage.load(shared_data / "qp" / f"{name}.mat"))
    assert has_full_structural_rank(sparse(conditions.A)) == full
