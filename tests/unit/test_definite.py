"""Factors of positive definite sparse matrices: three libraries on the same systems."""

from __future__ import annotations

import subprocess
import sys
from typing import Any, get_args

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.errors import NotApplicable
from cpbench.formulations import FrictionContact
from cpbench.foundation.definite import By, definite_factors, factor_on_diagonal, is_definite
from cpbench.solvers import Budget, Claim, solvers
from cpbench.testing import planted
from cpbench.verification import judge

ALL = get_args(By)


def grid(n: int, shift: float) -> Any:
    """The five-point Laplacian on n² points plus `shift`; its least eigenvalue is 8 sin²(π/(2n + 2)) + shift."""
    T = sp.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])  # pyright: ignore[reportCallIssue, reportArgumentType]
    return sp.csr_array(sp.kronsum(T, T) + shift * sp.eye_array(n * n))


@pytest.mark.parametrize("by", ALL)
def test_factors_solve_and_count(by: By) -> None:
    A = grid(12, 0.5)
    x = np.random.default_rng(1).standard_normal(A.shape[0])
    factors = definite_factors(A, by)
    assert factors is not None
    np.testing.assert_allclose(factors.solve(A @ x), x, rtol=0, atol=1e-12)
    assert (factors.entries or 0) <= A.shape[0] ** 2
    if by != "cholmod":
        assert factors.entries is not None
        assert factors.entries >= sp.tril(A, -1).nnz


@pytest.mark.parametrize("by", ["cholmod", "qdldl"])
def test_an_indefinite_matrix_has_none(by: By) -> None:
    least = 8 * np.sin(np.pi / 26) ** 2
    assert definite_factors(grid(12, -0.9 * least), by) is not None
    assert definite_factors(grid(12, -1.1 * least), by) is None
    assert definite_factors(sp.csr_array(np.diag([1.0, 0.0])), by) is None


def test_pivots_on_the_diagonal_tell_definiteness() -> None:
    least = 8 * np.sin(np.pi / 26) ** 2
    assert is_definite(factor_on_diagonal(grid(12, -0.9 * least)))
    assert not is_definite(factor_on_diagonal(grid(12, -1.1 * least)))
    assert factor_on_diagonal(sp.csr_array(np.diag([1.0, 0.0]))) is None


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("by", ALL)
def test_admm_with_any_of_them(by: By) -> None:
    problem, _ = planted.fc(np.random.default_rng(2), 6, 3, "positive definite", sparse=True)
    solver = solvers.get("admm-fc")
    output = solver.run(problem, Budget(tolerance=1e-9), solver.spec.options(factors=by))
    assert output.claim is Claim.SOLVED
    assert judge(problem, output.point, 1e-9).solved


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("by", ["cholmod", "qdldl"])
def test_a_nonsymmetric_matrix_is_refused(by: By) -> None:
    W = np.eye(3) + np.triu(np.full((3, 3), 0.1), 1)
    problem = FrictionContact(W=sp.csr_array(W), q=np.array([-1.0, 0.3, 0.2]), mu=np.array([0.5]))
    solver = solvers.get("admm-fc")
    with pytest.raises(NotApplicable, match="not symmetric"):
        solver.run(problem, Budget(), solver.spec.options(factors=by))


WITHOUT_MEMORY = """
import resource, sys
from pathlib import Path
import numpy as np, scipy.sparse as sp
from cpbench.foundation.factorization import Factorization

n = 2000
A = sp.csr_array(sp.diags_array([np.full(n - 1, -1.0), np.full(n, 4.0), np.full(n - 1, -1.0)], offsets=[-1, 0, 1]))
factors, right = Factorization(A), np.ones((n, 5000))
factors.solve(right[:, :2])
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + right.nbytes * 3 // 2,) * 2)  # SuperLU takes two copies
try:
    factors.solve(right)
except MemoryError as cause:
    sys.exit(0 if "SUPERLU" in str(cause) else "not of SuperLU")
sys.exit("solved")
"""


def test_superlu_without_memory_is_out_of_memory() -> None:
    """It says so by a RuntimeError, as it says that a matrix is singular: the status was `error`, or `singular`."""
    done = subprocess.run([sys.executable, "-c", WITHOUT_MEMORY], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
