"""Overhead of a pair in a warm worker: wall time minus load and solve, over many tiny LCPs.

    python tests/bench/overhead.py [PAIRS]

Prints the median and the 95th percentile of what the runner adds to a pair (messages, conversion look-up, lift,
verdict, the row and its answer in SQLite), and on the last line the median in milliseconds.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from cpbench import storage
from cpbench.bench import plan
from cpbench.bench.lane import Lane
from cpbench.bench.store import Store
from cpbench.formulations import LCP


def main(pairs: int) -> None:
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as name, Lane() as lane:
        folder = Path(name)
        asked, entries = [plan.exact()], [plan.Entry("lemke")]
        surveys = []
        for i in range(50):
            A = rng.standard_normal((10, 10))
            path = folder / f"p{i}.h5"
            storage.save(LCP(M=A @ A.T + np.eye(10), q=rng.standard_normal(10), name=f"p{i}"), path)
            surveys.append(lane.survey(str(path), asked))
        planned = plan.pairs(surveys, entries, asked, 1e-8, plan.Limits(repeats=1))
        store = Store(folder / "r.sqlite", create=True)
        store.plan(planned)
        lane.start(["lemke"])
        overheads = []
        while len(overheads) < pairs:
            for pair in planned:
                prepared = lane.prepare(pair)
                lane.run(pair, prepared)  # the worker loads the problem
                begun = time.perf_counter()
                outcome = lane.run(pair, prepared)
                store.finish(pair.key, outcome.row, outcome.answer)
                row = outcome.row
                overheads.append(time.perf_counter() - begun - row["load"] - row["setup"] - row["solve"])
                assert row["status"] == "solved", row
        store.close()
    p95 = sorted(overheads)[int(0.95 * len(overheads))]
    print(f"{len(overheads)} pairs: median {statistics.median(overheads) * 1e3:.3f} ms, p95 {p95 * 1e3:.3f} ms")
    print(f"{statistics.median(overheads) * 1e3:.3f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
