"""What the runner adds to a solve: messages, look-ups, lift, verdict, the row and its answer in SQLite.

    python benchmarks/overhead.py [--pairs 10000] [--tries 2]

The overhead of a pair is the time from the end of the pair before it to its own end, less the load, setup and solve
that its row tells: opening and converting the problem, once for all its solvers, and the reference solves of the run
are in it. Measured are pairs of tiny LCPs in a warm worker, and the same into files that hold 1,000, 10,000 and 100,000
rows already.

Times are wall times. `quietest` is the least median of ten consecutive parts: what is left when nothing else is at
work on the machine. The last line is the median of the first part in milliseconds.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cpbench import storage
from cpbench.bench import machine
from cpbench.bench.events import Done, Event
from cpbench.bench.planning import plan
from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.bench.run import execute
from cpbench.bench.slot import Slot
from cpbench.formulations import LCP

ENTRIES = [plan.Entry("psor", {"omega": round(0.6 + 0.1 * i, 1)}) for i in range(10)]
LIMITS = plan.Limits(repeats=1)
ROWS = (1_000, 10_000, 100_000)
ROUNDS = 5
"""Short runs into each of the files, by turns: the machine drifts within seconds."""
PARTS = ("load", "setup", "solve", "lift", "verify")


@dataclass
class Clock:
    """Reads the time at the end of every pair; the first, before which workers start, is left out."""

    rows: list[Outcome] = field(default_factory=list)
    passed: list[float] = field(default_factory=list)
    last: float = 0.0

    def __call__(self, event: Event) -> None:
        if not isinstance(event, Done):
            return
        now, row = time.perf_counter(), event.outcome
        if row.status not in ("solved", "inaccurate"):  # PSOR ends by an error of its own
            raise SystemExit(f"{event.pair.address}: {row.status}: {row.message}")
        if self.last:
            self.rows.append(row)
            self.passed.append(now - self.last)
        self.last = now

    def overheads(self) -> list[float]:
        """Seconds, in the order of the run."""
        return [
            p - (r.load or 0.0) - (r.setup or 0.0) - (r.solve or 0.0)
            for p, r in zip(self.passed, self.rows, strict=True)
        ]

    def parts(self) -> dict[str, float]:
        """Medians of what a row tells [s]; `wall` is the slot's part, what is left of a pair is the store's."""
        told = {name: statistics.median(getattr(row, name) for row in self.rows) for name in (*PARTS, "wall")}
        return {**told, "pair": statistics.median(self.passed)}


def tiny_lcps(folder: Path, slot: Slot, count: int, seed: int) -> list[Pair]:
    """Pairs of strictly monotone LCPs of ten unknowns with every entry."""
    rng = np.random.default_rng(seed)
    surveys: list[dict[str, Any]] = []
    for i in range(count):
        A = rng.standard_normal((10, 10))
        path = folder / f"lcp-{seed}-{i}.h5"
        storage.save(LCP(M=A @ A.T + 10 * np.eye(10), q=rng.standard_normal(10), name=path.stem), path)
        surveys.append(slot.survey(str(path), [plan.exact()]))
    return plan.pairs(surveys, ENTRIES, [plan.exact()], 1e-6, LIMITS)


def run(slot: Slot, path: Path, planned: Sequence[Pair]) -> Clock:
    clock = Clock()
    with Store(path, create=True) as store:
        store.plan(planned)
        execute([slot], store, planned, on_event=clock)
    return clock


def fill(path: Path, rows: int) -> None:
    """Copy the first row and its answer until the file holds `rows` of them."""
    with Store(path, create=True) as store:
        (first, *_), ((_, answer), *_) = store.rows(), store.answers()
        missing = rows - sum(store.counts().values())
        keys = [f"{i * 2654435761 % 2**32:032x}" for i in range(1, missing + 1)]
        store.add(replace(first, key=key) for key in keys)
        store.add_kept((key, answer, None, None, None) for key in keys)


def warm(folder: Path, pairs: int) -> float:
    """Prints the overhead in a warm worker and where a pair's time goes; the median [s]."""
    with Slot() as slot:
        planned = tiny_lcps(folder, slot, pairs // len(ENTRIES), seed=0)
        clock = run(slot, folder / "warm.sqlite", planned)
    median = _table("1. warm worker", clock.overheads())
    told = ", ".join(f"{name} {seconds * 1e3:.3f}" for name, seconds in clock.parts().items())
    print(f"   medians of a pair [ms]: {told}")
    return median


def growth(folder: Path, pairs: int, tries: int) -> None:
    """Prints the overhead into files that hold rows already."""
    medians: dict[int, float] = dict.fromkeys(ROWS, float("inf"))
    with Slot() as slot:
        first = tiny_lcps(folder, slot, 1, seed=1)
        for rows in ROWS:
            run(slot, folder / f"{rows}.sqlite", first)
            fill(folder / f"{rows}.sqlite", rows)
        for i, rows in itertools.product(range(ROUNDS * tries), ROWS):
            planned = tiny_lcps(folder, slot, pairs // len(ENTRIES) // 20, seed=ROWS.index(rows) + 10 * (i + 1))
            over = run(slot, folder / f"{rows}.sqlite", planned).overheads()
            medians[rows] = min(medians[rows], statistics.median(over))
    print(f"2. rows there before         {''.join(f'{rows:9,d}' for rows in ROWS)}")
    print(f"   least median [ms]         {_ms(*medians.values())}")
    print(f"   against {ROWS[0]:,d} rows        {''.join(f'{m / medians[ROWS[0]]:9.2f}' for m in medians.values())}")


def _table(name: str, over: Sequence[float]) -> float:
    """Prints figures of overheads; their median [s]."""
    median = statistics.median(over)
    p95 = sorted(over)[int(0.95 * len(over))]
    print(f"{name + f', {len(over) + 1} pairs':29s}   median      p95     mean quietest [ms]")
    print(f"{'   overhead':29s}{_ms(median, p95, statistics.fmean(over), _quietest(over))}")
    return median


def _quietest(over: Sequence[float], parts: int = 10) -> float:
    """The least median of consecutive parts [s]."""
    return min(statistics.median(over[i * len(over) // parts : (i + 1) * len(over) // parts]) for i in range(parts))


def _ms(*seconds: float) -> str:
    return "".join(f"{s * 1e3:9.3f}" for s in seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description="Overhead of a pair.")
    parser.add_argument("--pairs", type=int, default=10_000, help="pairs of tiny LCPs in a warm worker")
    parser.add_argument("--tries", type=int, default=2, help="repeats of the short runs into each of the files")
    given = parser.parse_args()
    cores = machine.describe()
    print(f"{cores['cpu']}, {cores['threads']} threads, load {cores['load']}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        median = warm(folder, given.pairs)
        growth(folder, given.pairs, given.tries)
    print(f"{median * 1e3:.3f}")


if __name__ == "__main__":
    main()
