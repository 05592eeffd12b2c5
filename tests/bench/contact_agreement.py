"""Which of our solvers solve frictional contact as a mixed, cone, variational or quasi-variational problem.

    python tests/bench/contact_agreement.py FOLDER [--seconds 5] [--largest 60] [--nodes micp,cp,vi,qvi] [--lecture]

Every local contact problem in FOLDER with at most that many contacts goes to each node, and from there to every
solver of ours of that node (of cp also by vi); printed is the judged error of the answer on the contact problem, `nsgs`
beside them. --lecture: (49) as it stands, singular at open contacts.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from cpbench import graph, storage
from cpbench.conversions.base import make
from cpbench.errors import CpbenchError
from cpbench.formulations import FrictionContact, Point, Problem
from cpbench.solvers import Budget, Solver, solvers

REACHED = {"micp": ("micp",), "cp": ("cp", "vi"), "vi": ("vi",), "qvi": ("qvi",)}
"""Nodes whose solvers answer for a node."""
SOLVED = 1e-8
ASKED = 1e-11


def converted(problem: FrictionContact, node: str, **knobs: str) -> Iterator[tuple[Solver, Problem]]:
    """Every solver of ours that answers for a node, with the problem that it gets."""
    target = make(f"fc-{node}", knobs).step(problem)
    for solver in solvers:
        ours = type(solver).__module__.startswith("cpbench_solvers.")
        if ours and solver.spec.node in REACHED[node]:
            yield solver, graph.arrive(target, solver.spec.node).problem


def error_of(
    problem: FrictionContact, solver: Solver, target: Problem, budget: Budget, start: Point | None = None
) -> float:
    """Of the answer, on the contact problem; ∞ where there is none."""
    try:
        point = solver.run(target, budget, start=start).point
    except CpbenchError:
        return math.inf
    return math.inf if point is None else problem.residuals(graph.lift(target, point)).error


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--largest", type=int, default=60)
    parser.add_argument("--nodes", default=",".join(REACHED))
    parser.add_argument("--lecture", action="store_true")
    asked = parser.parse_args()
    count: Counter[str] = Counter()
    for path in sorted(p for p in asked.folder.iterdir() if p.suffix in (".dat", ".hdf5", ".h5")):
        problem = storage.load(path)
        if not isinstance(problem, FrictionContact) or problem.nc > asked.largest:
            continue
        count["files"] += 1
        budget = Budget(tolerance=ASKED, seconds=asked.seconds)
        native = problem.residuals(solvers.get("nsgs").run(problem, budget).point).error
        count["nsgs"] += native <= SOLVED
        print(f"{path.name}, {problem.nc} contacts\n    nsgs {native:.0e}")
        for node in asked.nodes.split(","):
            said, any_solved = [], False
            for solver, target in converted(
                problem, node, **({"form": "lecture"} if asked.lecture and node == "micp" else {})
            ):
                begun = time.perf_counter()
                error = error_of(problem, solver, target, budget)
                said.append(f"{solver.spec.name} {error:.0e} ({time.perf_counter() - begun:.1f} s)")
                any_solved |= error <= SOLVED
                count[f"{node}: {solver.spec.name}"] += error <= SOLVED
            count[f"{node}: any"] += any_solved
            print(f"    {node:5s}", ", ".join(said) or "no solver", flush=True)
    print(f"\nat {SOLVED:.0e}:", ", ".join(f"{name} {number}" for name, number in count.items()))


if __name__ == "__main__":
    main()
