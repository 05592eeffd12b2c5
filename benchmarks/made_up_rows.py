"""A table of results that nobody measured, of any size, for `million_rows.py`.

Problems of some 50 families of very different sizes, time steps in sequences; labels of different speed, growth and
reliability; every status; messages with numbers, counters, sizes and limits as a run writes them. Times of a label grow
with a power of the size and end at the limit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of

LIMIT = 100.0
FAMILIES = 50
RECORDED, ITERATES = 100_000, 20
"""Rows with histories (of ten labels), and the iterates of each."""


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
            "target_tolerance": number(np.where(of_labels(inexact).astype(bool), 1e-6, np.nan)),
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
            "residual": 0.0,
            "error": 10.0 ** (-10 * share * rng.uniform(0.5, 1, share.size)),
            "share": share,
        }
    )
