"""Rows as CSV against what pandas writes."""

from __future__ import annotations

import io
import time

import numpy as np
import pandas as pd
import pytest
from synthetic_results import suite

from cpbench.analysis import table as rows_of
from cpbench.report import csv_text


def written(rows: pd.DataFrame) -> bytes:
    file = io.BytesIO()
    csv_text.write(rows, file)
    return file.getvalue()


def by_pandas(rows: pd.DataFrame) -> bytes:
    """With texts, one by one, as they may stand in a cell (`tests/unit/test_foreign_input.py` says which may)."""
    texts = [name for name in rows if rows[name].dtype == object or str(rows[name].dtype) == "str"]
    safe = {n: [csv_text.harmless(cell) if isinstance(cell, str) else cell for cell in rows[n]] for n in texts}
    rows = rows.assign(**{str(n): pd.Series(c, index=rows.index, dtype=rows[n].dtype) for n, c in safe.items()})
    rows = rows.rename(columns=lambda name: csv_text.harmless(str(name)))
    return rows.to_csv(index=False, lineterminator="\n").encode()


def awkward(count: int) -> pd.DataFrame:
    """Text with everything that CSV quotes, numbers of every size, missing ones among both."""
    rng = np.random.default_rng(count)
    texts = np.array(["", " a ", "a,b", 'say "so"', "two\nlines", "é 漢 😀", "'", "None", "nan", "=1+1", "\t", None])
    numbers = rng.normal(size=count) * 10.0 ** rng.integers(-320, 300, count)
    numbers[rng.uniform(size=count) < 0.2] = np.nan
    numbers[rng.uniform(size=count) < 0.1] = -np.inf
    return pd.DataFrame(
        {
            "text": texts[rng.integers(len(texts), size=count)],
            "different": [f'{k}, "{k % 3}"' for k in range(count)],
            "a, name": numbers,
            "few": rng.choice([1e-6, 0.1, 1e16, 123456789.0, -0.0, 0.0, np.inf, np.nan], count),
            "\0": [f"{k % 7}\0" * (k % 5) + f"{k}," for k in range(count)],
            "no comma": [f"name {k}" for k in range(count)],
            "whole": rng.integers(-(2**62), 2**62, count),
            "small": rng.integers(3, size=count),
            "true": rng.uniform(size=count) < 0.5,
            "nothing": None,
            "no number": np.nan,
        }
    )


@pytest.mark.parametrize("count", [0, 1, 2, 700, csv_text.LINES + 1])
def test_every_byte_is_what_pandas_writes(count: int) -> None:
    assert written(awkward(count)) == by_pandas(awkward(count))


def test_results_are_written_as_pandas_does() -> None:
    rows = suite(problems=25, labels=14)
    for table in (rows, rows_of.with_time(rows_of.normalised(rows)).assign(ranked=True)):
        assert written(table) == by_pandas(table)


def test_what_is_remembered_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_text, "REMEMBERED", 2)
    assert written(awkward(300)) == by_pandas(awkward(300))


def test_columns_of_other_kinds_are_left_to_pandas() -> None:
    rows = pd.DataFrame(
        {"at": pd.to_datetime(["2026-01-01", None]), "mixed": [1, "a"], "small": np.array([0.1, 2], dtype=np.float32)}
    )
    assert written(rows) == by_pandas(rows)


def test_a_return_in_a_text_is_quoted() -> None:
    """Whatever Python's csv writes of it: readers take one that stands bare for the end of the row."""
    found = pd.read_csv(io.BytesIO(written(pd.DataFrame({"a": ["x\ry", "z"], "b": ["1", "2"]}))))
    assert found["a"].tolist() == ["x\ry", "z"]


@pytest.mark.nightly
def test_many_rows_take_less_time_than_with_pandas() -> None:
    rows = rows_of.with_time(rows_of.normalised(suite(problems=300, labels=30)))

    def spent(write: object) -> float:
        begun = time.process_time()
        assert callable(write)
        write(rows)
        return time.process_time() - begun

    ratios = [spent(written) / spent(by_pandas) for _ in range(5)]
    assert min(ratios) < 0.9
