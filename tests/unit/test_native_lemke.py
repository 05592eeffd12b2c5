"""Lemke's kernels against the method on a full tableau; updates by products against updates by vectors; batches."""

from __future__ import annotations

import numpy as np
import pytest

from cpbench import kernel_cache
from cpbench.errors import ProblemError
from cpbench.formulations import LCP, LCPPoint
from cpbench.solvers import Budget, Claim, solvers
from cpbench.solvers.native.lcp import lemke, lemke_columns
from cpbench.testing import planted
from cpbench.verification import judge

KINDS = ("positive definite", *planted.SQUARE[:3])


def reference_pivots(M: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, int]:
    """z and pivots of Lemke's method on the full tableau [I, −M, −e | q] (Cottle, Pang, Stone, 4.4), no ties."""
    n = q.size
    T = np.hstack([np.eye(n), -M, -np.ones((n, 1)), q[:, None]])
    basis = list(range(n))
    row, entering = int(np.argmin(q)), 2 * n
    for pivots in range(1, 20 * n):
        T[row] /= T[row, entering]
        others = np.arange(n) != row
        T[others] -= np.outer(T[others, entering], T[row])
        leaving, basis[row] = basis[row], entering
        if leaving == 2 * n:
            x = np.zeros(2 * n + 1)
            x[basis] = T[:, -1]
            return x[n : 2 * n], pivots
        entering = leaving + n if leaving < n else leaving - n
        blocks = T[:, entering] > 1e-11
        assert blocks.any()
        row = int(np.argmin(np.where(blocks, T[:, -1] / np.where(blocks, T[:, entering], 1.0), np.inf)))
    raise AssertionError("too many pivots")


@pytest.mark.parametrize("n", [3, 12, 16, 17, 60])
def test_both_loops_take_the_pivots_of_the_full_tableau(n: int) -> None:
    """On either side of the size from which columns are updated when they are needed."""
    kernel = kernel_cache.load("cpbench.solvers.kernels.pivoting")
    rng = np.random.default_rng(n)
    for _ in range(10):
        M, q, z = planted.square(rng, n, "positive definite"), rng.standard_normal(n), np.empty(n)
        q[0] = -abs(q[0])
        expected, pivots = reference_pivots(M, q)
        code = kernel.lemke(M, q, z, 1000, 1e-11, 1e-13)
        assert (code % kernel.CODES, code // kernel.CODES) == (kernel.COMPLEMENTARY, pivots)
        np.testing.assert_allclose(z, expected, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(("block", "room"), [(2, 0), (4, 8), (3, 6), (8, 0), (32, 0)])
@pytest.mark.parametrize("kind", KINDS)
def test_updates_by_products_are_those_by_vectors(
    monkeypatch: pytest.MonkeyPatch, block: int, room: int, kind: str
) -> None:
    """The same pivots and values, also where rows are pivoted on twice in a block and pivots are forgotten."""
    kernel = kernel_cache.load("cpbench.solvers.kernels.pivoting")
    monkeypatch.setattr(lemke_columns, "FAR", 1)
    monkeypatch.setattr(lemke_columns, "LIKELY", 5)
    options = lemke.LemkeOptions()
    for seed in range(5):
        problem, _ = planted.lcp(np.random.default_rng(seed), 40, kind)
        M, q = np.array(problem.M), np.array(problem.q)
        if q.min() >= 0.0:
            continue
        unit = np.abs(q).max() / np.abs(M).max()
        run = lemke_columns.Columns(
            kernel, M.T, q / np.abs(q).max(), factor=-1.0 / np.abs(M).max(), block=block, room=room
        )
        while (status := run.advance(3000, options.pivot_tolerance, options.tie_tolerance)) in (
            kernel.BEHIND,
            kernel.FULL,
        ):
            run.bring_likely() if status == kernel.BEHIND else run.forget_pivots()
        z = np.empty(40)
        code = kernel.lemke(M, q, z, 3000, options.pivot_tolerance, options.tie_tolerance)
        assert code % kernel.CODES == status == kernel.COMPLEMENTARY
        if kind == "positive definite":
            assert run.pivots == code // kernel.CODES
            np.testing.assert_allclose(run.z * unit, z, rtol=1e-7, atol=1e-9)
        assert judge(problem, LCPPoint(z=run.z * unit), 1e-8).solved


@pytest.mark.parametrize("kind", KINDS)
def test_hundreds_of_unknowns(kind: str) -> None:
    problem, _ = planted.lcp(np.random.default_rng(1), 400, kind)
    output = solvers.get("lemke").run(problem, Budget(tolerance=1e-9))
    assert output.claim is Claim.SOLVED, output.message


@pytest.mark.parametrize("n", [1, 6, 30])
@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_is_its_problems_one_by_one(n: int, threads: int) -> None:
    rng = np.random.default_rng(n)
    problems = [planted.lcp(rng, n, "positive definite")[0] for _ in range(9)]
    found = lemke.batch(np.array([p.M for p in problems]), np.array([p.q for p in problems]), threads=threads)
    assert found.complementary.all()
    for problem, z, pivots in zip(problems, found.z, found.pivots, strict=True):
        assert judge(problem, LCPPoint(z=z), 1e-10).solved
        assert pivots == solvers.get("lemke").run(problem).counters["pivots"]


def test_a_batch_says_which_ended_in_a_ray() -> None:
    """-z - 1 = w has no solution, z - 1 = w has z = 1."""
    found = lemke.batch(np.array([[[-1.0]], [[1.0]], [[np.nan]]]), np.array([[-1.0], [-1.0], [-1.0]]))
    assert found.complementary.tolist() == [False, True, False]
    assert found.z[1] == 1.0


def test_a_batch_of_other_shapes_is_refused() -> None:
    with pytest.raises(ProblemError, match="M must be"):
        lemke.batch(np.eye(3), np.ones(3))
    assert lemke.batch(np.empty((0, 2, 2)), np.empty((0, 2))).z.shape == (0, 2)


def test_a_ray_by_products(monkeypatch: pytest.MonkeyPatch) -> None:
    """Infeasible and larger than SMALL: the ray is recognised there too, and proven."""
    monkeypatch.setattr(lemke, "SMALL", 10)
    rng = np.random.default_rng(2)
    A = rng.standard_normal((30, 12))
    y = np.abs(rng.standard_normal(30))
    # y ≥ 0 in the null space of Mᵀ and qᵀy < 0: no z has Mz + q ≥ 0
    A -= np.outer(y, y @ A) / (y @ y)
    M = A @ A.T
    output = solvers.get("lemke").run(LCP(M=M, q=rng.standard_normal(30) - 3.0 * y))
    assert output.claim is Claim.INFEASIBLE, output.message
