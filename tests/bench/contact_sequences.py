"""Contact problems of one scene after another: what a start from the answer of the step before saves, losses first.

    python tests/bench/contact_sequences.py [--tolerance 1e-6] [--solvers auto-fc,nsgs,...] [--pairs 3]

Every solver of frictional contact of ours that can start warm solves the steps of `contact-sequence` twice: from
nothing, and from its own answer to the step before, handed over by contact as `cpbench run --start previous` does.
A ratio is warm over cold processor time of one step, in turn, the median of some pairs; below 1 warm is faster.
"""

from __future__ import annotations

import argparse
import statistics
import time
from typing import Any

import one_core

SECONDS = 5.0
"""A solve that takes longer is given up."""


def seconds_of(solver: Any, prepared: Any, budget: Any, options: Any, start: Any) -> tuple[float, Any]:
    before = time.process_time()
    output = solver.solve(prepared, budget, options, start)
    return time.process_time() - before, output


def main(names: list[str], tolerance: float, pairs: int) -> None:
    from cpbench.formulations.transfer import transfer
    from cpbench.generators import generators
    from cpbench.solvers import Budget, Claim, Trait, solvers

    steps = [instance.problem for instance in generators.get("contact-sequence").instances()]
    chosen = [
        solver
        for solver in solvers
        if solver.spec.node == "fc"
        and Trait.WARM_START in solver.spec.traits
        and (solver.spec.name in names if names else type(solver).__module__.startswith("cpbench_solvers."))
        and solver.obstacle(steps[0]) is None
    ]
    budget = Budget(tolerance=tolerance, seconds=SECONDS)
    lines: list[tuple[float, str]] = []
    for solver in chosen:
        solver.warmup()
        options = solver.spec.options()
        ratios: list[float] = []
        cold_total = warm_total = unsolved = 0.0
        previous: Any = None
        for problem in steps:
            prepared = solver.setup(problem, budget, options)
            start = None if previous is None else transfer(*previous, problem).point
            times: list[tuple[float, float]] = []
            output: Any = None
            for _ in range(pairs):
                cold, output = seconds_of(solver, prepared, budget, options, None)
                warm, from_before = seconds_of(solver, prepared, budget, options, start)
                times.append((cold, warm))
            if Claim.SOLVED in (from_before.claim, output.claim):
                best = from_before if from_before.claim is Claim.SOLVED else output
                if start is not None and from_before.claim is output.claim:
                    ratios.append(statistics.median(warm / cold for cold, warm in times))
                    cold_total += statistics.median(cold for cold, _ in times)
                    warm_total += statistics.median(warm for _, warm in times)
                previous = (problem.contacts, best.point)
            else:
                previous = None
            unsolved += int(from_before.claim is not Claim.SOLVED)
        if ratios:
            middle, slower = statistics.median(ratios), sum(ratio > 1.0 for ratio in ratios)
            text = f"{middle:8.2f} {warm_total / cold_total:8.2f} {slower:6d} of {len(ratios):2d} {int(unsolved):9d}"
            text += (
                f" {1e3 * cold_total / len(ratios):10.3f} {1e3 * warm_total / len(ratios):10.3f}  {solver.spec.name}"
            )
            lines.append((middle, text))
            print(f"# {text}", flush=True)
    print(
        f"{'median':>8s} {'total':>8s} {'slower':>12s} {'unsolved':>9s} {'cold [ms]':>10s} {'warm [ms]':>10s}  solver"
    )
    for _, text in sorted(lines, reverse=True):
        print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--solvers", default="", help="names; all of ours that can start warm")
    parser.add_argument("--pairs", type=int, default=3)
    arguments = parser.parse_args()
    one_core.hold()
    main([name for name in arguments.solvers.split(",") if name], arguments.tolerance, arguments.pairs)
