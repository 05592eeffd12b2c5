"""The rows of a run as columns of codes and numbers, and what the codes mean.

Rows are in the order of their groups, so that a group is a stretch of them. Text is kept once and pointed at. A row has
its status at the planned tolerance and at other powers of ten. Up to WHOLE rows every pair has all its facts; beyond
that, costs and verdicts of all pairs stay, but only KEPT failures have their messages, parts and commands, and numbers
have seven digits.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import histories, metrics, starts
from cpbench.analysis import table as rows_of
from cpbench.analysis.bootstrap import families_of
from cpbench.analysis.participation import REFUSED
from cpbench.analysis.table import CHARGED, ResultGroup
from cpbench.analysis.tolerances import Ladders, ladders
from cpbench.report.html.embedded_data import Column
from cpbench.report.matrix import SYMBOLS
from cpbench.report.run import Run, group_name_text
from cpbench.report.text import one_line, solve_command
from cpbench.verification import VERIFIED, Status

WHOLE = 20_000
"""Rows up to which a page has every pair with all its facts."""
KEPT = 4_000
"""Failures with all their facts on a page of more rows: the first ones of every solver and status."""
DECADES = range(1, 13)
"""Tolerances 10^-k, besides the planned one, at which the page shows statuses."""
ITERATES = 200_000
"""The most iterates of histories on a page."""
TEXTS = (
    "route",
    "kind",
    "claim",
    "flags",
    "message",
    "counters",
    "parts",
    "version",
    "started",
    "origin",
    "certainty",
    "certificate",
)
PLAIN = ("target_error", "distance", "verify", "wall", "repeats", "solve_iqr", "jobs", "code", "signal")
"""Numbers of a row that are shown and not computed with."""


def columns_of(run: Run) -> tuple[dict[str, Column], dict[str, Any]]:
    """Return columns and facts of a run."""
    parts = run.parts
    rows = _one_after_another([part for _, part in parts]) if parts else run.rows
    whole = len(rows) <= WHOLE
    problem, prints = _codes(rows["fingerprint"])
    label, labels = rows_of.codes(rows["label"])
    status = pd.Categorical(rows["status"], categories=list(rows_of.STATUSES)).codes
    columns: dict[str, Column] = {
        "problem": problem,
        "label": label,
        "status": np.asarray(status, dtype=np.int64),
        "ranked": rows_of.ranked(rows).to_numpy(dtype=np.int64),
        "error": rows["error"].to_numpy(dtype=float),
    }
    judged = ladders(rows)
    columns |= {f"status.{k}": _judged(judged, float(f"1e-{k}")) for k in DECADES}
    known = _metrics(rows, whole)
    columns |= {metric.name: metrics.spent(rows, metric) for metric in known}
    detail, texts = _details(run, rows, whole)
    columns |= detail
    if not whole:
        columns = {name: c.astype(np.float32) if c.dtype == np.float64 else c for name, c in columns.items()}
    columns |= _paths(run, rows)
    places = dict(zip(labels, range(len(labels)), strict=True))
    facts = {
        "rows": len(run.rows),
        "whole": whole,
        "iterates": len(run.histories),
        "kept": int((columns["detail"] > 0).sum()),
        "status": _statuses(),
        "metrics": [
            {"name": m.name, "unit": m.unit, "floor": m.floor, "doc": m.doc, "count": bool(m.counter)} for m in known
        ],
        "problems": _problems(rows, prints),
        "origins": {family: origin._asdict() for family, origin in run.origins.items()},
        "labels": _labels(run, rows, list(labels)),
        "groups": _groups(run, parts, problem, label, places),
        "texts": texts,
    }
    return columns, facts


def _one_after_another(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """Join the rows of all parts, numbered; those of one are not copied."""
    return parts[0].reset_index(drop=True) if len(parts) == 1 else pd.concat(parts, ignore_index=True)


def _codes(values: pd.Series) -> tuple[Column, list[str]]:
    code, names = pd.factorize(values)
    return code, [str(name) for name in names]


def _metrics(rows: pd.DataFrame, whole: bool) -> list[metrics.Metric]:
    """Return the metrics that some solved row has; on a page of many rows the first and the counts of iterations and
    bytes.
    """
    done = rows_of.solved(rows).to_numpy(dtype=bool)
    names = list(metrics.METRICS) if whole else ["time", "iterations", "memory"]
    present = [metrics.METRICS[name] for name in names]
    if whole:
        others = sorted(metrics.counters(rows) - {"iterations"})
        present += [metrics.metric(metrics.COUNTER + name, rows) for name in others]
    return [m for m in present if m.name == "time" or np.isfinite(metrics.spent(rows, m)[done]).any()]


def _judged(judged: Ladders, tolerance: float) -> Column:
    """Return the statuses at a tolerance, as places in STATUSES."""
    names = list(rows_of.STATUSES)
    places = np.array([[names.index(outcome) for outcome in one] for one in judged.outcomes], dtype=np.int64)
    return places.reshape(-1, 4)[judged.code, judged.rungs(tolerance)]


def _statuses() -> dict[str, Any]:
    names = list(rows_of.STATUSES)
    return {
        "names": names,
        "lost": [int(name == Status.LOST) for name in names],
        "verified": [int(name in VERIFIED) for name in names],
        "refused": [int(name in REFUSED) for name in names],
        "symbols": [SYMBOLS[name].strip() for name in names],
    }


def _details(run: Run, rows: pd.DataFrame, whole: bool) -> tuple[dict[str, Column], dict[str, list[str]]]:
    """Return the facts of single pairs: `detail` is 0 for a row without them, else its place, from 1, in all the
    others.
    """
    kept = rows if whole else rows.loc[_chosen(rows)]
    detail = np.zeros(len(rows), dtype=np.int64)
    detail[kept.index.to_numpy()] = np.arange(1, len(kept) + 1)
    columns: dict[str, Column] = {"detail": detail}
    texts: dict[str, list[str]] = {}
    for name in TEXTS:
        code, distinct = _codes(kept[name])
        columns[f"detail.{name}"] = code
        texts[name] = [_digits(text) if name in ("parts", "counters") else text for text in distinct]
    code, texts["command"] = _codes(pd.Series(_commands(run, kept), dtype=object))
    columns["detail.command"] = code
    for name in (*CHARGED, *PLAIN):
        if kept[name].notna().any() if name not in ("code", "signal") else _numeric(kept[name]).notna().any():
            columns[f"detail.{name}"] = _numeric(kept[name]).to_numpy(dtype=np.float32)
    return columns, texts


def _numeric(values: pd.Series) -> pd.Series[float]:
    return pd.to_numeric(values, errors="coerce")


def _chosen(rows: pd.DataFrame) -> pd.Index[Any]:
    """Choose the failures that are kept of many rows: by turns of every solver and status."""
    failed = ~rows_of.met(rows) & ~rows["status"].isin(REFUSED)
    turn = rows.loc[failed, ["label", "status", "node"]].groupby(["label", "status", "node"], sort=False).cumcount()
    return pd.Index(np.sort(turn.sort_values(kind="stable").index[:KEPT].to_numpy()))


def _digits(text: str) -> str:
    """Write JSON of numbers with four digits, as many as are shown."""

    def short(value: Any) -> Any:
        if isinstance(value, float):
            return float(f"{value:.4g}") if math.isfinite(value) else None
        return value

    if not text:
        return ""
    return json.dumps({str(k): short(v) for k, v in json.loads(text).items()}, ensure_ascii=False, allow_nan=False)


def _commands(run: Run, rows: pd.DataFrame) -> list[str]:
    sheets: Mapping[str, Mapping[str, Any]] = run.meta.get("solvers") or {}
    here = str(Path.cwd()) + os.sep
    names = ["origin", "request", "label", "solver", "address", "tolerance", "seconds", "start"]
    names += [starts.BEGAN] if starts.BEGAN in rows else []
    listed = rows[names].to_dict("records")
    return [solve_command(row, sheets.get(str(row["label"]))).replace(here, "") for row in listed]


def _problems(rows: pd.DataFrame, prints: Sequence[str]) -> dict[str, list[Any]]:
    identity = ["fingerprint", "problem", "address", "sizes", "sequence", "step"]
    first = rows[identity].drop_duplicates("fingerprint").set_index("fingerprint").loc[list(prints)]
    family = families_of(rows).reindex(list(prints)).fillna("")
    names = rows_of.problem_names(first.reset_index())
    return {
        "name": [one_line(name) for name in names],
        "address": [one_line(address) for address in first["address"]],
        "family": family.astype(str).tolist(),
        "sizes": [_sizes(text) for text in first["sizes"]],
        "sequence": first["sequence"].tolist(),
        "step": [None if math.isnan(step) else step for step in first["step"]],
    }


def _sizes(text: str) -> dict[str, float]:
    return {str(k): v for k, v in (json.loads(text) if text else {}).items() if isinstance(v, int | float)}


def _labels(run: Run, rows: pd.DataFrame, labels: Sequence[str]) -> dict[str, list[Any]]:
    elsewhere = rows_of.ranked(rows).groupby(rows["label"]).all()
    origin = (rows["origin"] != "").groupby(rows["label"]).any()
    return {
        "name": [one_line(label) for label in labels],
        "look": [run.looks[label] for label in labels],
        "elsewhere": [int(bool(origin[label])) for label in labels],
        "ranked": [int(bool(elsewhere[label])) for label in labels],
    }


def _groups(
    run: Run,
    parts: Sequence[tuple[ResultGroup, pd.DataFrame]],
    problem: Column,
    label: Column,
    places: Mapping[str, int],
) -> list[dict[str, Any]]:
    """Describe the groups: settings, the stretch of rows of each, its problems in order of name, labels in their
    order.
    """
    groups: list[dict[str, Any]] = []
    first = 0
    for group, rows in parts:
        stretch = slice(first, first + len(rows))
        names = pd.DataFrame({"name": rows_of.problem_names(rows).to_numpy(), "fingerprint": rows["fingerprint"].array})
        order = names.assign(code=problem[stretch]).drop_duplicates("fingerprint").sort_values(["name", "fingerprint"])
        most = rows_of.limit(rows)
        kinds = rows_of.label_kinds(rows)
        groups.append(
            {
                "name": group_name_text(run, group),
                "node": group.node,
                "tolerance": group.tolerance,
                "start": group.start,
                "threads": group.threads,
                "limit": most if math.isfinite(most) else None,
                "first": first,
                "count": len(rows),
                "problems": [int(code) for code in order["code"]],
                "labels": sorted(int(code) for code in np.unique(label[stretch])),
                "kinds": {str(places[name]): kind for name, kind in kinds.items()},
            }
        )
        first += len(rows)
    return groups


def _paths(run: Run, rows: pd.DataFrame) -> dict[str, Column]:
    """Return iterates that were better than all before them, of the recorded solves: nothing else shows in any
    figure.
    """
    if not len(run.histories):
        return {}
    place = pd.Series(np.arange(len(rows)), index=rows["key"])
    iterates = histories.charged(rows, run.histories)
    error = iterates["error"].fillna(math.inf)
    before = error.groupby(iterates["key"], sort=False).cummin().groupby(iterates["key"], sort=False).shift()
    iterates = iterates[(error < before.fillna(math.inf)) & np.isfinite(error)]
    if len(iterates) > ITERATES:
        return {}
    row = place[iterates["key"]].to_numpy(dtype=np.int64)
    return {
        "path.row": row,
        "path.seconds": iterates["seconds"].to_numpy(dtype=float),
        "path.error": iterates["error"].to_numpy(dtype=float),
    }
