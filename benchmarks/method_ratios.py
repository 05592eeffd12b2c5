"""How near each method of cpbench comes to the fastest one of its formulation, on the built-in problems.

    python benchmarks/method_ratios.py lcp qp

Prints the tables of docs/generate/method_ratios.toml: processor time of set-up and solve, the least of three after a
warm one, over that of the fastest method, the least such ratio over the problems that the method solves.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path
from typing import Any

from cpbench import storage
from cpbench.foundation.extensions import NATIVE
from cpbench.solvers.base import Budget, Solver, solvers
from cpbench.verification import judge

PROBLEMS = Path(__file__).resolve().parents[1] / "problems"
BUDGET = Budget(tolerance=1e-6, seconds=1.0)
LONG = 0.2
"""Processor time after which a solve is not repeated [s]."""


def seconds(solver: Solver, problem: Any) -> float:
    """Return the processor time of set-up and solve [s], infinite where the answer misses the tolerance."""
    if solver.obstacle(problem) is not None:
        return math.inf
    options, taken = solver.spec.options(), list[float]()
    answer = None
    for _ in range(4):
        begun = time.thread_time()
        answer = solver.solve(solver.setup(problem, BUDGET, options), BUDGET, options).point
        taken.append(time.thread_time() - begun)
        if taken[-1] > LONG:
            break
    solved = answer is not None and judge(problem, answer, BUDGET.tolerance).error <= BUDGET.tolerance
    return min(taken[1:] or taken) if solved else math.inf


def ratios(node: str) -> dict[str, float]:
    """Return the least ratio of every method of cpbench, without the automatic choice."""
    native = [s for s in solvers if s.spec.node == node and type(s).__module__.startswith(NATIVE)]
    methods = [s for s in native if s.spec.method != "automatic choice"]
    least = {s.spec.name: math.inf for s in methods}
    for address in storage.problem_files([PROBLEMS / node]):
        problem = storage.load(address)
        times = {s.spec.name: seconds(s, problem) for s in methods}
        fastest = min(times.values())
        if math.isfinite(fastest):
            least = {name: min(ratio, times[name] / fastest) for name, ratio in least.items()}
    return dict(sorted(least.items(), key=lambda item: item[1]))


def main() -> None:
    """Print a table of each formulation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("nodes", nargs="+")
    for node in parser.parse_args().nodes:
        print(f"[{node}]", *(f"{name} = {ratio:.2f}" for name, ratio in ratios(node).items()), "", sep="\n")


if __name__ == "__main__":
    main()
