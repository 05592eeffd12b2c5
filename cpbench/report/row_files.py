"""Rows of results as CSV, JSON or Parquet, written whole or not at all.

JSON is a list with an object a row, every digit kept: null where there is nothing, "inf" and "-inf" for infinite
numbers, which JSON does not have. Some columns of the rows, sorted, are a text for version control.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pandas as pd

from cpbench.errors import FormatError, UnknownName
from cpbench.foundation.plain_text import cell
from cpbench.storage.base import write_atomic
from cpbench.verification import Status

FORMATS = ("csv", "json", "parquet")
MOST = {"csv": 200_000, "json": 20_000, "parquet": 200_000}
"""Rows up to which a report has them in a format unasked: 180 MB of CSV, 40 MB of JSON; Parquet is made in a second."""
DECADE = "decade"
"""A column beside those of the rows: the power of ten at or above the error."""
_CHUNK = 10_000
_REMEMBERED = 10_000
"""Texts that are made safe once."""
_NO_PARQUET = "Parquet needs pyarrow: pip install 'cpbench[arrow]'"


def write(rows: pd.DataFrame, path: Path, *, force: bool = True) -> None:
    """Write the rows in the format of the suffix; raises FormatError."""
    put = _PUT.get(path.suffix.removeprefix("."))
    if put is None:
        raise FormatError(path, "", f"unknown suffix '{path.suffix}'; use .csv, .json or .parquet")
    if put is _parquet and not _has_parquet():
        raise FormatError(path, "", _NO_PARQUET)
    write_atomic(path, partial(put, rows), force=force)


def selected(rows: pd.DataFrame, names: Collection[str]) -> pd.DataFrame:
    """Return these columns of the rows, sorted by them, so that equal outcomes are equal lines; raises UnknownName.

    >>> rows = pd.DataFrame({"problem": ["q", "p"], "status": "solved", "error": [2e-9, 3e-4], "tolerance": 1e-3})
    >>> selected(rows, ["problem", "decade"]).values.tolist()
    [['p', '<=1e-03'], ['q', '<=1e-03']]
    """
    known = [*map(str, rows.columns), DECADE]
    for name in names:
        if name not in known:
            raise UnknownName("column of the rows", name, known)
    table = rows.assign(**{DECADE: _decades(rows)}) if DECADE in names else rows
    return table[list(names)].sort_values(list(names), kind="stable", ignore_index=True)


def _decades(rows: pd.DataFrame) -> list[str]:
    """Return the power of ten at or above each error; of an answer within its tolerance only that it is, as rounding
    decides how far; nothing where a solver gave up."""
    texts: list[str] = []
    for error, tolerance, status in rows[["error", "tolerance", "status"]].itertuples(index=False, name=None):
        if pd.isna(error) or status in (Status.FAILED, Status.ERROR):
            texts.append("")
        elif error <= tolerance:
            texts.append(f"<={tolerance:.0e}")
        else:
            texts.append(f"{10.0 ** np.ceil(np.log10(error) - 1e-12):.0e}")
    return texts


def chosen(count: int, requested: Collection[str] | None = None) -> tuple[list[str], list[str]]:
    """Choose the formats in which a report of `count` rows has them, with a line on each that is left out.

    `asked` : of FORMATS, and CSV with them as far as it fits; None for all that fit.

    >>> chosen(1000, ["json"]), chosen(10**6, ["json"])
    ((['csv', 'json'], []), (['json'], []))
    """
    named = FORMATS if requested is None else requested
    formats = [name for name in FORMATS if (name in named or (name == "csv" and count <= MOST[name]))]
    notes: list[str] = []
    for name in [name for name in formats if requested is None and count > MOST[name]]:
        formats.remove(name)
        notes.append(
            f"no results.{name}: {count} rows are more than {MOST[name]}; --data {name} writes it all the same"
        )
    if "parquet" in formats and not _has_parquet():
        formats.remove("parquet")
        notes.append(f"no results.parquet: {_NO_PARQUET}")
    return formats, notes


def _has_parquet() -> bool:
    try:
        import pyarrow  # noqa: F401  # pyright: ignore[reportMissingImports, reportUnusedImport]
    except ImportError:
        return False
    return True


def write_csv(rows: pd.DataFrame, file: BinaryIO) -> None:
    """Write rows as pandas does; cells of text, which others wrote, are made safe first."""
    safe = lru_cache(_REMEMBERED)(cell)  # most texts repeat
    texts = {
        str(name): [safe(value) if isinstance(value, str) else value for value in values]
        for name, values in rows.select_dtypes(["object", "str"]).items()
    }
    rows.assign(**texts).to_csv(file, index=False, lineterminator="\n")


def _parquet(rows: pd.DataFrame, file: BinaryIO) -> None:
    rows.to_parquet(file, index=False, engine="pyarrow")


def _json(rows: pd.DataFrame, file: BinaryIO) -> None:
    between = b"[\n"
    for start in range(0, len(rows), _CHUNK):
        for row in rows.iloc[start : start + _CHUNK].to_dict("records"):
            values = {str(name): _valid(value) for name, value in row.items()}
            file.write(between + json.dumps(values, ensure_ascii=False, allow_nan=False).encode())
            between = b",\n"
    file.write(b"[]\n" if between == b"[\n" else b"\n]\n")


def _valid(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return None if value is pd.NA or value is pd.NaT else value


_PUT: Mapping[str, Callable[[pd.DataFrame, BinaryIO], None]] = {
    "csv": write_csv,
    "json": _json,
    "parquet": _parquet,
}
