"""Every statistic of `cpbench.analysis` on a table of a million rows: how long, and how much memory.

    python tests/bench/million_rows.py                               10,000 problems x 100 labels, then 100,000 x 10
    python tests/bench/million_rows.py --problems 2000 --labels 50   smaller
    python tests/bench/million_rows.py --only bands --profile        where one of them spends its time

The table is made up: problems of some 50 families of very different sizes, time steps in sequences; labels of
different speed, growth and reliability; every status; messages with numbers, counters, sizes and limits as a run
writes them. Times of a label grow with a power of the size and end at the limit.

Each statistic runs once in a child process of its own (fork), which has the table and the matrix of times. `seconds`
is the processor time it took there: what it takes on an idle core, whoever else is at work; `wall` is what the clock
said. `more` is what the child's memory grew by, `peak` the most it held, table included. Required are 1 s for the
profile, 20 s for all statistics together, 2 GB for any of them; the last line says PASS or what is over. What other
commands ask of a table stands below, apart.
"""

from __future__ import annotations

import argparse
import cProfile
import gc
import itertools
import json
import os
import pstats
import resource
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import (
    attendance,
    bands,
    baseline,
    best,
    bootstrap,
    data_profiles,
    deadlines,
    failures,
    histories,
    means,
    metrics,
    pairwise,
    profiles,
    reliability,
    scaling,
    sensitivity,
    starts,
    summary,
    timeline,
)
from cpbench.analysis import table as rows_of
from cpbench.analysis.comparison import Side, compare
from cpbench.analysis.experience import experience

PROFILE, ALL, MEMORY = 1.0, 20.0, 2.0
"""Required: seconds, seconds, GB."""
LIMIT = 100.0
FAMILIES = 50
RECORDED, ITERATES = 100_000, 20
"""Rows with histories (of ten labels), and the iterates of each."""


@dataclass(frozen=True)
class Data:
    """What the statistics are given: the group of all rows, its matrix of times, the family of each problem; the same
    rows read as cold and warm ones; two runs; iterates; facts of the problems."""

    rows: pd.DataFrame
    times: pd.DataFrame
    families: pd.Series
    started: pd.DataFrame
    paths: pd.DataFrame
    facts: pd.DataFrame


def make(problems: int, labels: int, seed: int) -> pd.DataFrame:
    """A table as `Store.table` gives it, in order of problem and label."""
    rng = np.random.default_rng(seed)
    weight = rng.pareto(0.8, FAMILIES) + 0.2
    family = np.sort(rng.choice(FAMILIES, problems, p=weight / weight.sum()))
    step = np.arange(problems) - np.searchsorted(family, family)
    contacts = np.maximum(1, np.exp(rng.uniform(0, 5, FAMILIES)[family] + rng.normal(0, 0.3, problems))).astype(int)
    hard = 0.5 * rng.uniform(0, 1, FAMILIES)[family] + 0.5 * rng.uniform(0, 1, problems)
    speed, growth = np.exp(rng.normal(-9, 1.3, labels)), rng.uniform(0.8, 3.0, labels)
    strength, honest = rng.uniform(0.3, 1.1, labels), rng.uniform(0.2, 1.0, labels)

    shape = (problems, labels)
    noise = np.exp(rng.normal(0, 0.5, shape) + rng.normal(0, 0.5, problems)[:, None])
    solve = speed * contacts[:, None] ** growth * noise
    status = np.full(shape, "solved", dtype=object)
    status[rng.uniform(size=shape) < 0.01] = "stationary"
    weak = hard[:, None] > strength * rng.uniform(0.7, 1.3, shape)
    kinds = ["inaccurate", "failed", "max_iter", "crash", "error", "memout", "infeasible"]
    status[weak] = rng.choice(kinds, int(weak.sum()), p=[0.2, 0.3, 0.3, 0.05, 0.1, 0.03, 0.02])
    status[weak & (rng.uniform(size=shape) > honest)] = "wrong"
    status[solve > LIMIT] = "timeout"
    status[:, labels - labels // 20 :][rng.uniform(size=(problems, labels // 20)) < 0.5] = "unsupported"
    status[:, : labels // 30] = "unavailable"
    flat = status.ravel()
    count = flat.size
    answered = np.isin(flat, ["solved", "stationary", "inaccurate", "wrong", "infeasible", "failed", "max_iter"])

    def of_problems(values: Any) -> Any:
        return np.repeat(np.asarray(values, dtype=object), labels)

    def of_labels(values: Any) -> Any:
        return np.tile(np.asarray(values, dtype=object), problems)

    def where_answered(values: Any, other: Any = None) -> Any:
        return np.where(answered, values, other)

    def number(values: Any) -> Any:
        return np.where(answered, values, np.nan)

    number_of = rng.integers(1, 5000, count)
    templates: Mapping[str, str] = {
        "failed": "ray termination at pivot {}",
        "max_iter": "no convergence in {} iterations",
        "crash": "killed by SIGSEGV",
        "error": "LinAlgError: Matrix is singular at pivot {}",
        "memout": "over 4294967296 bytes",
        "timeout": "killed after 100 s",
        "inaccurate": "the energy norm is {}e-5",
        "unsupported": "conversion: M is not symmetric, max|M-M'|/max|M| = {}e-3: use lcp-qp-nonsymmetric",
        "unavailable": "missing: pip install somesolver",
    }
    message = [templates.get(s, "").format(n) for s, n in zip(flat, number_of, strict=True)]
    error = np.full(count, np.inf)
    good = np.isin(flat, ["solved", "stationary"])
    error[good] = 10.0 ** rng.uniform(-12, -6, int(good.sum()))
    poor = np.isin(flat, ["inaccurate", "wrong", "failed", "max_iter"])
    error[poor] = 10.0 ** rng.uniform(-5.9, 1, int(poor.sum()))
    names = [f"solver{k % 40}" + (f"[omega={k // 40}]" if k >= 40 else "") for k in range(labels)]
    inexact = np.arange(labels) % 20 == 7
    names = sorted(name + "@inner8" * int(far) for name, far in zip(names, inexact, strict=True))
    inexact = np.array([name.endswith("@inner8") for name in names])
    seconds = number(solve.ravel())
    return pd.DataFrame(
        {
            "key": [f"{k:032x}" for k in range(count)],
            "problem": of_problems([f"family{f:02d}-{s:05d}" for f, s in zip(family, step, strict=True)]),
            "address": of_problems([f"problems/family{f:02d}.h5#{s}" for f, s in zip(family, step, strict=True)]),
            "fingerprint": of_problems([rng.bytes(16).hex() for _ in range(problems)]),
            "node": "fc",
            "family": of_problems([f"family{f:02d}" for f in family]),
            "sizes": of_problems([json.dumps({"m": 3 * int(n), "nc": int(n)}) for n in contacts]),
            "set": "",
            "solver": of_labels([name.partition("[")[0].partition("@")[0] for name in names]),
            "label": of_labels(names),
            "request": of_labels(np.where(inexact, "inner8", "exact")),
            "options": of_labels([json.dumps({"omega": name}) for name in names]),
            "tolerance": 1e-6,
            "measure": None,
            "start": "cold",
            "sequence": of_problems([f"walk{f:02d}" if f % 2 else "" for f in family]),
            "step": np.repeat(step, labels),
            "seconds": LIMIT,
            "memory": 4 * 2**30,
            "threads": 1,
            "repeats_asked": 3,
            "status": flat,
            "route": where_answered("direct"),
            "kind": where_answered(of_labels(np.where(inexact, "approximate", "equivalent"))),
            "claim": where_answered(np.where(np.isin(flat, ["failed", "max_iter"]), flat, "solved")),
            "error": error,
            "target_error": number(np.where(of_labels(inexact).astype(bool), 1e-9, np.nan)),
            "flags": np.where(rng.uniform(size=count) < 0.01, "direction", ""),
            "message": message,
            "parts": "{}",
            "counters": where_answered([f'{{"iterations": {n}}}' for n in number_of]),
            "wall": number(seconds + 0.01),
            "load": 0.01,
            "convert": number(1e-4),
            "setup": number(0.1 * seconds),
            "solve": seconds,
            "lift": number(1e-5),
            "verify": number(1e-4),
            "cpu": seconds,
            "peak": 10**8,
            "repeats": number(3.0),
            "samples": where_answered([f"[{s}, {1.01 * s}, {1.02 * s}]" for s in seconds]),
            "solve_min": seconds,
            "solve_iqr": number(0.05 * seconds),
            "signal": np.where(flat == "crash", -11.0, np.nan),
            "code": np.nan,
            "version": of_labels(["1.0"] * labels),
            "started": where_answered("cold"),
            "attempts": 1,
            "jobs": number(1.0),
            "host": "here",
            "loadavg": 0.1,
            "reported": np.nan,
            "origin": "",
            "finished": "2026-01-01T00:00:00",
        }
    )


def as_starts(rows: pd.DataFrame) -> pd.DataFrame:
    """The same rows with the later half of the labels read as warm starts of the first half."""
    labels = sorted(set(rows["label"]))
    half = len(labels) // 2
    other = dict(zip(labels[half : 2 * half], labels[:half], strict=True))
    warm = rows["label"].isin(list(other)).to_numpy()
    return rows.assign(
        label=rows["label"].where(~warm, rows["label"].map(other)),
        start=np.where(warm, "previous", "cold"),
        started=rows["started"].where(~warm | (rows["started"] == ""), "previous"),
    )


def as_paths(rows: pd.DataFrame, seed: int) -> pd.DataFrame:
    """Iterates of some labels, as `bench.history.table` gives them."""
    rng = np.random.default_rng(seed)
    labels = [name for name, n in rows[rows_of.solved(rows)]["label"].value_counts().items() if n][:10]
    keys = rows.loc[rows["label"].isin(labels) & rows["solve"].notna(), "key"].to_numpy()[:RECORDED]
    share = np.tile(np.linspace(0, 1, ITERATES + 1)[1:], len(keys))
    return pd.DataFrame(
        {
            "key": np.repeat(keys, ITERATES),
            "time": share,
            "iteration": np.tile(np.arange(ITERATES), len(keys)),
            "told": 0.0,
            "error": 10.0 ** (-10 * share * rng.uniform(0.5, 1, share.size)),
            "share": share,
        }
    )


def statistics(data: Data) -> dict[str, Callable[[], Any]]:
    """What is measured, by name."""
    rows, times, families = data.rows, data.times, data.families
    leading = profiles.performance_profile(times).leading(6)
    return {
        "matrix of times": lambda: rows_of.times(rows),
        "groups": lambda: rows_of.groups(rows),
        "performance profile": lambda: profiles.performance_profile(times),
        "profile: envelope, areas": lambda: _read(profiles.performance_profile(times)),
        "profile of iterations": lambda: profiles.performance_profile(
            metrics.matrix(rows, metrics.metric("iterations", rows)), floor=1.0
        ),
        "profile of memory": lambda: profiles.performance_profile(
            metrics.matrix(rows, metrics.METRICS["memory"]), floor=metrics.MEMORY_FLOOR
        ),
        "data profile": lambda: data_profiles.data_profile(times),
        "data profile, by contact": lambda: data_profiles.data_profile(
            times, units=data_profiles.size_units(rows, "nc")
        ),
        "profiles of 15 pairs of labels": lambda: [
            pairwise.profile_of_two(times, one, other) for one, other in itertools.combinations(leading, 2)
        ],
        "records of all pairs of labels": lambda: pairwise.records(times),
        "leave one out, flips": lambda: pairwise.flips(pairwise.leave_one_out(times)),
        "reversals of 6 labels": lambda: pairwise.reversals(times, leading),
        "virtual best, gaps": lambda: (best.gaps(times), best.choices(times)),
        "times below the floor": lambda: best.floored(times),
        "means": lambda: (means.means(times, limit=LIMIT), means.means(times, limit=LIMIT, common=leading)),
        "sensitivity, order changes": lambda: sensitivity.order_changes(
            found := sensitivity.sensitivity(times, LIMIT), float(found["shift"].iloc[0])
        ),
        "bootstrap of means": lambda: bootstrap.intervals(bootstrap.mean_time(times, 0.1, LIMIT), families),
        "bootstrap of solve rates": lambda: bootstrap.intervals(bootstrap.solve_rate(times), families),
        "bands of profiles": lambda: bands.profile_bands(times, families),
        "reliability": lambda: reliability.reliability(rows),
        "inexact routes": lambda: reliability.inexact_routes(rows),
        "solve counts": lambda: summary.solve_counts(rows, LIMIT),
        "verdicts": lambda: summary.verdicts(rows),
        "nodes": lambda: summary.nodes(rows),
        "families": lambda: summary.families(rows),
        "size ranges": lambda: summary.size_ranges(rows),
        "failures by reason": lambda: failures.failures(rows),
        "refusals by reason": lambda: failures.failures(rows, refused=True),
        "unsolved problems": lambda: failures.unsolved(rows),
        "flagged": lambda: failures.flagged(rows, "direction"),
        "attendance": lambda: (attendance.absences(rows), attendance.attended(rows)),
        "deadlines": lambda: deadlines.deadlines(rows, 1.0),
        "deadlines, histories": lambda: deadlines.deadlines(rows, 1.0, data.paths),
        "deadlines by sequence": lambda: deadlines.deadlines_by_sequence(rows, 1.0),
        "scaling in nc": lambda: scaling.scaling(rows, "nc"),
        "scaling in nnz": lambda: scaling.scaling(rows, "nnz", data.facts),
        "warm over cold": lambda: starts.paired(data.started),
        "gains and losses of warm starts": lambda: (
            starts.gains(found := starts.pairs(data.started)),
            starts.losses(found),
        ),
        "times to an error": lambda: histories.times_to(rows, data.paths, 1e-4),
        "error at a time": lambda: histories.error_at(rows, data.paths, 1.0),
        "work-precision": lambda: histories.work_precision(rows, data.paths),
    }


def commands(data: Data) -> dict[str, Callable[[], Any]]:
    """What other commands than the report ask of a table; not among the statistics, nor in their sum."""
    rows = data.rows
    half = rows[rows["label"].isin(sorted(set(rows["label"]))[::2])].reset_index(drop=True)
    again = half.assign(solve=half["solve"] * np.random.default_rng(1).lognormal(0, 0.02, len(half)))
    return {
        "compare two runs of half": lambda: compare(Side("base", half), Side("new", again)),
        "baseline": lambda: baseline.text(baseline.of(rows)),
        "history of two runs of half": lambda: timeline.timeline([timeline.Run("a", half), timeline.Run("b", again)]),
        "experience, to recommend": lambda: experience(rows, {}),
    }


def _read(profile: profiles.Profile) -> Any:
    return profile.envelope(profile.widest), profile.by_height()


def measured(call: Callable[[], Any]) -> dict[str, Any]:
    """Processor seconds, wall seconds, bytes more and bytes at the peak of a call in a child process."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        try:
            gc.disable()  # else it copies the pages of every object of the parent by counting them
            before = _resident()
            wall, cpu = time.perf_counter(), time.process_time()
            call()
            spent = {"seconds": time.process_time() - cpu, "wall": time.perf_counter() - wall}
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
            told = {**spent, "more": peak - before, "peak": peak}
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
    fingerprints = pd.Index(sorted(set(rows["fingerprint"])))
    facts = pd.DataFrame({"nnz": np.random.default_rng(seed).integers(10, 10**6, problems)}, index=fingerprints)
    families = bootstrap.families_of(rows)
    data = Data(rows, rows_of.times(rows), families, as_starts(rows), as_paths(rows, seed), facts)
    gc.collect()
    gc.freeze()
    return data, first


def told(calls: Mapping[str, Callable[[], Any]], only: str, profile: bool) -> dict[str, dict[str, Any]]:
    """What was measured of the calls with `only` in their name; with `profile` they are profiled here instead."""
    found: dict[str, dict[str, Any]] = {}
    for name, call in calls.items():
        if only not in name:
            continue
        if profile:
            profiler = cProfile.Profile()
            profiler.runcall(call)
            print(f"\n{name}")
            pstats.Stats(profiler).sort_stats("cumulative").print_stats(25)
        else:
            found[name] = measured(call)
    return found


def report(found: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Print the table; what is over."""
    over: list[str] = []
    print(f"{'':32}{'seconds':>9}{'wall':>9}{'more, MB':>10}{'peak, GB':>10}")
    for name, told in found.items():
        if "error" in told:
            print(f"{name:32}{told['error']}")
            over.append(f"{name} failed")
            continue
        print(
            f"{name:32}{told['seconds']:9.2f}{told['wall']:9.2f}{told['more'] / 1e6:10.0f}{told['peak'] / 1e9:10.2f}",
        )
        if told["peak"] > MEMORY * 1e9:
            over.append(f"{name}: {told['peak'] / 1e9:.2f} GB")
    done = [told for told in found.values() if "error" not in told]
    whole = sum(told["seconds"] for told in done)
    print(f"{'all':32}{whole:9.2f}{sum(told['wall'] for told in done):9.2f}")
    profile = sum(found[n].get("seconds", 0.0) for n in ("matrix of times", "performance profile") if n in found)
    if profile:
        print(f"{'profile, with its matrix':32}{profile:9.2f}")
    if profile > PROFILE:
        over.append(f"profile: {profile:.2f} s")
    if whole > ALL:
        over.append(f"all: {whole:.2f} s")
    return over


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int)
    parser.add_argument("--labels", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="Statistics with this in their name.")
    parser.add_argument("--profile", action="store_true", help="Where they spend their time, in this process.")
    given = parser.parse_args()
    shapes = [(given.problems or 10_000, given.labels or 100)]
    if given.problems is None and given.labels is None:
        shapes.append((100_000, 10))
    over: list[str] = []
    for problems, labels in shapes:
        data, found = prepared(problems, labels, given.seed)
        size = data.rows.memory_usage(deep=False).sum() + data.started.memory_usage(deep=False).sum()
        print(f"\n{problems} problems x {labels} labels, {len(data.rows)} rows, columns of {size / 1e9:.2f} GB")
        over += report(found | told(statistics(data), given.only, given.profile))
        print("\nother commands")
        report(told(commands(data), given.only, given.profile))
        del data
        gc.unfreeze()
    print("PASS" if not over else f"over: {'; '.join(over)}")
    sys.exit(bool(over))


if __name__ == "__main__":
    main()
