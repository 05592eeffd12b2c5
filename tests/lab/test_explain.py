"""Causes of failures: planted ones are found first, evidence is of the data, remedies are measured; the command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import planted_causes
import pytest
from command_line import cpbench as command

import cpbench as cp
from cpbench.solvers.base import Budget
from cpbench_lab.diagnosis.apart import Apart
from cpbench_lab.diagnosis.attempts import SolverTrial, attempt
from cpbench_lab.diagnosis.causes.iterates import period
from cpbench_lab.diagnosis.diagnose import diagnose
from cpbench_lab.diagnosis.other_units import scaled

SPIN = cp.LCP(M=[[1.0, 1.0], [-1.0, 1.0]], q=[-3.0, -1.0], name="spin")
"""Gauss and Seidel's sweeps go to and fro: from z = 0 to (3, 4), and back."""
BY_DAY = (
    "rounding", "iterations", "cycling", "diverging", "hyperstatic", "singular", "nonmonotone", "start", "lost",
    "large_nonmonotone", "masses", "heavy_hyperstatic", "claims",
)  # fmt: skip


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(make, id=make.__name__, marks=[] if make.__name__ in BY_DAY else pytest.mark.nightly)
        for make in planted_causes.GENERATORS
    ],
)
def test_a_planted_cause_is_the_first(make: Any) -> None:
    (plant,) = planted_causes.planted(make, 1, seed=7)
    found = diagnose(plant.bad)
    assert planted_causes.named(plant, found), "\n".join(found.lines())
    if plant.kind not in ("infeasible", "unbounded", "rounding"):
        assert found.remedy is not None


def test_evidence_is_of_the_data() -> None:
    found = cp.diagnose(SPIN, "pgs")
    assert found.cause is not None
    assert (found.cause.kind, found.cause.numbers["period"]) == ("cycling", 2)
    assert found.remedy is not None
    assert cp.verify(SPIN, found.remedy.attempt.answer).solved
    infeasible = cp.LCP(M=[[0.0, -1.0], [0.0, 1.0]], q=[-1.0, 0.0])  # the first row: −z₂ ≥ 1
    found = cp.diagnose(infeasible, "newton-min")
    assert found.cause is not None
    assert (found.cause.kind, found.tried) == ("infeasible", ())
    assert found.cause.numbers["rows"] >= 1


def test_a_period_is_found_only_where_iterates_repeat() -> None:
    k = np.arange(12.0)
    turning = np.stack([np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3)], axis=1)
    found = period(k, turning)
    assert found is not None
    assert found[0] == 3
    assert period(k, turning * 0.9 ** k[:, None]) is None  # it converges
    assert period(k, np.ones((12, 2))) is None  # it stands still
    assert period(100 * k, turning) is None  # no two neighbours were kept


@pytest.mark.parametrize("node", ["lcp", "mlcp", "qp", "fc"])
def test_other_units_lead_back(node: str) -> None:
    """The answer in other units is one in those of the problem; powers of two round nothing."""
    rng = np.random.default_rng(3)
    n = 6
    s = 10.0 ** rng.uniform(-3, 3, n)
    B = rng.standard_normal((n, n))
    K = s[:, None] * (B @ B.T + np.eye(n)) * s
    q = s * rng.standard_normal(n)
    problem: Any = {
        "lcp": lambda: cp.LCP(M=K, q=q),
        "mlcp": lambda: cp.MLCP(A=K[:2, :2], C=K[:2, 2:], D=K[2:, :2], B=K[2:, 2:], a=q[:2], b=q[2:]),
        "qp": lambda: cp.QP.build(K, q, A=np.eye(2, n) * s[0], b=-np.ones(2), lb=np.full(n, -50.0) / s),
        "fc": lambda: cp.FrictionContact(W=K, q=q, mu=np.array([0.3, 0.4]), dimension=3),
    }[node]()
    other = scaled(problem)
    assert other is not None
    assert other.numbers["after"] < other.numbers["before"]
    answer = cp.solve(other.problem, tolerance=1e-9)
    assert cp.verify(problem, other.back(answer.point), tolerance=1e-6).solved


def test_a_solver_that_ends_its_process_has_a_cause_and_a_remedy(tmp_path: Path) -> None:
    plugin = tmp_path / "dies.py"
    plugin.write_text(
        "import os\n"
        "from cpbench.solvers.base import Solver, SolverSpec, solvers\n"
        "class Dies(Solver):\n"
        "    spec = SolverSpec(name='dies', node='lcp', summary='ends its process', method='none')\n"
        "    def solve(self, prepared, budget, options, start=None, record=None):\n"
        "        os._exit(7)\n"
        "solvers.add('dies', Dies())\n"
    )
    cp.save(SPIN, tmp_path / "spin.h5")
    ended = command(tmp_path, "explain", "spin.h5", "-s", "dies", "--plugin", str(plugin))
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("spin by dies: crash; no cause was found; what works: auto-lcp")
    assert "auto-lcp (automatic choice): works" in ended.stdout


def test_a_trial_ends_alike_in_a_process_apart() -> None:
    trial = SolverTrial(problem=SPIN, solver="pgs")
    here = attempt(trial)
    with Apart() as run:
        there = attempt(trial, run)
        started = run("pgs", SPIN, Budget(), cp.LCPPoint(z=[1.0, 2.0]))
    assert (there.status, there.message) == (here.status, here.message)
    np.testing.assert_array_equal(there.raw.iterates, here.raw.iterates)
    np.testing.assert_array_equal(started.iterates[0], [1.0, 2.0])
