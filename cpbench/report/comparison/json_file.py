"""A comparison as JSON, for programs. `schema` goes up when a key goes or changes its meaning.

    schema            1
    verdict           regressed | inconclusive | same | improved
    base, new         {name, date, cpbench, machine}
    settings          {margin, counter_margin, alpha, same_machine, seed}
    noise             {delta, drift, spread, equal, stray, bias}
    counts            pairs by verdict
    suites            by label: {label, pairs, solved_base, solved_new, both, below, timed, families, ratio, low, high,
                      apart, time, why, regressed, inconclusive, same, improved}
    pairs             {problem, fingerprint, label_base, label_new, solver, request, options, tolerance, start, threads,
                      set, verdict, gate, kind, why, status_base, status_new, error_base, error_new, counters_base,
                      counters_new, time_base, time_new, ratio, low, high, time_verdict, command}
    only_base, only_new   {problem, label, status} of rows without a partner
    changed, notes    texts

`gate` is what decided (status, error, counters, time), `kind` the status or what else got worse. A number that is none
is null, infinite ones are the texts "inf" and "-inf".
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import Any

import pandas as pd

from cpbench.analysis.comparison import Comparison, ComparisonSide, PairVerdict
from cpbench.analysis.comparison.suites import Suite
from cpbench.report.comparison import words

SCHEMA = 1
PAIR = ("problem", "fingerprint", "label_base", "label_new", "solver", "request", "options", "tolerance", "start",
        "threads", "set", "verdict", "gate", "kind", "why", "status_base", "status_new", "error_base", "error_new",
        "counters_base", "counters_new", "time_base", "time_new", "ratio", "low", "high",
        "time_verdict")  # fmt: skip
JSON = ("options", "counters_base", "counters_new")
"""Columns that hold JSON already."""


def document(comparison: Comparison) -> str:
    """Write the whole file."""
    counts = comparison.pairs["verdict"].value_counts()
    noise = comparison.noise
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "verdict": str(comparison.verdict),
        "base": _side(comparison.base),
        "new": _side(comparison.new),
        "settings": asdict(comparison.settings),
        "noise": {name: getattr(noise, name) for name in ("delta", "drift", "spread", "equal", "stray", "bias")},
        "counts": {str(verdict): int(counts.get(str(verdict), 0)) for verdict in PairVerdict},
        "suites": [_suite(suite) for suite in comparison.suites],
        "pairs": _pairs(comparison),
        "only_base": _rows(comparison.only_base),
        "only_new": _rows(comparison.only_new),
        "changed": list(comparison.changed),
        "notes": list(comparison.notes),
    }
    return json.dumps(_valid(document), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _side(side: ComparisonSide) -> dict[str, Any]:
    return {"name": side.name, **{name: side.meta.get(name) for name in ("date", "cpbench", "machine")}}


def _suite(suite: Suite) -> dict[str, Any]:
    fields = asdict(suite)
    counts = fields.pop("counts")
    return {**fields, **{str(verdict): count for verdict, count in counts.items()}}


def _pairs(comparison: Comparison) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for pair in comparison.pairs.to_dict("records"):
        row: dict[str, Any] = {name: _read(pair[name]) if name in JSON else pair[name] for name in PAIR}
        rows.append({**row, "command": words.again(comparison, pair)})
    return rows


def _rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(k): v for k, v in row.items()} for row in table[["problem", "label", "status"]].to_dict("records")]


def _read(text: str) -> Any:
    try:
        return json.loads(text) if text else None
    except ValueError:
        return text


def _valid(value: Any) -> Any:
    """Replace NaN by null and infinities by texts, which JSON does not have; lone surrogates as they are written."""
    if isinstance(value, dict):
        return {str(name): _valid(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_valid(part) for part in value]
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode()
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value
