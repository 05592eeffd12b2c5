"""One file of a report of a table, for tests that look at that file alone."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pandas as pd
from matplotlib.figure import Figure

from cpbench.analysis.run_table import RunTable
from cpbench.report import documents, page, row_files
from cpbench.report.run import assembled


def write_report(
    table: pd.DataFrame,
    meta: Mapping[str, Any],
    folder: Path,
    title: str,
    histories: pd.DataFrame | None = None,
    *,
    drawn: bool = False,
    **chosen: Any,
) -> Path:
    """report.md and results.csv, and its figures if `drawn`; `chosen` is what `run.assembled` takes."""
    run = assembled(RunTable.of(table, meta), folder, histories, **chosen)
    run.folder.mkdir(parents=True, exist_ok=True)
    row_files.write(run.timed, run.folder / "results.csv")
    with nullcontext() if drawn else patch.object(Figure, "savefig"):  # three formats of one take half a second
        return documents.write(run, title)[0]


def whole(path: Path) -> str:
    """The text of a report.md, and of the details beside it."""
    parts = [path, *sorted(path.parent.glob("details*.md"))]
    return "\n".join(part.read_text(encoding="utf-8") for part in parts)


def write_html(
    table: pd.DataFrame,
    meta: Mapping[str, Any],
    folder: Path,
    title: str,
    histories: pd.DataFrame | None = None,
    **chosen: Any,
) -> Path:
    """report.html; `chosen` is what `run.assembled` takes."""
    run = assembled(RunTable.of(table, meta), folder, histories, **chosen)
    return page.write(run, documents.context(run, title))
