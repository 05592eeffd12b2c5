"""Rows of results as CSV, written whole or not at all.

Every digit is kept. Some columns of the rows, sorted, are a text for version control.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import lru_cache, partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pandas as pd

from cpbench.errors import FormatError, UnknownName
from cpbench.foundation.text import cell
from cpbench.storage.base import write_atomic
from cpbench.verification import Status

MOST = 200_000
"""Rows up to which a report has them unasked: 180 MB."""
DECADE = "decade"
"""A column beside those of the rows: the power of ten at or above the error."""
_REMEMBERED = 10_000
"""Texts that are made safe once."""


def write(rows: pd.DataFrame, path: Path, *, force: bool = True) -> None:
    """Write the rows into a .csv file; raises FormatError."""
    if path.suffix != ".csv":
        raise FormatError(path, "", f"unknown suffix '{path.suffix}'; use .csv")
    write_atomic(path, partial(write_csv, rows), force=force)


def selected(rows: pd.DataFrame, names: Collection[str]) -> pd.DataFrame:
    """Return these columns of the rows, sorted by them, so that equal outcomes are equal lines; raises UnknownName.

    >>> rows = pd.DataFrame({"problem": ["q", "p"], "status": "solved", "error": [2e-9, 3e-4], "tolerance": 1e-3})
    >>> selected(rows, ["problem", "decade"]).values.tolist()
    [['p', '<=1e-03'], ['q', '<=1e-03']]
    """
    columns = [*map(str, rows.columns), DECADE]
    for name in names:
        if name not in columns:
            raise UnknownName("column of the rows", name, columns)
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


def write_csv(rows: pd.DataFrame, file: BinaryIO) -> None:
    """Write rows as pandas does; cells of text, which others wrote, are made safe first."""
    safe = lru_cache(_REMEMBERED)(cell)  # most texts repeat
    texts = {
        str(name): [safe(value) if isinstance(value, str) else value for value in values]
        for name, values in rows.select_dtypes(["object", "str"]).items()
    }
    rows.assign(**texts).to_csv(file, index=False, lineterminator="\n")
