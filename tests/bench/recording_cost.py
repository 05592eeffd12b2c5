"""What recording a history adds to a solve, net of the recorder's own time, for every solver that records.

    python tests/bench/recording_cost.py

Planted problems of several sizes, solved to 1e-10 (at most 2000 iterations), without and with a recorder in random
order; the least of the net times, which other work on the machine disturbs least. The last line is the largest share
that is added to a solve of 5 ms or more, in percent, and the most that is added to a shorter one, in milliseconds.
"""

from __future__ import annotations

import gc
import random
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from cpbench.bench.history import recorded
from cpbench.bench.messages import Recorded
from cpbench.formulations.base import Problem
from cpbench.solvers.base import Budget, Solver, Trait, solvers
from cpbench.testing import planted, planted_conic, planted_contact

LONG = 5e-3
SPENT = 3.0
"""Seconds a problem and solver are repeated for, at least REPEATS and at most MOST times."""
REPEATS, MOST = 9, 200


def problems(rng: np.random.Generator) -> Iterator[tuple[str, Problem]]:
    for n in (20, 200, 1000):
        yield f"lcp {n}", planted.lcp(rng, n, "positive definite")[0]
        yield f"relay {n}", planted_conic.relay(rng, n, "positive definite")[0]
    for nc in (3, 30, 150):
        yield f"fc {nc}", planted.fc(rng, nc, 3)[0]
        yield f"rfc {nc}", planted_contact.rfc(rng, nc, 5)[0]
    yield "soclcp", planted_conic.soclcp(rng)[0]
    yield "coneqp", planted_conic.plain_coneqp(rng)[0]


def measured(solver: Solver, problem: Problem, budget: Budget) -> tuple[float, float, Recorded]:
    """Least seconds without and with recording, the latter net, and what the last recording tells."""
    options = solver.spec.options()
    alone: list[float] = []
    watched: list[float] = []
    found: Recorded | None = None
    begun = time.perf_counter()
    draw = random.Random(0)
    while min(len(alone), len(watched)) < REPEATS or (len(alone) < MOST and time.perf_counter() - begun < SPENT):
        if draw.random() < 0.5:  # in strict turns, one of the two may get its memory back warm and the other not
            alone.append(unrecorded(solver, problem, budget, options))
        else:
            found = recorded(solver, problem, budget, options, None)
            watched.append(found.solve)
    assert found is not None, "one of the two ways is drawn before the other is done"
    return min(alone), min(watched), found


def unrecorded(solver: Solver, problem: Problem, budget: Budget, options: Any) -> float:
    """Seconds of a solve, set up and left as `recorded` does it, so that the memory is found in the same state."""
    prepared = solver.setup(problem, budget, options)
    gc.collect(0)
    begun = time.perf_counter()
    solver.solve(prepared, budget, options)
    return time.perf_counter() - begun


def main() -> None:
    solvers.discover()
    budget = Budget(tolerance=1e-10, iterations=2000)
    shares, extras = [0.0], [0.0]
    for name, problem in problems(np.random.default_rng(0)):
        for solver in (solvers.get(s) for s in solvers.names()):
            spec = solver.spec
            if Trait.HISTORY not in spec.traits or spec.node != problem.node or solver.obstacle(problem) is not None:
                continue
            solver.warmup()
            alone, watched, told = measured(solver, problem, budget)
            print(
                f"{name:12} {spec.name:14} {alone * 1e3:9.3f} ms, recorded {watched * 1e3:9.3f} ms net "
                f"({100 * (watched / alone - 1):+5.1f} %, {1e6 * (watched - alone):+7.1f} us), {told.count:3} of "
                f"{told.calls:4} iterates kept in {told.cost * 1e3:7.3f} ms",
                flush=True,
            )
            if alone >= LONG:
                shares.append(watched / alone - 1)
            else:
                extras.append(watched - alone)
    print(f"{100 * max(shares):.1f} {1e3 * max(extras):.3f}")


if __name__ == "__main__":
    main()
