"""What `cpbench verify` says of an answer, and with which exit code it ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench as command
from planted_nonlinear import graph as formula

import cpbench
from cpbench import storage
from cpbench.cli import verify_command
from cpbench.formulations import LCP, NLP, QP, ConeQP, Problem
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.verification import Verdict, error_text

INF = np.inf
BOX = {"lb": [-1.0, -1.0], "ub": [1.0, 1.0]}
SADDLE = QP.build(Q=np.diag([1.0, -1.0]), p=np.zeros(2), **BOX)
CURVE = NLP(f=formula(2, lambda z: z[0] * z[0] - z[1] * z[1]), **BOX)
WORD = NLP(f=formula(2, lambda z: np.exp(z[0]) + np.exp(-z[0]) + z[1] * z[1]), **BOX, convex=True)
NOT_CONVEX = "optimality conditions hold at 1e-06; the problem is not convex, minimality is not shown"


def verify(folder: Path, problem: Problem, answer: list[float], *options: str) -> tuple[int, list[str]]:
    storage.save(problem, folder / "p.h5", force=True)
    np.save(folder / "z.npy", answer)
    done = command(folder, "verify", "p.h5", "--answer", "z.npy", *options)
    assert done.stderr == ""
    return done.returncode, done.stdout.splitlines()


@pytest.mark.parametrize(
    ("problem", "first"),
    [
        (SADDLE, NOT_CONVEX),
        (NLP(f=CURVE.f, **BOX, convex=True), NOT_CONVEX),
        (CURVE, NOT_CONVEX.replace("is not convex", "is not known to be convex")),
        (QP.build(Q=np.diag([1.0, -1.0]), p=np.zeros(2)), NOT_CONVEX),
    ],
)
@pytest.mark.parametrize("options", [(), pytest.param(("--all-measures",), marks=pytest.mark.needs("cpbench_lab"))])
def test_a_stationary_answer_never_passes(tmp_path: Path, problem: Problem, first: str, options: tuple[str]) -> None:
    code, lines = verify(tmp_path, problem, [0.0, 0.0], *options)
    assert (code, lines[0]) == (1, f"p.h5: error 0, {first}")
    assert not any("passes" in line for line in lines)
    verdict = cpbench.verify(problem, [0.0, 0.0])
    assert (verdict.within, verdict.solved, bool(verdict)) == (True, False, False)


def test_answers_to_convex_problems_pass_and_wrong_ones_do_not(tmp_path: Path) -> None:
    convex = QP.build(Q=np.eye(2), p=np.zeros(2), **BOX)
    for problem, z, code, word in (
        (convex, [0.0, 0.0], 0, "error 0, passes at 1e-06"),
        (convex, [0.5, 0.0], 1, "does not pass at 1e-06"),
        (SADDLE, [0.5, 0.0], 1, "does not pass at 1e-06"),
        (WORD, [0.0, 0.0], 0, "error 0, passes at 1e-06"),
    ):
        ended, lines = verify(tmp_path, problem, z)
        assert ended == code
        assert word in lines[0]
        assert bool(cpbench.verify(problem, z)) == (code == 0)


def test_the_word_of_an_author_is_called_that(tmp_path: Path) -> None:
    _, lines = verify(tmp_path, WORD, [0.0, 0.0])
    assert f"          convexity declared: {verify_command.DECLARED}" in lines
    _, lines = verify(tmp_path, QP.build(Q=np.eye(2), p=np.zeros(2)), [0.0, 0.0])
    assert not any("convexity" in line for line in lines)


@pytest.mark.parametrize(
    ("problem", "unbounded"),
    [
        # e₂ has no bound on one side at least, and falls by −½t²
        (QP.build(Q=np.diag([1.0, -1.0]), p=np.zeros(2), lb=[0.0, 0.0]), True),
        (QP.build(Q=np.diag([1.0, -1.0]), p=np.zeros(2), A=[[0.0, 1.0]], b=[-1.0]), True),
        (ConeQP.over(np.diag([1.0, -1.0]), np.zeros(2), ProductCone.of((Cone.NONNEGATIVE, 1, 2))), True),
        # the only rays are those with d₁ = 2d₂, along which it rises
        (QP.build(Q=np.diag([1.0, -1.0]), p=np.zeros(2), C=[[1.0, -2.0]], d=[0.0]), False),
        (SADDLE, False),
        (CURVE, False),
    ],
)
def test_a_ray_of_negative_curvature_proves_a_program_unbounded(
    tmp_path: Path, problem: Problem, unbounded: bool
) -> None:
    code, lines = verify(tmp_path, problem, [0.0, 0.0])
    assert code == 1
    assert any(line.startswith("  unbounded: the objective has no lower bound, proved") for line in lines) == unbounded


def test_numbers_that_decide_nothing_stand_under_a_line_that_says_so(tmp_path: Path) -> None:
    code, lines = verify(tmp_path, SADDLE, [0.5, 0.0])
    at = next(k for k, line in enumerate(lines) if line.startswith("  not judged: residuals by which solvers"))
    names = [line.split()[0] for line in lines]
    assert [name for name in names[:at] if name == "judged"] == ["judged"]
    assert set(names[at:]) >= {"stationarity", "primal", "dual", "gap"}
    assert code == 1


def test_an_error_above_1_is_no_share() -> None:
    assert [error_text(e) for e in (0.0, 1.23456e-7, 1.0, 1.0001, 6e7, INF)] == [
        "0", "1.23e-07", "1", "above 1", "above 1", "inf",
    ]  # fmt: skip
    lcp = LCP(M=np.eye(1), q=[0.0])
    assert verify_command.outcome(lcp, Verdict(1e-6, False, 6e7)) == "does not pass at 1e-06"
