"""A warm-up loads every compiled loop that a solve of its formulation needs.

A loop that is compiled within a solve takes seconds of it, and of each one after a solve that was killed meanwhile.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from tiers import some_by_day

from cpbench.solvers import solvers

ROOT = Path(__file__).parents[2]
NATIVE = [solver.spec.name for solver in solvers if solver.origin == "native"]
PROGRAM = """
import contextlib, json, sys
from pathlib import Path
from cpbench import storage
from cpbench.errors import CpbenchError
from cpbench.solvers import Budget, solvers, warming

def loops():
    return {module for module in sys.modules if ".kernels." in module}

solver = solvers.get(sys.argv[1])
warming.warm_up(solver)
warm, late = loops(), {}
for file in sorted((Path(sys.argv[2]) / solver.spec.node).glob("*.h5")):
    for name in storage.members(file)[:8]:
        problem = storage.load(f"{file}::{name}" if name else file)
        if solver.obstacle(problem) is None:
            with contextlib.suppress(CpbenchError):
                solver.run(problem, Budget(tolerance=1e-6, seconds=1.0))
            late |= {module: problem.name for module in loops() - warm if module not in late}
print(json.dumps(late))
"""


@pytest.mark.parametrize("name", ["admm-rfc", *some_by_day(NATIVE, 2)])
def test_no_loop_is_loaded_after_the_warm_up(name: str) -> None:
    command = [sys.executable, "-c", PROGRAM, name, str(ROOT / "problems")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == {}
