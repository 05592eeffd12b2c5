"""Baselines as files: read with the line of every mistake, written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from cpbench.analysis import baseline
from cpbench.errors import FormatError
from cpbench.storage.base import write_atomic

SUFFIX = ".csv"


def read(path: str | Path) -> pd.DataFrame:
    """Read the lines of a baseline; raises FormatError."""
    try:
        content = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise FormatError(
            path, "", f"no such baseline; make one with: cpbench results baseline RESULTS -o {path}"
        ) from None
    except OSError as cause:
        raise FormatError(path, "", f"cannot be read ({cause.strerror or cause})") from None
    except UnicodeDecodeError as cause:
        line = Path(path).read_bytes()[: cause.start].count(b"\n") + 1
        raise FormatError(path, f"line {line}", "is not UTF-8 text") from None
    return baseline.parse(content, str(path))


def table(path: str | Path, like: pd.DataFrame | None = None) -> pd.DataFrame:
    """Read a baseline in the columns of a table of results, without times; `like` : what it will be compared with
    (see `baseline.as_table`).
    """
    return baseline.as_table(read(path), like)


def write(path: str | Path, lines: pd.DataFrame) -> None:
    """Write a baseline, whole or not at all; raises FormatError."""
    write_atomic(Path(path), baseline.text(lines).encode(), force=True)
