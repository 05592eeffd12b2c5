"""Contradictions of a run by its answers: those of planted liars, judges and claims, and the bounds from both sides."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from command_line import with_plugins

import cpbench as cp
from cpbench.formulations.base import Problem
from cpbench_lab.contradictions import forward_error
from cpbench_lab.contradictions.answers import KeptAnswer, of_answers
from cpbench_lab.contradictions.forward_error import meets_conditions

PLANTED = Path(__file__).resolve().parents[1] / "broken" / "contradictory.py"
EPS = 1e-6


# ------------------------------------------------------------------------------------------------ a whole run


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A run of all planted solvers on the problems of the planted judges, in processes of their own."""
    folder = tmp_path_factory.mktemp("planted")
    subprocess.run([sys.executable, str(PLANTED), str(folder)], check=True)
    words = ("run", ".", "-s", "right-*,again-*,liar-*,denier-*", "--repeats", "1", "--timeout", "60s")
    words = (*words, "-o", "r.sqlite", "--fail-on", "contradiction")
    return folder, with_plugins(folder, "--plugin", str(PLANTED), *words)


def test_each_planted_fault_is_a_contradiction(planted) -> None:
    """A false "infeasible", liars that broken judges accept, and a judge that rejects what two methods agree on."""
    folder, ended = planted
    assert ended.returncode == 1
    assert "4 contradiction (--fail-on)" in ended.stderr
    found = {one.problem: one for one in cp.Results(folder / "r.sqlite").contradictions}
    assert {name: (one.kind, set(one.labels)) for name, one in found.items()} == {
        "denied": ("existence", {"denier-lcp", "denier-a-lcp", "denier-b-lcp", "right-lcp"}),
        "first": ("solution", {"liar-lcp-first", "right-lcp-first"}),
        "always": ("objective", {"liar-qp-always", "right-qp-always"}),
        "never": ("verdict", {"again-lcp-never", "right-lcp-never"}),
    }
    # z = (1, 2, 3) has ½zᵀQz − zᵀQz = −13, with terms 52 (Σ|p_i z_i| = 26, ½zᵀQz = 13, |f| = 13)
    assert found["always"].measured == pytest.approx(13 / 52)


def test_the_false_infeasible_is_a_false_claim(planted) -> None:
    folder, _ = planted
    report = (folder / "reports" / "r" / "report.md").read_text()
    line = next(line for line in report.splitlines() if line.startswith("| denied | lcp |") and "denier-lcp" in line)
    assert "| infeasible | has a verified answer |" in line
    details = (folder / "reports" / "r" / "details.md").read_text()
    claims = details[details.index("## Claims of each solver") :]
    assert next(line for line in claims.splitlines() if "denier-lcp" in line).split("|")[6].strip() == "1"


@pytest.mark.needs("cpbench_solvers")
def test_a_certificate_decides_between_answers(planted) -> None:
    pytest.importorskip("flint")
    folder, ended = planted
    found = {one.problem: one.arbitration for one in cp.Results(folder / "r.sqlite").contradictions}
    assert "a solution, the only one (P-matrix) is at most" in found["denied"]
    assert "certificates are sought for at most" in ended.stderr


# ------------------------------------------------------------------------------------------- objectives, bounds


def answers(vectors: Sequence[Sequence[float]], statuses: str = "solved", **given: object) -> list[KeptAnswer]:
    """Answers by solvers a, b, ... of methods of their own."""
    made: list[KeptAnswer] = []
    for place, vector in enumerate(vectors):
        name = "abcdef"[place]
        status = statuses.split()[place % len(statuses.split())]
        error = 1e-9 if status == "solved" else 1.0
        values = {"method": name, "error": error, "tolerance": EPS, **given}
        made.append(KeptAnswer(key=name, label=name, status=status, vector=np.array(vector), **values))  # type: ignore[arg-type]
    return made


def kinds(problem: Problem, given: Sequence[KeptAnswer]) -> list[str]:
    return [one.kind for one in of_answers(problem, given)]


@pytest.mark.parametrize(("share", "found"), [(0.9, []), (1.1, ["objective"])])
def test_objectives_may_differ_by_ten_tolerances_of_their_terms(share: float, found: list[str]) -> None:
    """min z, z ≥ 1: the terms of 1 + δ are |pz| + |f| = 2 + 2δ."""
    program = cp.QP.build(Q=np.zeros((1, 1)), p=[1.0], lb=[1.0])
    delta = share * 2 * 10 * EPS
    assert kinds(program, answers([(1.0, 1.0), (1.0 + delta, 1.0)])) == found


def test_the_middle_of_two_answers_is_better_than_both() -> None:
    """min ½|z|² − (1, 1)z: (0, 1) and (1, 0) have f = −½, their middle −¾."""
    program = cp.QP.build(Q=np.eye(2), p=[-1.0, -1.0])
    (one,) = of_answers(program, answers([(0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)]))
    assert (one.kind, one.measured) == ("objective", pytest.approx(0.25 / 2.0))  # terms 1 + ½ + ½


def test_an_optimal_value_of_zero_is_no_contradiction() -> None:
    """min ½(x − y)², x + y = 1 (Maros and Mészáros: TAME): all terms vanish at the solution."""
    program = cp.QP.build(Q=[[1.0, -1.0], [-1.0, 1.0]], p=[0.0, 0.0], C=[[1.0, 1.0]], d=[1.0])
    off = EPS / 2
    assert kinds(program, answers([(0.5, 0.5, 0.0, 0.0, 0.0), (0.5 + off, 0.5 - off, 0.0, 0.0, 0.0)])) == []
    assert kinds(program, answers([(0.5, 0.5, 0.0, 0.0, 0.0), (0.6, 0.4, 0.0, 0.0, 0.0)])) == ["objective"]


@pytest.mark.parametrize(("z", "found"), [(0.4, []), (1.6, ["objective"])])
def test_a_solution_at_zero_leaves_the_size_to_the_data(z: float, found: list[str]) -> None:
    """min ½z² + 2z, z ≥ 0: beside 0 terms |2z| + ½z² + |f| count from p²/Q = 4 on, which z = 0.84 reaches."""
    program = cp.QP.build(Q=[[1.0]], p=[2.0], lb=[0.0])
    assert kinds(program, answers([(0.0, 2.0), (z, 0.0)])) == found


@pytest.mark.parametrize(("share", "found"), [(4.0, []), (6.0, ["objective"])])
def test_what_answers_near_zero_are_off_by_is_not_compared(share: float, found: list[str]) -> None:
    """min 5x² + 2xy + 2y² + y, y ≥ 0 (Maros and Mészáros: SIMBQP): terms 2|y| of two answers beside 0 count from
    10 ε p²/Q = 10 ε/4 on."""
    program = cp.QP.build(Q=[[10.0, 2.0], [2.0, 4.0]], p=[0.0, 1.0], lb=[-np.inf, 0.0])
    y = share * EPS / 4
    assert kinds(program, answers([(0.0, y, 0.0, 1.0), (0.0, -y / 2, 0.0, 1.0)])) == found


@pytest.mark.parametrize(("share", "found"), [(0.9, []), (1.1, ["solution"])])
def test_the_distance_that_an_h_matrix_allows(share: float, found: list[str]) -> None:
    """2z − 2 = 0: ⟨M⟩⁻¹ of 2z/2 is 1, the terms over the diagonal are 2 + δ: 10 ε (2 + 2 + δ) is allowed."""
    lcp = cp.LCP(M=[[2.0]], q=[-2.0])
    assert kinds(lcp, answers([(1.0,), (1.0 + share * 4 * 10 * EPS,)])) == found


@pytest.mark.parametrize(("share", "found"), [(0.9, []), (1.1, ["solution"])])
def test_the_distance_that_a_definite_matrix_allows(share: float, found: list[str]) -> None:
    """M = [[1, 5], [−5, 1]] is no H-matrix; c = 1, and L = 6 by its norms of 1 and ∞. At z = (1, 1) the terms are
    (12, 10): 20 ε L/c · 2 (√2 + √244/6) are allowed."""
    M = np.array([[1.0, 5.0], [-5.0, 1.0]])
    z = np.ones(2)
    allowed = 2 * 10 * EPS * 6 * 2 * (np.sqrt(2) + np.sqrt(244) / 6)
    other = z + share * allowed * np.array([0.6, 0.8])
    assert kinds(cp.LCP(M=M, q=-M @ z), answers([tuple(z), tuple(other)])) == found


def test_several_solutions_are_no_contradiction() -> None:
    """z₁ + z₂ = 1 of a singular matrix, and (1, 0), (0, 1), (½, ½) of one that is a P-matrix nowhere."""
    assert kinds(cp.LCP(M=np.ones((2, 2)), q=[-1.0, -1.0]), answers([(1.0, 0.0), (0.0, 1.0)])) == []
    lcp = cp.LCP(M=[[1.0, 2.0], [2.0, 1.0]], q=[-1.0, -1.0])
    assert kinds(lcp, answers([(1.0, 0.0), (0.0, 1.0), (1 / 3, 1 / 3)])) == []


def planted_lcp(rng: np.random.Generator, family: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, q and the solution z of an LCP with a matrix of the family, rows and unknowns in units of their own."""
    n = int(rng.integers(1, 7))
    B, S = rng.normal(size=(n, n)), rng.normal(size=(n, n))
    M = B @ B.T + 0.1 * np.eye(n) + S - S.T
    units = np.exp(rng.normal(0, 2, n))
    if family == "dominant":
        M = B - np.diag(B.diagonal())
        M += np.diag(abs(M).sum(axis=1) + rng.uniform(0.01, 1, n))
    M = units[:, None] * M * (units if family == "definite" else 1.0)
    z, w = rng.random(n), rng.random(n)
    at_zero = rng.random(n) < 0.5
    z[at_zero], w[~at_zero] = 0.0, 0.0
    return M, w - M @ z, z


@pytest.mark.parametrize("family", ["definite", "dominant"])
def test_no_point_is_farther_from_the_solution_than_the_bound(family: str) -> None:
    """Planted solutions, and points around them in directions that M makes small: the factors are those of theorems."""
    rng = np.random.default_rng(5)
    near = 0.0
    for _ in range(300):
        M, q, z = planted_lcp(rng, family)
        away = np.linalg.solve(M, M.diagonal() * rng.choice([-1.0, 1.0], z.size))
        other = z + away * rng.choice([1e-6, 1e-2, 1.0]) / abs(away).max()
        w, d = M @ other + q, M.diagonal()
        if family == "definite":
            S = abs(M) / np.sqrt(np.outer(d, d))
            L = np.sqrt(S.sum(axis=0).max() * S.sum(axis=1).max())
            natural = np.minimum(other * np.sqrt(d), w / np.sqrt(d) / L)
            distance, missed = np.linalg.norm((other - z) * np.sqrt(d)), np.linalg.norm(natural)
            factor = forward_error.definite_factor(M)
        else:
            distance, missed = abs(other - z).max(), abs(np.minimum(other, w / d)).max()
            factor = forward_error.comparison_factor(M)
        assert factor is not None
        near = max(near, distance / (factor * missed))
    assert 0.3 < near <= 1.0 + 1e-9


# --------------------------------------------------------------------------------------------------- verdicts

LCP = cp.LCP(M=np.eye(2), q=[-1.0, -2.0])


@pytest.mark.parametrize(("share", "found"), [(0.9, ["verdict"]), (1.1, [])])
def test_answers_are_alike_up_to_a_hundredth_of_the_tolerance(share: float, found: list[str]) -> None:
    other = (1.0, 2.0 + share * 2 * 0.01 * EPS)
    assert kinds(LCP, answers([(1.0, 2.0), other], "solved wrong")) == found
    assert kinds(LCP, answers([(1.0, 2.0), other], "wrong inaccurate")) == found


@pytest.mark.parametrize(("share", "found"), [(0.9, []), (1.1, ["verdict"])])
def test_verdicts_near_the_tolerance_do_not_contradict(share: float, found: list[str]) -> None:
    one, other = answers([(1.0, 2.0), (1.0, 2.0)], "solved wrong")
    assert kinds(LCP, [one, dataclasses.replace(other, error=share * 10 * EPS)]) == found


def test_rejected_answers_that_agree_for_another_reason() -> None:
    """By one method; by one solver that another one has chosen; or since nothing was computed: zeros."""
    assert kinds(LCP, answers([(3.0, 2.0), (3.0, 2.0 + 1e-12)], "wrong wrong")) == ["verdict"]
    assert kinds(LCP, answers([(3.0, 2.0), (3.0, 2.0 + 1e-12)], "wrong wrong", method="pivoting")) == []
    assert kinds(LCP, answers([(3.0, 2.0), (3.0, 2.0)], "wrong wrong")) == []
    assert kinds(LCP, answers([(0.0, 0.0), (0.0, 0.0)], "wrong wrong")) == []


def test_small_parts_of_an_answer_are_compared_by_themselves() -> None:
    """Multipliers of 1e8 do not hide that z differs."""
    program = cp.QP.build(Q=np.eye(1), p=[-1e8], ub=[1.0])
    assert kinds(program, answers([(1.0, -1e8), (1.1, -1e8)], "solved wrong")) == []
    assert kinds(program, answers([(1.0, -1e8), (1.0, -1e8)], "solved wrong")) == ["verdict"]


def with_several_solutions(off: float = 0.0) -> tuple[cp.QP, list[KeptAnswer]]:
    """min z₁ + z₂, z₁ + z₂ ≥ 1, 0 ≤ z ≤ 2: all points between (1, 0) and (0, 1); `off` : of the objective of one."""
    program = cp.QP.build(Q=np.zeros((2, 2)), p=[1.0, 1.0], A=[[1.0, 1.0]], b=[1.0], lb=np.zeros(2), ub=np.full(2, 2.0))
    return program, answers([(0.5, 0.5, 1.0, 0.0, 0.0), (0.0, 1.0 + off, 1.0, 0.0, 0.0)], "solved wrong")


@pytest.mark.parametrize(("share", "found"), [(0.9, ["verdict"]), (1.1, [])])
def test_a_rejected_answer_that_is_optimal_beside_a_verified_one(share: float, found: list[str]) -> None:
    assert kinds(*with_several_solutions()) == ["verdict"]
    assert kinds(*with_several_solutions(share * 0.1 * EPS)) == found


@pytest.mark.parametrize(
    ("vector", "what"),
    [
        ((0.0, 1.0 - 4e-7, 1.0, 0.0, 0.0), "a row is missed"),
        ((-4e-7, 1.0 + 4e-7, 1.0, 0.0, 0.0), "a bound is missed"),
        ((0.0, 1.0, 1.0 + 4e-7, -4e-7, 0.0), "a multiplier of a bound has the wrong sign"),
        ((0.0, 1.0, 1.0 + 4e-7, 0.0, 0.0), "stationarity is missed"),
        ((0.0, 1.0, 0.0, 1.0, 1.0), "complementarity is missed: the gap is 1"),
    ],
)
def test_a_point_that_misses_a_condition_is_not_optimal(vector: Sequence[float], what: str) -> None:
    program, (verified, rejected) = with_several_solutions()
    assert meets_conditions(program, program.point_from_vector(rejected.vector), 1e-12)
    assert not meets_conditions(program, program.point_from_vector(np.array(vector)), 1e-7), what
    assert kinds(program, [verified, dataclasses.replace(rejected, vector=np.array(vector))]) == []
