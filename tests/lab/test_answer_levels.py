"""What a certificate says of an answer (near a proved solution, away from it, stationary), and of having none."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from certificate_checks import checked, reseal, save_and_check
from command_line import cpbench as command
from test_certificates import infeasible_lcp, infeasible_mlcp, infeasible_qp, unbounded_qp

import cpbench
from cpbench.bench.judging import judge_answer, look_for_proof
from cpbench.formulations import LCP, MLCP, QP
from cpbench.proofs import prove
from cpbench.testing.cases import infeasible
from cpbench.verification import Status

pytest.importorskip("flint", reason="certificates need python-flint")
from cpbench_lab.certificates.no_solution import without_solution
from cpbench_lab.certifying import save_certificate

LCP2 = LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-5.0, -6.0])
EXACT = np.array([4 / 3, 7 / 3])
FALLING = QP.build(np.diag([-1.0, 1.0]), np.zeros(2), lb=[0.0, -np.inf])
"""min ½(z₂² − z₁²) over z₁ ≥ 0: stationary at 0, without a lower bound along (1, 0)."""
SADDLE = QP.build(np.diag([-1.0, 1.0]), np.zeros(2), lb=-np.ones(2), ub=np.ones(2))


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_an_answer_is_proved_within_the_tolerance_of_a_solution_and_distant_beyond(
    tolerance: float, tmp_path: Path
) -> None:
    for share, level in ((0.5, "proved"), (2.0, "distant")):
        off = EXACT + share * tolerance * EXACT[1] * np.array([1.0, 0.0])
        found = cpbench.certify(LCP2, off, tolerance=tolerance)
        assert (found.level, bool(found)) == (level, level == "proved")
        assert found.distance == pytest.approx(share * tolerance, rel=1e-4)
        save_certificate(found, LCP2, tmp_path / f"{level}.h5")
    assert checked(tmp_path / "proved.h5", tmp_path / "distant.h5")[0] == 0


def test_the_command_refuses_an_answer_that_is_not_the_solution(tmp_path: Path) -> None:
    cpbench.save(LCP2, tmp_path / "p.h5")
    for z, code, words in (((40.0, -7.0), 1, "distant"), (tuple(EXACT), 0, "proved")):
        np.save(tmp_path / "z.npy", np.array(z))
        done = command(tmp_path, "certify", "p.h5", "--answer", "z.npy")
        assert (done.returncode, f", {words}" in done.stdout) == (code, True), done.stdout


def test_an_answer_that_solves_and_is_far_is_said_to_be_both(tmp_path: Path) -> None:
    """M = (1 + 2⁻⁴⁰, −1; −1, 1): the solution is (1, 1), by hand, and (2, 2) misses a row by 2⁻⁴⁰."""
    problem = LCP(M=np.array([[1.0 + 2.0**-40, -1.0], [-1.0, 1.0]]), q=np.array([-(2.0**-40), 0.0]))
    cpbench.save(problem, tmp_path / "p.h5")
    np.save(tmp_path / "z.npy", np.full(2, 2.0))
    done = command(tmp_path, "certify", "p.h5", "--answer", "z.npy", "-o", "c.h5")
    assert "distant" in done.stdout
    assert cpbench.verify(problem, [2.0, 2.0]).solved == (done.returncode == 0)
    assert ("meets the tolerance" in done.stdout) == (done.returncode == 0)
    assert checked(tmp_path / "c.h5")[0] == 0


def test_parts_of_an_answer_have_their_own_size(tmp_path: Path) -> None:
    """u = 1e6 and v = 1 by hand: a tenth of v is 1e-7 of u."""
    one = np.ones((1, 1))
    problem = MLCP(A=one, B=one, C=np.zeros((1, 1)), D=np.zeros((1, 1)), a=[-1e6], b=[-1.0])
    found = cpbench.certify(problem, [1e6, 1.1])
    assert (found.level, found.distance) == ("distant", pytest.approx(0.1))
    assert cpbench.certify(problem, [1e6, 1.0]).level == "proved"
    save_and_check(found, problem, tmp_path)


def test_multipliers_belong_to_the_answer(tmp_path: Path) -> None:
    """min ½z² over z ≥ 1 as a row: z = 1 with λ = 1, by hand."""
    problem = QP.build(np.eye(1), np.zeros(1), A=np.ones((1, 1)), b=[1.0])
    right, wrong = (cpbench.certify(problem, [1.0, lam, 0.0]) for lam in (1.0, 7.0))
    assert (right.level, wrong.level) == ("proved", "distant")
    assert wrong.distance <= 1e-6
    save_and_check(wrong, problem, tmp_path)


def test_a_saddle_is_stationary_and_no_success(tmp_path: Path) -> None:
    found = cpbench.certify(SADDLE, np.zeros(4))
    assert (found.level, bool(found)) == ("stationary", False)
    cpbench.save(SADDLE, tmp_path / "p.h5")
    np.save(tmp_path / "z.npy", np.zeros(4))
    done = command(tmp_path, "certify", "p.h5", "--answer", "z.npy", "-o", "c.h5")
    assert done.returncode == 1
    assert "not convex" in done.stdout
    assert checked(tmp_path / "c.h5")[0] == 0


def test_a_program_that_curves_down_for_ever_is_unbounded(tmp_path: Path) -> None:
    """0 is stationary, whatever a solver says of it; over a box there is a least value."""
    found = cpbench.certify(FALLING)
    assert (found.level, bool(found), found.margin) == ("unbounded", True, pytest.approx(0.99))
    for problem, status in ((FALLING, Status.UNBOUNDED), (SADDLE, Status.STATIONARY)):
        judged = judge_answer(
            problem, problem, 0, problem.point_from_vector(np.zeros(4)).arrays(), tolerance=1e-6, claim="solved",
            prove=lambda claim, problem=problem: look_for_proof(partial(prove, problem), True, claim, None, 20.0),
        )  # fmt: skip
        assert judged.status == status
        assert (judged.proof is None) == (status == Status.STATIONARY)
    cpbench.save(FALLING, tmp_path / "p.h5")
    done = command(tmp_path, "certify", "p.h5", "-o", "c.h5")
    assert done.returncode == 0, done.stdout
    code, told = checked(tmp_path / "c.h5")
    assert (code, "curves down" in told) == (0, True)


def test_an_infeasible_problem_has_a_certificate(tmp_path: Path) -> None:
    cpbench.save(infeasible_qp(3), tmp_path / "p.h5")
    done = command(tmp_path, "certify", "p.h5", "-o", "c.h5")
    assert done.returncode == 0, done.stdout
    assert "infeasible: no point meets the conditions" in done.stdout
    assert "margin" in done.stdout
    code, told = checked(tmp_path / "c.h5")
    assert (code, "infeasible: no point" in told) == (0, True)


def test_proofs_of_no_solution_are_proved_again_without_cpbench(tmp_path: Path) -> None:
    problems = [
        make(seed) for make in (infeasible_lcp, infeasible_mlcp, infeasible_qp, unbounded_qp) for seed in range(4)
    ]
    problems += [case.problem for node in ("lcp", "mlcp", "qp", "avi", "coneqp", "fc") for case in infeasible(node)]
    paths = [tmp_path / f"{k}.h5" for k in range(len(problems))]
    for path, problem in zip(paths, problems, strict=True):
        found = without_solution(problem, tolerance=1e-8)
        assert found is not None
        save_certificate(found, problem, path)
    code, told = checked(*paths)
    assert code == 0, told
    assert told.count("unbounded:") == 4


def forged(own: Any, kind: str) -> None:
    """Change what the proof rests on."""
    if kind == "margin":
        own.attrs["margin"] = 2.0 * own.attrs["margin"]
    elif kind == "tolerance":
        own.attrs["tolerance"] = 2.0 * own.attrs["margin"]
    elif kind in ("sides", "reach"):
        own[f"evidence/{kind}"][...] = 1e9 * own[f"evidence/{kind}"][()]
    elif kind == "level":
        own.attrs["level"] = "unbounded"
    elif kind == "proof":
        proof = own["evidence/proof"][()]
        proof[proof.size // 2] ^= 1
        own["evidence/proof"][...] = proof
    else:
        own["data/b"][0] -= 1e3


@pytest.mark.parametrize("kind", ["margin", "tolerance", "sides", "reach", "level", "proof", "data"])
def test_forged_proofs_of_no_solution_are_caught(kind: str, tmp_path: Path) -> None:
    """Sealed again, by who knows how: x₁ − x₂ = 1 and x₁ − x₂ = 1/2 with x ≥ 0."""
    problem = QP.build(np.eye(2), np.zeros(2), A=np.array([[1.0, -1.0], [-1.0, 1.0]]), b=[1.0, -0.5], lb=np.zeros(2))
    found = without_solution(problem)
    assert found is not None
    path = tmp_path / "c.h5"
    save_certificate(found, problem, path)
    assert checked(path)[0] == 0
    with h5py.File(path, "r+") as file:
        own: Any = file["certificate"]
        forged(own, kind)
        reseal(own)
    code, told = checked(path)
    assert (code, "NOT PROVED" in told) == (1, True), told
