"""Complementarity problems side by side, each of its own size: what automatic choices claim, and what is measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.formulations.linear import LCP, MLCP
from cpbench.foundation.matrices import Dense, Vector
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench.verification import judge

SEEDS = [1, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in (2, 3))]


def planted_parts(rng: np.random.Generator, count: int) -> tuple[list[Dense], list[Vector]]:
    """Draw M and q with planted solutions, rows and unknowns of each a million times apart."""
    matrices, constants = [], []
    for _ in range(count):
        n = int(rng.integers(1, 12))
        A = rng.standard_normal((n, n))
        kinds = A @ A.T / n + 0.1 * np.eye(n), A @ A.T / n + A - A.T, abs(A) + n * np.eye(n)
        M = kinds[rng.integers(3)]
        z = np.maximum(rng.standard_normal(n), 0.0)
        w = np.where(z > 0, 0.0, np.maximum(rng.standard_normal(n), 0.0))
        of_rows, of_unknowns = 10.0 ** rng.uniform(-6, 6, 2)
        matrices.append(of_rows * of_unknowns * M)
        constants.append(of_rows * (w - M @ z))
    return matrices, constants


def block_diagonal(matrices: list[Dense]) -> Any:
    """Put matrices side by side, sparse."""
    return sp.block_diag(list(map(sp.csr_array, matrices)), format="csr")


def check(name: str, problem: LCP | MLCP) -> None:
    """Assert that a claim at three tolerances is what the verdict measures."""
    for tolerance in (1e-4, 1e-6, 1e-8):
        output = solvers.get(name).run(problem, Budget(tolerance=tolerance, seconds=5.0))
        error = judge(problem, output.point, tolerance).error
        assert error <= tolerance or output.claim is not Claim.SOLVED, f"{tolerance}: {error:.1e}"


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("count", [10, 50])
@pytest.mark.parametrize("seed", SEEDS)
def test_no_claim_on_lcps_side_by_side_fails(seed: int, count: int) -> None:
    matrices, constants = planted_parts(np.random.default_rng(seed), count)
    check("auto-lcp", LCP(M=block_diagonal(matrices), q=np.concatenate(constants)))


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("count", [10, 50])
@pytest.mark.parametrize("seed", SEEDS)
def test_no_claim_on_mlcps_side_by_side_fails(seed: int, count: int) -> None:
    matrices, constants = planted_parts(np.random.default_rng(seed), count)
    free = [q.size // 3 for q in constants]
    A, C, D, B = (
        block_diagonal([M[rows(k), columns(k)] for M, k in zip(matrices, free, strict=True)])
        for rows in (lambda k: slice(k), lambda k: slice(k, None))
        for columns in (lambda k: slice(k), lambda k: slice(k, None))
    )
    a = np.concatenate([q[:k] for q, k in zip(constants, free, strict=True)])
    b = np.concatenate([q[k:] for q, k in zip(constants, free, strict=True)])
    check("auto-mlcp", MLCP(A=A, C=C, D=D, B=B, a=a, b=b))
