"""`cpbench sweep`: values of a parameter of a problem."""

from __future__ import annotations

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from command_line import cpbench as command

import cpbench
from cpbench.errors import CpbenchError, ProblemError, UnknownName
from cpbench.formulations import LCP, NCP, FrictionContact
from cpbench_lab.sweeping import over, sweep, with_value

PUSHED = FrictionContact(W=np.eye(2), q=[-1.0, 0.45], mu=[0.2], dimension=2, name="pushed")
"""u = r + q: sticks from μ = 0.45 on, and slips with 0.45 − μ below."""


@pytest.mark.needs("cpbench_solvers")
def test_a_push_is_held_from_the_coefficient_on_that_holds_it(tmp_path: Path) -> None:
    cpbench.save(PUSHED, tmp_path / "pushed.h5")
    done = command(tmp_path, "sweep", "pushed.h5", "--over", "mu=0.1:0.8:0.1", "--json")
    rows = json.loads(done.stdout)
    assert [row["mu"] for row in rows] == ["0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7", "0.8"]
    assert [int(row["stick"]) for row in rows] == [0, 0, 0, 0, 1, 1, 1, 1]
    speeds = [float(row["largest sliding speed"]) for row in rows]
    np.testing.assert_allclose(speeds[:4], [0.35, 0.25, 0.15, 0.05], atol=1e-5)
    shown = command(tmp_path, "sweep", "pushed.h5", "--over", "mu=0.1|0.8").stdout.splitlines()
    assert len(shown) == 3
    assert shown[0].split()[:3] == ["mu", "status", "error"]


@pytest.mark.needs("cpbench_solvers")
def test_a_parameter_of_expressions_is_swept() -> None:
    """z ≥ 0 ⟂ z² − a ≥ 0 with z > 0: z = √a."""
    z, a = ca.SX.sym("z"), ca.SX.sym("a")
    problem = NCP.from_casadi(z, z**2 - a, {"a": 1.0}, start=[1.0])
    answers = list(sweep(problem, "a", [1.0, 4.0, 9.0], tolerance=1e-9))
    assert [answer.value for answer in answers] == [1.0, 4.0, 9.0]
    np.testing.assert_allclose([answer.solution.x[0] for answer in answers], [1.0, 2.0, 3.0], atol=1e-6)


@pytest.mark.parametrize("text", ["mu", "mu=", "=1", "mu=a", "mu=1:2", "mu=inf"])
def test_what_is_no_range_is_refused(text: str) -> None:
    with pytest.raises(CpbenchError):
        over(text)


def test_what_a_problem_has_not_is_refused() -> None:
    with pytest.raises(UnknownName, match="mu"):
        with_value(PUSHED, "mo", 1.0)
    with pytest.raises(ProblemError, match="no parameter mu"):
        with_value(LCP(M=[[1.0]], q=[1.0]), "mu", 1.0)
