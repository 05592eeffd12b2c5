"""Forces and motions that are not unique, and what the commands say of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import cpbench as command

import cpbench
from cpbench.analysis.contact_freedom import freedom_lines, least_forces, moving
from cpbench.formulations import FrictionContact, GlobalFrictionContact

pytestmark = pytest.mark.needs("cpbench_solvers")


def box(width: float = 0.2, push: float = 0.0) -> GlobalFrictionContact:
    """A box of 1 kg on four corners, of which three would do: hyperstatic of 12 - 6 dimensions."""
    J = [[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]
    corners = [(x, y, -0.1) for x in (-width, width) for y in (-0.1, 0.1)]
    H = np.array([np.append(d, np.cross(p, d)) for p in corners for d in J]).T
    f = [push, 0, -0.0981, 0, 0, 0]
    return GlobalFrictionContact(M=np.diag([1, 1, 1, 0.01, 0.01, 0.01]), H=H, f=f, w=np.zeros(12), mu=np.full(4, 0.5))


def pinched() -> GlobalFrictionContact:
    """A block between two walls, which it may stick to or slide down: the walls press as hard as they like."""
    H = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
    return GlobalFrictionContact(M=np.eye(2), H=H, f=[0.0, -3.0], w=np.zeros(4), mu=[0.5, 0.5], dimension=2)


def said(problem: Any) -> list[str]:
    solution = cpbench.solve(problem, tolerance=1e-9)
    return list(freedom_lines(problem, solution.point, 1e-6))


def test_what_is_open_has_a_line() -> None:
    assert said(box())[0].startswith("  forces are not unique (hyperstatic, of 6 dimensions): contacts 0, 1, 2, 3")
    assert said(FrictionContact(W=np.eye(3), q=[-1.0, 0.1, 0], mu=[0.5])) == []
    fixed = FrictionContact(W=np.diag([0.0, 1, 1]), q=[0.0, 0.1, 0.0], mu=[0.5])
    assert said(fixed)[0] == "  W_NN = 0 at 1 contact (0): no force moves it along its normal"
    assert "can hold all at rest, too" in said(pinched())[-1]
    assert said(box(push=1.0)) == [] or "hyperstatic" in said(box(push=1.0))[0]


def test_a_box_that_turns_as_it_slides_may_slide_otherwise(tmp_path: Path) -> None:
    """Four corners carry it, three would do: one load shifts from a diagonal to the other, and friction with it. The
    other motion is an answer by the verdict; on three corners there is none, nor without a turn."""
    turning = replace(box(), f=[0.4, 0.1, -0.0981, 0.0, 0.0, 0.01])
    problem = cpbench.convert(turning, "fc").problem
    answer = cpbench.solve(problem, tolerance=1e-9).point
    count, contacts, r = moving(problem, answer, 1e-6)
    assert (count, contacts) == (1, [0, 1, 2, 3])
    assert cpbench.verify(problem, r, tolerance=1e-9).solved
    velocities = [problem.W @ at + problem.q for at in (answer.arrays()["r"], r)]
    assert np.linalg.norm(velocities[0] - velocities[1]) > 1e-4 * np.linalg.norm(velocities[0])
    three = FrictionContact(W=problem.W[:9, :9], q=problem.q[:9], mu=problem.mu[:3])
    assert moving(three, cpbench.solve(three, tolerance=1e-9).point, 1e-6)[0] == 0
    assert moving(box(push=1.0), cpbench.solve(box(push=1.0), tolerance=1e-9).point, 1e-6)[0] == 0
    cpbench.save(turning, tmp_path / "box.h5")
    for words in (("solve", "box.h5"), ("sweep", "box.h5", "--over", "mu=0.5")):
        assert "the motion is not unique (of 1 dimension): contacts 0, 1, 2, 3 may" in command(tmp_path, *words).stdout


def test_the_least_forces_have_no_friction_that_nothing_loads() -> None:
    problem = box()
    solution = cpbench.solve(problem, tolerance=1e-9)
    r = solution.point.r + np.tile([0.0, 0.003, 0.0], 4) * np.repeat([1, 1, -1, -1], 3)
    given = type(solution.point)(v=solution.point.v, r=r, lam=solution.point.lam)
    least = least_forces(problem, given, 1e-6)
    assert least is not None
    assert least.arrays()["r"] == pytest.approx(np.tile([0.0981 / 4, 0, 0], 4), abs=1e-12)
    assert cpbench.verify(problem, least).solved


def test_the_commands_say_it(tmp_path: Path) -> None:
    cpbench.save(box(), tmp_path / "box.h5")
    solved = command(tmp_path, "solve", "box.h5", "-o", "r.h5").stdout
    assert "forces are not unique (hyperstatic, of 6 dimensions): contacts 0, 1, 2, 3; these are those of" in solved
    assert "  v[0:6] = " in solved
    verified = command(tmp_path, "verify", "box.h5", "--answer", "r.h5").stdout
    assert "  4 contacts: 4 stick" in verified
    assert "least norm" in verified
