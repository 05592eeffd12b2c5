"""Factors of positive definite sparse matrices, and SuperLU without memory."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.definite import factor_on_diagonal, is_definite


def grid(n: int, shift: float) -> Any:
    """The five-point Laplacian on n² points plus `shift`; its least eigenvalue is 8 sin²(π/(2n + 2)) + shift."""
    T = sp.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])  # pyright: ignore[reportCallIssue, reportArgumentType]
    return sp.csr_array(sp.kronsum(T, T) + shift * sp.eye_array(n * n))


def test_pivots_on_the_diagonal_tell_definiteness() -> None:
    least = 8 * np.sin(np.pi / 26) ** 2
    assert is_definite(factor_on_diagonal(grid(12, -0.9 * least)))
    assert not is_definite(factor_on_diagonal(grid(12, -1.1 * least)))
    assert factor_on_diagonal(sp.csr_array(np.diag([1.0, 0.0]))) is None


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
