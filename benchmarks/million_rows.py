"""Every statistic of `cpbench.analysis` on a table of a million rows: how long, and how much memory.

    python benchmarks/million_rows.py                               10,000 problems x 100 labels, then 100,000 x 10
    python benchmarks/million_rows.py --problems 2000 --labels 50   smaller
    python benchmarks/million_rows.py --only means                  one of them alone

The table is made up (`made_up_rows`).

Each statistic runs twice. `seconds` is the processor time it took in this process, which has the table and the matrix
of times: what it takes on an idle core, whoever else is at work; `wall` is what the clock said. A child process (fork)
tells the memory, as time it is no witness: whatever it looks at is copied for it first. `more` is what its memory grew
by, `peak` the most it held, table included. Required are 1 s for the profile, 20 s for all statistics together, 10 s
for what another command asks of a table, 2 GB for any of them; the last line says PASS or what is over. `statistics` is
the sum that is judged, `with the commands` the sum of everything.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from made_up_rows import LIMIT, as_paths, as_starts, make

from cpbench.analysis import (
    bootstrap,
    failures,
    histories,
    means,
    metrics,
    participation,
    profiles,
    reliability,
    starts,
    summary,
)
from cpbench.analysis import table as rows_of
from cpbench.analysis.comparison import ComparisonSide, compare
from cpbench.analysis.ranking import rankings

SHAPES = ((10_000, 100), (100_000, 10))
"""Problems and labels, a process each."""
PROFILE, ALL, COMMAND, MEMORY = 1.0, 20.0, 10.0, 2.0
"""Required: seconds, seconds, seconds, GB."""


@dataclass(frozen=True)
class Data:
    """What the statistics are given: the group of all rows, its matrix of times, the family of each problem; the same
    rows read as cold and warm ones; iterates."""

    rows: pd.DataFrame
    times: pd.DataFrame
    families: pd.Series
    started: pd.DataFrame
    paths: pd.DataFrame


def statistics(data: Data) -> dict[str, Callable[[], Any]]:
    """What is measured, by name."""
    rows, times, families = data.rows, data.times, data.families
    leading = profiles.performance_profile(times).leading(6)
    return {
        "matrix of times": lambda: rows_of.times(rows),
        "groups": lambda: rows_of.groups(rows),
        "performance profile": lambda: profiles.performance_profile(times),
        "profile: envelope, areas": lambda: profiles.performance_profile(times).by_height(),
        "profile of iterations": lambda: profiles.performance_profile(
            metrics.matrix(rows, metrics.metric("iterations", rows)), floor=1.0
        ),
        "profile of memory": lambda: profiles.performance_profile(
            metrics.matrix(rows, metrics.METRICS["memory"]), floor=metrics.MEMORY_FLOOR
        ),
        "gaps to the virtual best": lambda: means.gaps(times),
        "means": lambda: (means.means(times, limit=LIMIT), means.means(times, limit=LIMIT, common=leading)),
        "bootstrap of means": lambda: bootstrap.mean_time(times, 0.1, LIMIT, families=families),
        "claims": lambda: reliability.claim_counts(rows),
        "inexact routes": lambda: reliability.inexact_routes(rows),
        "ranking": lambda: rankings(rows),
        "verdicts": lambda: summary.verdicts(rows),
        "families": lambda: summary.families(rows),
        "size ranges": lambda: summary.size_ranges(rows),
        "failures by reason": lambda: failures.failures(rows),
        "refusals by reason": lambda: failures.failures(rows, refused=True),
        "hardest problems": lambda: failures.hardest(rows),
        "flagged": lambda: failures.flagged(rows, "direction"),
        "participation": lambda: (participation.absences(rows), participation.participating(rows)),
        "warm over cold": lambda: starts.paired(data.started),
        "work-precision": lambda: histories.work_precision(rows, data.paths),
    }


def commands(data: Data) -> dict[str, Callable[[], Any]]:
    """What other commands than the report ask of a table."""
    rows = data.rows
    half = rows[rows["label"].isin(sorted(set(rows["label"]))[::2])].reset_index(drop=True)
    again = half.assign(solve=half["solve"] * np.random.default_rng(1).lognormal(0, 0.02, len(half)))
    return {
        "compare two runs of half": lambda: compare(ComparisonSide("base", half), ComparisonSide("new", again)),
    }


def measured(call: Callable[[], Any]) -> dict[str, Any]:
    """Processor seconds and wall seconds of a call here, bytes more and bytes at its peak in a child process."""
    held = _held(call)
    if "error" in held:
        return held
    wall, cpu = time.perf_counter(), time.process_time()
    call()
    return {"seconds": time.process_time() - cpu, "wall": time.perf_counter() - wall, **held}


def _held(call: Callable[[], Any]) -> dict[str, Any]:
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        try:
            gc.disable()  # else it copies the pages of every object of the parent by counting them
            before = _resident()
            call()
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
            told = {"more": peak - before, "peak": peak}
        except BaseException as cause:
            told = {"error": f"{type(cause).__name__}: {cause}"}
        with os.fdopen(writing, "w") as pipe:
            json.dump(told, pipe)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        text = pipe.read()
    os.waitpid(child, 0)
    return json.loads(text) if text else {"error": "the child died"}


def _resident() -> int:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def prepared(problems: int, labels: int, seed: int) -> tuple[Data, dict[str, dict[str, Any]]]:
    """The data, and what it took to normalise the table."""
    raw = make(problems, labels, seed)
    first = {"normalised": measured(partial(rows_of.normalised, raw))}
    rows = rows_of.normalised(raw)
    del raw
    families = bootstrap.families_of(rows)
    data = Data(rows, rows_of.times(rows), families, as_starts(rows), as_paths(rows, seed))
    gc.collect()
    gc.freeze()
    return data, first


def told(calls: Mapping[str, Callable[[], Any]], only: str) -> dict[str, dict[str, Any]]:
    """What was measured of the calls with `only` in their name."""
    return {name: measured(call) for name, call in calls.items() if only in name}


def report(costs: Mapping[str, Mapping[str, Any]], commands: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Print the table of the statistics `found` and what commands `asked`; what is over."""
    over: list[str] = []
    print(f"{'':32}{'seconds':>9}{'wall':>9}{'more, MB':>10}{'peak, GB':>10}")
    for name, cost in {**costs, **commands}.items():
        if "error" in cost:
            print(f"{name:32}{cost['error']}")
            over.append(f"{name} failed")
            continue
        print(
            f"{name:32}{cost['seconds']:9.2f}{cost['wall']:9.2f}{cost['more'] / 1e6:10.0f}{cost['peak'] / 1e9:10.2f}",
        )
        if cost["peak"] > MEMORY * 1e9:
            over.append(f"{name}: {cost['peak'] / 1e9:.2f} GB")
        if name in commands and cost["seconds"] > COMMAND:
            over.append(f"{name}: {cost['seconds']:.2f} s")
    for title, part in {"statistics": costs, "with the commands": {**costs, **commands}}.items():
        spent, wall = (sum(cost.get(column, 0.0) for cost in part.values()) for column in ("seconds", "wall"))
        print(f"{title:32}{spent:9.2f}{wall:9.2f}")
    profile = sum(costs[n].get("seconds", 0.0) for n in ("matrix of times", "performance profile") if n in costs)
    if profile:
        print(f"{'profile, with its matrix':32}{profile:9.2f}")
    if profile > PROFILE:
        over.append(f"profile: {profile:.2f} s")
    whole = sum(cost.get("seconds", 0.0) for cost in costs.values())
    if whole > ALL:
        over.append(f"statistics: {whole:.2f} s")
    return over


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int)
    parser.add_argument("--labels", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="Statistics with this in their name.")
    given = parser.parse_args()
    if given.problems is None and given.labels is None:
        shapes = [["--problems", str(problems), "--labels", str(labels)] for problems, labels in SHAPES]
        sys.exit(max([subprocess.run([sys.executable, *sys.argv, *shape]).returncode for shape in shapes]))
    data, costs = prepared(given.problems or SHAPES[0][0], given.labels or SHAPES[0][1], given.seed)
    size = data.rows.memory_usage(deep=False).sum() + data.started.memory_usage(deep=False).sum()
    problems, labels = data.times.shape
    print(f"\n{problems} problems x {labels} labels, {len(data.rows)} rows, columns of {size / 1e9:.2f} GB")
    costs |= told(statistics(data), given.only)
    over = report(costs, told(commands(data), given.only))
    print("PASS" if not over else f"over: {'; '.join(over)}", flush=True)
    sys.exit(bool(over))


if __name__ == "__main__":
    main()
