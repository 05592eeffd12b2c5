"""LCP and MLCP solvers of other packages on planted and published problems, judged by our residuals.

A planted LCP chooses z and w first and computes q = w − Mz. Murty's and Fathi's matrices make Lemke's method take
2ⁿ pivots from some covering vectors (Murty 1978, Fathi 1979); their solutions are known for q = −e.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import planted
import pytest
import scipy.sparse as sp
from tiers import some_by_day

from cpbench.formulations import LCP, MLCP
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_adapters import gams_workspace
from cpbench_adapters.scaled_mcp import scaled_mcp

ON_LCP = ("casadi-ipopt", "drake-lemke", "drake-moby", "gams-path")
ON_MLCP = ("casadi-ipopt-mlcp", "gams-path-mlcp")
GAMS = ("gams-path", "gams-path-mlcp")


def ready(name: str) -> Any:
    """The solver, or a skip that says why not; a licence that ran out is not for a test to mend."""
    solver = solvers.get(name)
    available = solver.availability()
    if available.state == "licence":
        pytest.skip(f"needs a licence: {available.detail}")
    if not available.ok:
        pytest.skip(f"needs a package: {available.detail}")
    return solver


def murty(n: int) -> LCP:
    """1 on the diagonal, 2 above it, q = −e: z = e_n."""
    return LCP(M=np.eye(n) + 2.0 * np.triu(np.ones((n, n)), 1), q=-np.ones(n))


def fathi(n: int) -> LCP:
    """LLᵀ of Murty's matrix transposed, positive definite, q = −e: z = e_1."""
    L = np.eye(n) + 2.0 * np.tril(np.ones((n, n)), -1)
    return LCP(M=L @ L.T, q=-np.ones(n))


def degenerate(n: int) -> LCP:
    """A third of the pairs has z = w = 0."""
    rng = np.random.default_rng(5)
    kind = np.arange(n) % 3
    F = rng.normal(size=(n, n))
    M = F @ F.T / n + np.eye(n)
    return LCP(M=M, q=np.where(kind == 1, rng.random(n) + 0.1, 0.0) - M @ np.where(kind == 0, rng.random(n) + 0.1, 0.0))


def planted_lcp(kind: str, n: int, seed: int, *, sparse: bool = False) -> LCP:
    return planted.lcp(np.random.default_rng(seed), n, kind, sparse=sparse)[0]


LCPS = {
    "definite": planted_lcp("positive definite", 30, 1),
    "semidefinite": planted_lcp("singular semidefinite", 30, 2),
    "nonsymmetric": planted_lcp("monotone", 30, 3),
    "sparse": planted_lcp("positive definite", 30, 4, sparse=True),
    "degenerate": degenerate(30),
    "murty": murty(8),
    "fathi": fathi(6),
    "larger": planted_lcp("positive definite", 120, 6),
}
MLCPS = {
    kind: planted.mlcp(np.random.default_rng(seed), 12, 15, kind)[0]
    for seed, kind in enumerate(("positive definite", "monotone", "singular"))
}


def honest(solver: Any, problem: Any, tolerance: float) -> bool:
    """Whether it solves the problem; a claim of it that is not true fails."""
    output = solver.run(problem, Budget(tolerance=tolerance, seconds=30.0))
    error = judge(problem, output.point, tolerance).error if output.point is not None else math.inf
    if output.claim is Claim.SOLVED:
        assert error <= tolerance, f"claims solved, error {error:.1e} > {tolerance:.0e}"
    return output.claim is Claim.SOLVED


@pytest.mark.parametrize("case", LCPS)
@pytest.mark.parametrize("name", some_by_day(ON_LCP, 2))
def test_lcp(name: str, case: str) -> None:
    solver = ready(name)
    assert honest(solver, LCPS[case], 1e-6) == (f"planted-{case}" not in solver.spec.known_failures)


@pytest.mark.parametrize("case", some_by_day(MLCPS, 2))
@pytest.mark.parametrize("name", ON_MLCP)
def test_mlcp(name: str, case: str) -> None:
    solver = ready(name)
    assert honest(solver, MLCPS[case], 1e-6) == (f"planted-{case}" not in solver.spec.known_failures)


def test_ipopt_says_that_a_local_minimum_is_no_solution() -> None:
    """M = -1, q = 1: z = 0 and z = 1 solve it, and vᵀw = z(1 − z) is 0 at both ends, so that it finds one."""
    solver = ready("casadi-ipopt")
    problem = LCP(M=-np.eye(1), q=np.ones(1))
    output = solver.run(problem)
    assert (output.claim is Claim.SOLVED) == judge(problem, output.point, 1e-6).solved


def test_units_do_not_change_the_scaled_problem() -> None:
    """z in other units: the same K and c; tolerances on them mean the same."""
    problem = LCPS["definite"]
    one = scaled_mcp(problem)
    other = scaled_mcp(LCP(M=1e8 * problem.M, q=problem.q))
    np.testing.assert_allclose(other.K, one.K, rtol=1e-12)
    np.testing.assert_allclose(other.k, one.k, rtol=1e-12)
    np.testing.assert_allclose(other.unit, 1e-8 * one.unit, rtol=1e-12)
    assert np.abs(one.k).max() == 1.0


@pytest.mark.parametrize("name", ON_LCP)
def test_what_is_too_large_is_refused_with_the_number(name: str) -> None:
    solver = ready(name)
    n = 30_000
    why = solver.obstacle(LCP(M=sp.csr_array(sp.eye_array(n)), q=np.ones(n)))
    if name not in GAMS or gams_workspace.most_rows() is not None:
        assert str(n) in str(why)


def test_drake_is_not_given_what_it_aborts_on() -> None:
    assert "abort" in str(solvers.get("drake-lemke").obstacle(LCP(M=np.zeros((2, 2)), q=np.ones(2))))


@pytest.mark.parametrize("name", GAMS)
def test_the_solvers_of_gams_say_what_may_be_published(name: str) -> None:
    spec = solvers.get(name).spec
    assert spec.licence == "proprietary"
    assert "Gurobi" in spec.publishing


def test_the_demo_of_gams_ends_at_1000_rows() -> None:
    """Measured: 1000 rows pass, 1001 are refused."""
    path = solvers.get("gams-path")
    if gams_workspace.most_rows() is None:
        pytest.skip("does not apply: a licence without that limit")

    def identity(n: int) -> LCP:
        return LCP(M=sp.csr_array(sp.eye_array(n)), q=np.ones(n))

    assert path.obstacle(identity(1000)) is None
    assert "1001 rows" in str(path.obstacle(identity(1001)))


def test_gams_is_not_given_what_it_refuses() -> None:
    path = solvers.get("gams-path")
    for M in ([[1.0, 0], [1, 0]], [[1.0, 1], [0, 0]]):
        assert "no entry" in str(path.obstacle(LCP(M=np.array(M), q=np.ones(2))))
    no_row = MLCP(A=np.zeros((1, 1)), B=np.eye(1), C=np.zeros((1, 1)), D=np.eye(1), a=[1.0], b=[0.0])
    assert "1 rows" in str(solvers.get("gams-path-mlcp").obstacle(no_row))
