"""What a solver in a program of its own costs beyond its solve: the same pairs served, and solved in the worker.

    python tests/bench/serve_overhead.py                  a minute; needs g++

A C++ projected Gauss-Seidel (tests/faults/served_pgs.cpp) and our own `pgs` solve tiny dense LCPs through
`runner.execute` with a store, as `overhead.py` measures it: the overhead of a pair is the time from the end of the pair
before it to its own end, less the load (which hands the problem over), setup and solve that its row tells. Both come by
turns. What is printed last is what serving adds to a pair, in milliseconds: the difference of the least medians of
short stretches of both, which a machine with other work spoils least.

Before that, without a run, the steps of the served solver alone: handing over, the round trip of a solve, the answer.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import overhead

from cpbench import storage
from cpbench.bench import machine
from cpbench.bench.planning import plan
from cpbench.bench.slot import Slot
from cpbench.formulations import LCP
from cpbench.registry import DECLARED
from cpbench.solvers.base import Budget, solvers
from cpbench.solvers.external.declared import declare
from cpbench.solvers.external.served import ServedSolver

SOURCE = Path(__file__).resolve().parents[1] / "faults" / "served_pgs.cpp"
UNKNOWNS = 3
TURNS = 4
STRETCH = 20
"""Pairs of a stretch."""


def tiny(seed: int) -> LCP:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((UNKNOWNS, UNKNOWNS))
    return LCP(M=A @ A.T + UNKNOWNS * np.eye(UNKNOWNS), q=rng.standard_normal(UNKNOWNS), name=f"tiny-{seed}")


def steps(count: int) -> None:
    """Prints the medians of hand_over, solve and collect [ms]."""
    solver, problem = solvers.get("cpp-pgs"), tiny(0)
    solver.warmup()
    taken: list[tuple[float, float, float]] = []
    for _ in range(count):
        begun = time.perf_counter()
        handed = solver.hand_over(problem)
        loaded = time.perf_counter()
        output = solver.solve(handed, Budget(), solver.spec.options())
        solved = time.perf_counter()
        solver.collect(output)
        taken.append((loaded - begun, solved - loaded, time.perf_counter() - solved))
    medians = [statistics.median(times) * 1e3 for times in zip(*taken, strict=True)]
    print("alone [ms]: hand over {:.3f}, solve {:.3f}, collect {:.3f}".format(*medians))
    assert isinstance(solver, ServedSolver)
    solver.close()


def runs(folder: Path, problems: int) -> float:
    """Prints the overheads of pairs in a run; what serving adds [s]."""
    paths = [folder / f"{i}.h5" for i in range(problems)]
    for i, path in enumerate(paths):
        storage.save(tiny(i), path)
    clocks: dict[str, list[overhead.Clock]] = {"pgs": [], "cpp-pgs": []}
    with Slot() as slot:
        surveys = [slot.survey(str(path), [plan.exact()]) for path in paths]
        for turn in range(TURNS):
            for name, found in clocks.items():
                planned = plan.pairs(surveys, [plan.Entry(name)], [plan.exact()], 1e-6, plan.Limits(repeats=1))
                found.append(overhead.run(slot, folder / f"{name}-{turn}.sqlite", planned))
    medians: dict[str, float] = {}
    for name, found in clocks.items():
        over = [seconds for clock in found for seconds in clock.overheads()]
        medians[name] = min(statistics.median(over[i : i + STRETCH]) for i in range(0, len(over) - STRETCH, STRETCH))
        parts = {part: statistics.median(clock.parts()[part] for clock in found) for part in ("load", "solve")}
        print(
            f"{name:8s} {len(over)} pairs [ms]: overhead {statistics.median(over) * 1e3:.3f}, "
            f"quietest {medians[name] * 1e3:.3f}, p95 {sorted(over)[int(0.95 * len(over))] * 1e3:.3f}, "
            f"load {parts['load'] * 1e3:.3f}, solve {parts['solve'] * 1e3:.3f}"
        )
    return medians["cpp-pgs"] - medians["pgs"]


def main() -> None:
    parser = argparse.ArgumentParser(description="Overhead of a served solver.")
    parser.add_argument("--problems", type=int, default=300)
    given = parser.parse_args()
    described = machine.describe()
    print(f"{described['cpu']}, {described['threads']} threads, load {described['load']}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(["g++", "-O2", "-o", str(folder / "pgs"), str(SOURCE)], check=True)
        declare("cpp-pgs", {"node": "lcp", "serve": "./pgs", "matrices": "dense"}, "here", folder)
        assert "cpp-pgs" in json.loads(os.environ[DECLARED])  # which the processes of the run read
        steps(1000)
        added = runs(folder, given.problems)
    print(f"{added * 1e3:.3f}")


if __name__ == "__main__":
    main()
