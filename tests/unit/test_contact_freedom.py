"""Forces and motions that are not unique, and what the commands say of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import cpbench as command

import cpbench
from cpbench.analysis.contact_freedom import freedom_lines, least_forces
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
    assert said(box()) == ["  forces are not unique (hyperstatic, of 6 dimensions)"] or "least norm" in said(box())[0]
    assert said(FrictionContact(W=np.eye(3), q=[-1.0, 0.1, 0], mu=[0.5])) == []
    fixed = FrictionContact(W=np.diag([0.0, 1, 1]), q=[0.0, 0.1, 0.0], mu=[0.5])
    assert said(fixed)[0] == "  W_NN = 0 at 1 contact [0]: no force moves it along its normal"
    assert "can hold all at rest, too" in said(pinched())[-1]
    assert said(box(push=1.0)) == [] or "hyperstatic" in said(box(push=1.0))[0]


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
    assert "forces are not unique (hyperstatic, of 6 dimensions); these are those of least norm" in solved
    assert "  v[0:6] = " in solved
    verified = command(tmp_path, "verify", "box.h5", "--answer", "r.h5").stdout
    assert "  4 contacts: 4 stick" in verified
    assert "least norm" in verified
