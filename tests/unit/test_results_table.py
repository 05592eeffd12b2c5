"""The whole table of a results file against SQLite's own answer to the same question."""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Iterable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cpbench.bench.results import store
from cpbench.bench.results.rows import MEASURED, PLANNED, Row
from cpbench.bench.results.store import Store, read_results

KINDS = {**PLANNED, **MEASURED}


def row(key: str, **given: Any) -> dict[str, Any]:
    return {**dict.fromkeys(KINDS), "key": key, "problem": "p", "label": "s", "status": "solved", "error": 0.0, **given}


def file_of(path: Path, rows: Iterable[Mapping[str, Any]]) -> Path:
    with Store(path, create=True) as made:
        made.add(Row(**row) for row in rows)
    return path


def asked_directly(path: Path) -> pd.DataFrame:
    """The same rows, a Python object a cell, in SQLite's order."""
    with closing(sqlite3.connect(path)) as db, pd.option_context("mode.string_storage", "python"):
        names = ", ".join(f'"{name}"' for name in KINDS)
        found = pd.DataFrame(db.execute(f"SELECT {names} FROM rows ORDER BY problem, label, key"), columns=list(KINDS))
    for name in (name for name, kind in KINDS.items() if kind == "REAL"):
        found[name] = pd.to_numeric(found[name]).astype(float)
    return found.assign(error=found["error"].fillna(math.inf))


def mixed(count: int, seed: int = 1) -> list[dict[str, Any]]:
    """Rows in no order, some of one problem and label, with text of every kind, missing and whole numbers."""
    rng = np.random.default_rng(seed)
    texts = ["", "a", "é 漢", 'say "so", then\n', "tab\tand\0nul", "\\", "\x1f\x7f", "\U0001f600", "</script>", None]
    made = []
    for k in rng.permutation(count).tolist():
        given = {name: texts[int(rng.integers(len(texts)))] for name in ("message", "flags", "family", "options")}
        given |= {name: float(rng.normal()) for name in ("solve", "wall", "tolerance")}
        given |= {"peak": int(rng.integers(2**60)), "memory": 2**53 + 1, "attempts": k % 3, "step": k}
        given |= {"problem": f"p{k % 7}", "label": f"s{k % 3}", "signal": -9 if k % 5 else None, "error": None}
        made.append(row(f"{k:04x}", **given))
    return made


@pytest.mark.parametrize("count", [1, 200, 1200])
def test_every_cell_type_and_place_is_what_sqlite_says(tmp_path: Path, count: int) -> None:
    path = file_of(tmp_path / "r.sqlite", mixed(count))
    pd.testing.assert_frame_equal(read_results(path), asked_directly(path), check_exact=True)


def test_rows_in_order_stay_where_they_are(tmp_path: Path) -> None:
    rows = [row(f"{k:02d}", problem=f"p{k // 4}", label=f"s{k % 2}", start="cold") for k in range(8)]
    ordered = sorted(rows, key=lambda r: (r["problem"], r["label"], r["key"]))
    for name, given in (("a", ordered), ("b", ordered[::-1])):
        path = file_of(tmp_path / name, given)
        pd.testing.assert_frame_equal(read_results(path), asked_directly(path))
        assert read_results(path)["key"].tolist() == [r["key"] for r in ordered]


def test_no_row(tmp_path: Path) -> None:
    found = read_results(file_of(tmp_path / "r.sqlite", []))
    assert list(found) == list(KINDS)
    assert not len(found)


def test_equal_texts_are_one_object(tmp_path: Path) -> None:
    """A table of a million rows has its fingerprints and messages once, not a million times."""
    rows = [row(f"{k:04d}", fingerprint="f" * 32, message="m" * 99, label=f"s{k}") for k in range(1500)]
    found = read_results(file_of(tmp_path / "r.sqlite", rows))
    for name in ("fingerprint", "message", "problem"):
        assert len(set(map(id, found[name].to_numpy(dtype=object)))) == 1


def test_rows_are_read_in_chunks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "CHUNK", 7)
    path = file_of(tmp_path / "r.sqlite", mixed(50))
    pd.testing.assert_frame_equal(read_results(path), asked_directly(path), check_exact=True)
