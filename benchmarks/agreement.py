"""Ours against theirs: on answers of solvers to real problems, where the verdict and each published measure disagree.

python benchmarks/agreement.py --cache FOLDER [--seconds 3] [--budget 1200] [FOLDER_OF_DATA ...]

Answers are kept in the cache, so that two versions of the verdict can be compared on the same ones. Others pass an
answer where all their numbers are at most ε, PATH's each by itself. "Stricter" are answers that only they pass,
"looser" those that only the verdict passes.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
import warnings
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import cpbench
from cpbench.errors import CpbenchError
from cpbench.generators.collection import catalogue
from cpbench.verification import judge
from cpbench_lab.published import all_measures

sys.path.append(str(Path(__file__).parents[1] / "tests" / "truth"))
import real_files

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9)
JUDGED = (1e-4, 1e-6)
UNKNOWNS = 1200
"""Problems with more unknowns and multipliers are left out."""
SOLVERS: dict[str, tuple[str, ...]] = {
    "qp": ("clarabel", "piqp", "osqp", "scs", "highs", "proxqp", "auto-qp"),
    "coneqp": ("clarabel-coneqp", "scs-coneqp", "interior-point-coneqp", "admm-coneqp"),
    "lcp": ("auto-lcp", "lemke", "pgs", "newton-min", "interior-point-lcp", "mprgp", "casadi-ipopt"),
    "mlcp": ("auto-mlcp", "lemke-mlcp", "pgs-mlcp", "newton-fb-mlcp", "interior-point-mlcp", "casadi-ipopt-mlcp"),
    "relay": ("auto-relay", "lemke-relay", "pgs-relay", "newton-relay"),
    "fc": ("auto-fc", "nsgs", "interior-point-fc", "admm-fc", "proximal-newton", "clarabel-de-saxce", "pinocchio-admm"),
    "gfc": ("auto-gfc", "nsgs-gfc", "admm-gfc", "interior-point-fc"),
}
DATA = ("qp", "box_qp", "lcp", "mlcp", "relay", "fc2d_local", "fc3d_local", "fc3d_global")
Found = tuple[str, Any, list[tuple[str, Any]]]


def problems(folders: list[str]) -> Iterator[tuple[str, Any]]:
    """Yield the real problems, then those of the collection, each with a name."""
    ours = [(e.name, e.address) for e in catalogue() if e.address.startswith("builtin/")]
    built = ((name, cpbench.load(address)) for name, address in ours if not folders)
    for name, problem in itertools.chain(real_files.problems(*(folders or DATA)), built):
        if problem.node in SOLVERS and sum(problem.point_sizes.values()) <= UNKNOWNS:
            yield name, problem


def answers(problem: Any, seconds: float) -> Iterator[tuple[str, Any]]:
    """Yield what each solver returns at each tolerance; one that takes half its time is asked no more."""
    for solver, tolerance in itertools.product(SOLVERS[problem.node], TOLERANCES):
        begun = time.perf_counter()
        try:
            point = cpbench.solve(problem, solver, tolerance=tolerance, seconds=seconds).point
        except (CpbenchError, ArithmeticError, ValueError):
            continue
        if point is not None and point.finite and time.perf_counter() - begun < 2 * seconds:
            yield f"{solver} {tolerance:.0e}", point


def collected(cache: Path, folders: list[str], seconds: float, budget: float) -> Iterator[Found]:
    """Yield problems with their answers: those in the cache, and new ones until the budget is over."""
    start = time.perf_counter()
    for name, problem in problems(folders):
        file = cache / f"{problem.node}-{name.replace('/', '_')}.npz"
        if not file.exists() and time.perf_counter() - start < budget:
            given = list(answers(problem, seconds))
            with file.open("wb") as out:  # a name that NumPy leaves as it is
                labels = np.array([label for label, _ in given], dtype=str)
                np.savez(out, labels=labels, answers=np.array([point.vector for _, point in given]))
        if file.exists():
            with np.load(file) as kept:
                points = [problem.point_from_vector(x) for x in kept["answers"]]
                yield name, problem, list(zip(map(str, kept["labels"]), points, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", metavar="FOLDER_OF_DATA", help="all of them, and the collection")
    parser.add_argument("--cache", type=Path, required=True, help="where answers are kept")
    parser.add_argument("--seconds", type=float, default=3.0, help="limit of a solver [s]")
    parser.add_argument("--budget", type=float, default=1200.0, help="time after which no problem is begun [s]")
    given = parser.parse_args()
    given.cache.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore")
    counts: dict[tuple[str, str, float], list[int]] = defaultdict(lambda: [0, 0, 0])
    named: dict[tuple[str, str, float, str], list[tuple[str, str, float, float]]] = defaultdict(list)
    for name, problem, answers in collected(given.cache, given.folders, given.seconds, given.budget):
        for (label, point), tolerance in itertools.product(answers, JUDGED):
            verdict, rows = judge(problem, point, tolerance), all_measures(problem, point, tolerance)
            whose: dict[str, float] = {}
            for row in rows:
                owner = row.source.partition(" (")[0]
                owner += f", {row.name}" if owner == "PATH" else ""  # it prints them, and stops by one
                if row.bounded and owner != "cpbench":
                    whose[owner] = max(whose.get(owner, 0.0), row.value)
            for owner, theirs in whose.items():
                key = (problem.node, owner, tolerance)
                kind = 0 if verdict.within == (theirs <= tolerance) else 2 if verdict.within else 1
                counts[key][kind] += 1
                if kind:
                    named[*key, ("", "stricter", "looser")[kind]].append((name, label, verdict.error, theirs))
    print("| problems | whose | ε | agree | ours stricter | ours looser |\n|---|---|---:|---:|---:|---:|")
    for (node, source, tolerance), numbers in sorted(counts.items()):
        print(f"| {node} | {source} | {tolerance:.0e} | {' | '.join(map(str, numbers))} |")
    for (node, source, tolerance, kind), cases in sorted(named.items()):
        print(f"\n{node}, {source}, {tolerance:.0e}, ours {kind}:")
        for name, group in itertools.groupby(cases, key=lambda case: case[0]):
            told = list(group)
            worst = max(told, key=lambda case: abs(np.log(max(case[2], 1e-300) / max(case[3], 1e-300))))
            print(f"  {name}: {len(told)}, ours {worst[2]:.1e} theirs {worst[3]:.1e} ({worst[1]})")


if __name__ == "__main__":
    main()
