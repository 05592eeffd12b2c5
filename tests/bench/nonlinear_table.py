"""Which solver of nonlinear complementarity solves which problem from which start: counts at 1e-8 and 1e-10.

    python tests/bench/nonlinear_table.py [--node ncp --node micp] [--solver NAME ...] [--large] [--seconds 20]

The problems are those of the generated collections whose node is micp or has an edge to it; answers are lifted back
and judged on the problem as it is in the collection. Siconos' solvers of micp stand beside the native ones where it is
installed, PATH where GAMS has a licence for it (`path_by_gams`). A cell has iterations (restarts after r), and the
error where it is above 1e-10.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import path_by_gams

from cpbench.conversions.base import conversions
from cpbench.errors import CpbenchError
from cpbench.formulations import MiCP, MiCPPoint
from cpbench.formulations.base import Point, Problem
from cpbench.generators.base import generators
from cpbench.solvers.base import Budget, solvers

TARGET = 1e-12
LEVELS = (1e-8, 1e-10)
PATH = "PATH"


def tasks(nodes: list[str], large: bool) -> Iterator[tuple[str, Problem, MiCP, Any, list[np.ndarray]]]:
    """Name, problem, the same as a MiCP, what lifts its points, starts."""
    for collection in generators:
        if collection.node not in nodes or collection.name.endswith("-large") != large:
            continue
        edge = None if collection.node == "micp" else conversions.get(f"{collection.node}-micp")()
        for instance in collection.instances():
            source: Any = instance.problem
            if edge is None:
                micp, lift = source, lambda point: point
            else:
                if edge.obstacle(source) is not None:
                    continue
                micp, trace = edge.apply(source)
                lift = lambda point, edge=edge, trace=trace: edge.lift(point, trace)  # noqa: E731
            starts = [micp.start]
            if source.point_sizes == micp.point_sizes:  # the same unknowns
                starts += [p.z for p in instance.starts if not np.array_equal(p.z, micp.start)]
            yield f"{collection.name}/{instance.name}", source, micp, lift, starts


def attempt(name: str, micp: MiCP, start: np.ndarray, seconds: float) -> tuple[Point | None, str]:
    if name == PATH:
        z, said = path_by_gams.solve(micp, start, TARGET, seconds)
        return (None if z is None else MiCPPoint(z)), said if z is None else ""
    solver = solvers.get(name)
    if solver.obstacle(micp) is not None:
        return None, "refused"
    output = solver.run(micp, Budget(tolerance=TARGET, seconds=seconds), start=MiCPPoint(start))
    restarts = output.counters.get("restarts", 0)
    return output.point, f"{output.counters.get('iterations', '')}" + (f"r{restarts}" if restarts else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--node", action="append")
    parser.add_argument("--solver", action="append")
    parser.add_argument("--only", default="", help="part of the names of problems")
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--seconds", type=float, default=20.0)
    chosen = parser.parse_args()
    free = [s for s in solvers if s.spec.node == "micp" and not s.spec.requires]
    native = {s.spec.name for s in free if type(s).__module__.startswith("cpbench_solvers.")}
    names = chosen.solver or [s.spec.name for s in free if s.availability().ok]
    if chosen.solver is None and path_by_gams.usable():
        names.append(PATH)
    warnings.simplefilter("ignore")
    solved = {name: dict.fromkeys(LEVELS, 0) for name in names}
    spent, refused = dict.fromkeys(names, 0.0), dict.fromkeys(names, 0)
    together, count = dict.fromkeys(LEVELS, 0), 0
    print("| problem | n | start | " + " | ".join(names) + " |\n|" + "---|" * (3 + len(names)))
    for label, source, micp, lift, starts in tasks(chosen.node or ["ncp", "micp", "vi", "nlp"], chosen.large):
        if chosen.only not in label:
            continue
        for number, start in enumerate(starts, 1):
            count += 1
            cells, least = [], np.inf
            for name in names:
                before = time.perf_counter()
                try:
                    point, said = attempt(name, micp, start, chosen.seconds)
                except CpbenchError as refusal:
                    point, said = None, type(refusal).__name__
                spent[name] += time.perf_counter() - before
                error = np.inf if point is None else source.residuals(lift(point)).error
                refused[name] += point is None
                for level in LEVELS:
                    solved[name][level] += error <= level
                if name in native:
                    least = min(least, error)
                cells.append(said if error <= LEVELS[1] else f"{said} **{error:.0e}**")
            for level in LEVELS:
                together[level] += least <= level
            print(f"| {label} | {micp.start.size} | {number} | " + " | ".join(cells) + " |", flush=True)
    for level in LEVELS:
        row = ", ".join(f"{name} {solved[name][level]}" for name in names)
        print(f"\nsolved at {level:.0e} of {count}: {row}; native together {together[level]}")
    print("\nseconds: " + ", ".join(f"{name} {spent[name]:.1f}" for name in names))
    print("no answer (licence, operator, refusal): " + ", ".join(f"{n} {k}" for n, k in refused.items() if k))


if __name__ == "__main__":
    main()
