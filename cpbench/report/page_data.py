"""The rows of a run as columns of codes and numbers, what the codes mean, and both as one text that may stand in HTML.

Rows are in the order of their groups, so that a group is a stretch of them. Text is kept once and pointed at. Up to
WHOLE rows every pair has all its facts; beyond that, costs and verdicts of all pairs stay, but only KEPT failures have
their messages, parts and commands, and numbers have seven digits.

The text is base64 of gzip of a frame (`frames`): a column is a typed array of the browser. The alphabet of base64 has
no `<`, so that no text of a results file can end the element that holds it.
"""

from __future__ import annotations

import base64
import gzip
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import histories, metrics, starts
from cpbench.analysis import table as rows_of
from cpbench.analysis.bootstrap import families_of
from cpbench.analysis.participation import REFUSED
from cpbench.analysis.profiles import Profile
from cpbench.analysis.table import CHARGED, ResultGroup
from cpbench.foundation import frames
from cpbench.report.documents import FLAGS, KINDS
from cpbench.report.run import Run, group_name_text
from cpbench.report.text import one_line
from cpbench.verification import VERIFIED, Status

Column = np.ndarray[tuple[int], np.dtype[Any]]

SYMBOLS = {
    str(Status.SOLVED): "+",
    str(Status.STATIONARY): "s",
    str(Status.APPROXIMATE): "a",
    str(Status.LOST): "l",
    str(Status.INACCURATE): "i",
    str(Status.WRONG): "W",
    str(Status.UNRESOLVABLE): "r",
    str(Status.INFEASIBLE): "0",
    str(Status.UNBOUNDED): "u",
    str(Status.FAILED): "f",
    str(Status.MAX_ITER): "m",
    str(Status.TIMEOUT): "T",
    str(Status.MEMOUT): "M",
    str(Status.CRASH): "C",
    str(Status.ERROR): "E",
    str(Status.UNSUPPORTED): ".",
    str(Status.UNAVAILABLE): "-",
    str(Status.NOT_RUN): "?",
}
"""What stands for a status in the table of problems and solvers."""
WHOLE = 20_000
"""Rows up to which a page has every pair with all its facts."""
KEPT = 4_000
"""Failures with all their facts on a page of more rows: the first ones of every solver and status."""
ALIGNED = 8
LEVEL = 5
"""Of compression: 6 takes twice as long and saves one byte of thirty."""
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
        "error": rows["error"].to_numpy(dtype=float),
    }
    known = _metrics(rows, whole)
    columns |= {metric.name: metrics.spent(rows, metric) for metric in known}
    detail, texts = _details(run, rows, whole)
    columns |= detail
    if not whole:
        columns = {name: c.astype(np.float32) if c.dtype == np.float64 else c for name, c in columns.items()}
    places = dict(zip(labels, range(len(labels)), strict=True))
    facts = {
        "rows": len(run.rows),
        "whole": whole,
        "kept": int((columns["detail"] > 0).sum()),
        "status": _statuses(),
        "metrics": [
            {"name": m.name, "unit": m.unit, "floor": m.floor, "doc": m.doc, "count": bool(m.counter)} for m in known
        ],
        "problems": _problems(rows, prints),
        "origins": {family: origin._asdict() for family, origin in run.origins.items()},
        "labels": _labels(run, rows, list(labels)),
        "groups": _groups(run, parts, problem, places),
        "texts": texts,
        "notes": {"flags": FLAGS, "kinds": KINDS},
    }
    sizes = [(part["fingerprint"].nunique(), int(rows_of.solved(part).sum())) for _, part in parts]
    facts["first"] = sizes.index(max(sizes)) if sizes else 0
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


def _statuses() -> dict[str, Any]:
    names = list(rows_of.STATUSES)
    return {
        "names": names,
        "verified": [int(name in VERIFIED) for name in names],
        "symbols": [SYMBOLS[name] for name in names],
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
    names = ["request", "label", "solver", "address", "tolerance", "seconds", "start"]
    names += [starts.BEGAN] if starts.BEGAN in kept else []
    commands = [run.again(row) for row in kept[names].to_dict("records")]
    code, texts["command"] = _codes(pd.Series(commands, dtype=object))
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


def _problems(rows: pd.DataFrame, prints: Sequence[str]) -> dict[str, list[Any]]:
    identity = ["fingerprint", "problem", "address", "sizes"]
    first = rows[identity].drop_duplicates("fingerprint").set_index("fingerprint").loc[list(prints)]
    family = families_of(rows).reindex(list(prints)).fillna("")
    names = rows_of.problem_names(first.reset_index())
    return {
        "name": [one_line(name) for name in names],
        "address": [one_line(address) for address in first["address"]],
        "family": family.astype(str).tolist(),
        "sizes": [_sizes(text) for text in first["sizes"]],
    }


def _sizes(text: str) -> dict[str, float]:
    return {str(k): v for k, v in (json.loads(text) if text else {}).items() if isinstance(v, int | float)}


def _labels(run: Run, rows: pd.DataFrame, labels: Sequence[str]) -> dict[str, list[Any]]:
    return {
        "name": [one_line(label) for label in labels],
        "style": [run.line_styles[label] for label in labels],
    }


def _groups(
    run: Run, parts: Sequence[tuple[ResultGroup, pd.DataFrame]], problem: Column, places: Mapping[str, int]
) -> list[dict[str, Any]]:
    """Describe the groups: settings, the stretch of rows of each, its problems in order of name, its labels in order of
    the area under their profile, and the curves of error against time."""
    groups: list[dict[str, Any]] = []
    first = 0
    for group, rows in parts:
        names = pd.DataFrame({"name": rows_of.problem_names(rows).to_numpy(), "fingerprint": rows["fingerprint"].array})
        names["code"] = problem[first : first + len(rows)]
        order = names.drop_duplicates("fingerprint").sort_values(["name", "fingerprint"])
        groups.append(
            {
                "name": group_name_text(run, group),
                "tolerance": group.tolerance,
                "first": first,
                "count": len(rows),
                "problems": [int(code) for code in order["code"]],
                "order": [places[label] for label in _order(rows, run.compared[group].profile)],
                "precision": _precision(rows, run.histories),
            }
        )
        first += len(rows)
    return groups


def _order(rows: pd.DataFrame, profile: Profile) -> list[str]:
    """Return the labels of a group: by the area under their profile those that solve something and are ranked, then the
    others, in order of label."""
    leading = profile.leading(len(profile.curves))
    return [*leading, *sorted(set(rows["label"]) - set(leading))]


def _precision(rows: pd.DataFrame, kept: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the curves of error against median time of a group, from the iterates that were kept."""
    if not len(kept):
        return []
    reached = histories.work_precision(rows, kept)
    drawn = reached[np.isfinite(reached["seconds"]) & (reached["seconds"] > 0)]
    return [
        {
            "label": one_line(label),
            "seconds": [float(f"{value:.4g}") for value in curve["seconds"]],
            "error": curve["error"].tolist(),
        }
        for label, curve in drawn.groupby("label")
    ]


def packed(columns: Mapping[str, Column], facts: Mapping[str, Any]) -> str:
    """Pack columns and facts into a text; integers take the smallest type that holds them.

    >>> columns, facts = unpacked(packed({"x": np.array([1.5]), "k": np.array([7, 300])}, {"title": "</script>"}))
    >>> columns["x"].tolist(), columns["k"].tolist(), columns["k"].dtype.name, facts["title"]
    ([1.5], [7, 300], 'uint16', '</script>')
    """
    typed = {name: values.astype(_smallest_type(values)) for name, values in columns.items()}
    frame = b"".join(frames.parts({"facts": facts}, typed, ALIGNED, finite=True))
    return base64.b64encode(gzip.compress(frame, compresslevel=LEVEL, mtime=0)).decode("ascii")


def unpacked(text: str) -> tuple[dict[str, Column], Any]:
    """Unpack columns and facts from a text, as the page reads them."""
    data = gzip.decompress(base64.b64decode(text))
    header, columns = frames.unpack(data, types=frames.NUMBERS, aligned=ALIGNED)
    return columns, header["facts"]


def _smallest_type(values: Column) -> type[np.number[Any]]:
    if values.dtype.kind == "f":
        return np.float32 if values.dtype == np.float32 else np.float64
    most = int(values.max(initial=0))
    return np.uint8 if most < 2**8 else np.uint16 if most < 2**16 else np.uint32
