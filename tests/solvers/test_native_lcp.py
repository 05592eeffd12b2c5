"""Native LCP solvers: planted problems, classics with published solutions, real files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import planted
import pytest
from claims import assert_claim, assert_own_measure

from cpbench import storage
from cpbench.formulations import LCP, LCPPoint
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_problems.generators.lcp_classics import fathi, murty
from cpbench_solvers.kernels import lcp_error

ALL = ("lemke", "bpp", "newton-min", "pgs", "psor")


def test_the_kernels_error_is_the_judges(rng: np.random.Generator) -> None:
    """Whatever the units of M, q and z."""
    kernel = lcp_error
    for _ in range(40):
        m, p, s = 10.0 ** rng.uniform(-6, 6, 3)
        M, q, z = m * rng.uniform(-1, 1, (9, 9)), p * rng.uniform(-1, 1, 9), s * rng.uniform(-0.2, 1, 9)
        problem = LCP(M=M, q=q)
        error = problem.residuals(LCPPoint(z=z)).error
        assert kernel.judged(q, z, M @ z + q, problem.z_unit) == pytest.approx(error, rel=1e-9)


@pytest.mark.parametrize("kind", planted.SQUARE)
@pytest.mark.parametrize("n", [1, 2, 9, 40])
def test_lemke_on_every_class(kind: str, n: int) -> None:
    """Solved where the theory promises it (monotone and feasible); elsewhere solved or honest."""
    for seed in range(5):
        problem, _ = planted.lcp(np.random.default_rng(seed), n, kind)
        output = solvers.get("lemke").run(problem, Budget(tolerance=1e-8))
        if kind in planted.SQUARE[:3]:
            assert output.claim is Claim.SOLVED, (seed, output.message)
        elif output.claim is Claim.SOLVED:
            assert judge(problem, output.point, 1e-8).solved


@pytest.mark.parametrize("n", [10, 100, 400])
def test_worst_cases_of_murty_and_fathi_take_few_pivots(n: int) -> None:
    for instance in (murty(n), fathi(min(n, 100))):
        output = solvers.get("lemke").run(instance.problem, Budget(tolerance=1e-9))
        assert judge(instance.problem, output.point, 1e-9).solved
        assert output.counters["pivots"] <= 3 * n


def test_large_right_hand_sides_keep_a_pivot_row(shared_data: Path) -> None:
    """deltasigma split: ratios of 1e5 and more, where an absolute tie tolerance once left no row to pivot on."""
    from cpbench import graph
    from cpbench.conversions import make

    problem = storage.load(shared_data / "mlcp" / "deltasigma_mlcp.dat")
    split = graph.arrive(problem, "lcp", via=[make("mlcp-lcp-split")]).problem
    output = solvers.get("lemke").run(split, Budget(seconds=120.0))
    assert output.claim in (Claim.SOLVED, Claim.FAILED)


def test_divergence_is_reported() -> None:
    """PGS finds no rest on a P-matrix far from diagonal dominance whose only solution is (1, 1), and says so."""
    problem = LCP(M=np.array([[1.0, 5.0], [-5.0, 1.0]]), q=[-6.0, 4.0])
    output = solvers.get("pgs").run(problem)
    assert output.claim is not Claim.SOLVED
    assert output.message


@pytest.mark.parametrize("solver", [*ALL, "mprgp", "newton-fb", "newton-pfb"])
def test_no_claim_on_a_real_file_is_false(shared_data: Path, solver: str) -> None:
    """Every LCP file: what is claimed solved is, what is claimed infeasible is proven, anything else says why.

    w₁ of lcp_inf_sol_perturbed is z₃ − z₂ − 1e-4. At a tolerance of 1e-4 z = (1, 0, 0) is claimed: by the solver's own
    measure this is right, though all of w₁ is missed.
    """
    chosen = solvers.get(solver)
    for path in sorted((shared_data / "lcp").glob("*.dat")):
        problem = storage.load(path)
        if chosen.obstacle(problem) is not None:
            continue
        for tolerance in (1e-4, 1e-8):
            output = chosen.run(problem, Budget(tolerance=tolerance, seconds=120.0))
            if output.claim is Claim.SOLVED:
                if path.name == "lcp_inf_sol_perturbed.dat" and tolerance == 1e-4:
                    assert_own_measure(problem, output.point, tolerance)
                else:
                    assert_claim(problem, output.point, tolerance)
            elif output.claim is Claim.INFEASIBLE:
                assert problem.certifies_infeasibility(output.certificate), path.name
            else:
                assert output.message, path.name


def test_a_bimatrix_game_is_solved_although_it_begins_with_a_ray(shared_data: Path) -> None:
    """lcp_CPS_3 has three solutions (Cottle, Pang and Stone, example 4.4.23): a ray is no proof of anything."""
    problem = storage.load(shared_data / "lcp" / "lcp_CPS_3.dat")
    output = solvers.get("lemke").run(problem)
    assert output.claim is Claim.SOLVED
    assert judge(problem, output.point, 1e-8).solved


@pytest.mark.parametrize("name", ["bpp", "interior-point-lcp", "mprgp", "murty", "newton-fb", "newton-min"])
def test_rows_in_units_far_apart_are_claimed_only_where_they_hold(name: str) -> None:
    """M is definite in units 2^±20 of its unknowns, where a norm sees nothing of most rows."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 12))
        G, D = rng.standard_normal((n, n)), 2.0 ** rng.integers(-20, 21, n)
        M = G @ G.T + 0.1 * np.eye(n)
        z = np.where(rng.random(n) < 0.5, rng.random(n), 0.0)
        problem = LCP(M=D[:, None] * M * D, q=D * (np.where(z > 0, 0.0, rng.random(n)) - M @ z))
        output = solvers.get(name).run(problem, Budget(tolerance=1e-6))
        if output.claim is Claim.SOLVED:
            assert judge(problem, output.point, 1e-6).error <= 1e-5, seed


@pytest.mark.parametrize("name", ["pgs", "psor"])
def test_sweeps_end_where_the_verdict_agrees(name: str) -> None:
    """Norms relative to q, which idle rows enlarge, miss by up to 2.5 times, one answer of ten.

    Methods hold every pair; the verdict holds the sum of the products, too, which may be half as much more.
    """
    beyond = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        G = rng.standard_normal((10, 10))
        problem = LCP(M=G @ G.T + (10.0 if seed % 2 else 1.0) * np.eye(10), q=rng.standard_normal(10))
        for tolerance in (1e-4, 1e-8):
            output = solvers.get(name).run(problem, Budget(tolerance=tolerance))
            assert output.claim is Claim.SOLVED, seed
            beyond.append(judge(problem, output.point, tolerance).error / tolerance)
    assert max(beyond) <= 1.5
