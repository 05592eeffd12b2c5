"""No solver imports anything while it is timed: its process has loaded what it may need."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.metadata import requires

import pytest

from cpbench.solvers import solvers

CORE = {
    re.split(r"[^\w-]", text)[0]
    for text in requires("cpbench") or ()
    if "extra ==" not in text or re.search(r"extra == ['\"](casadi|backends)['\"]", text)
}
"""Packages that come with cpbench and its backends."""
OWN, FOREIGN = "cpbench_solvers.", "cpbench_adapters."
WATCHED = """
import os, sys
import cpbench.bench.processes.preload  # as in the processes of a run
from cpbench.bench import worker
from cpbench.solvers import Budget, solvers
from cpbench.testing.cases import cases, infeasible

def timed(solver, problem):
    if solver.obstacle(problem) is not None:
        return
    budget, options = Budget(tolerance=1e-8, seconds=10.0, iterations=20), solver.spec.options()
    handed, before = solver.hand_over(problem), set(sys.modules)
    try:
        solver.solve(solver.setup(handed, budget, options), budget, options)
    except Exception:  # what comes of it is the matter of other tests
        pass
    late = sorted(set(sys.modules) - before)
    if late:
        told.write(f"{solver.spec.name} on {problem.name}: {len(late)} modules, as {late[0]}\\n")

told = os.fdopen(os.dup(1), "w", buffering=1)
os.dup2(2, 1)  # solvers print
problems = {}
for name in sys.argv[1:]:
    solver = solvers.get(name)
    node = solver.spec.node
    if node not in problems:
        problems[node] = [case.problem for case in (*cases(node), *infeasible(node))]
    if os.fork() == 0:
        assert solver.availability().ok, name
        solver.warmup()
        for problem in problems[node]:
            timed(solver, problem)
        os._exit(0)
    assert os.wait()[1] == 0, name
"""


NATIVE = [s.spec.name for s in solvers if type(s).__module__.startswith(OWN)]
ADAPTED = [s.spec.name for s in solvers if type(s).__module__.startswith(FOREIGN) and {*s.spec.requires} & CORE]


@pytest.mark.needs("cpbench_solvers")
def test_there_are_solvers_to_watch() -> None:
    assert min(len(NATIVE), len(ADAPTED)) > 25


@pytest.mark.parametrize(
    "names",
    [
        NATIVE[::40],
        ADAPTED[::20],
        pytest.param(NATIVE, marks=pytest.mark.nightly),
        pytest.param(ADAPTED, marks=pytest.mark.nightly),
    ],
    ids=["some native", "some core adapters", "native", "core adapters"],
)
def test_nothing_is_imported_while_a_solver_is_timed(names: list[str]) -> None:
    """A lazy import takes up to a second, which would be the time of the first problem that needs it."""
    names = [name for name in names if {*solvers.get(name).spec.requires} <= CORE]
    command = [sys.executable, "-c", WATCHED, *names]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout == ""
