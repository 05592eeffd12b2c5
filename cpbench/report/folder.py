"""The folder of a report: the Markdown with its figures and rows, and the page, of one assembled run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from cpbench.report import markdown
from cpbench.report.html import page
from cpbench.report.run import assembled

if TYPE_CHECKING:
    from cpbench.analysis.comparison import Comparison


def write_folder(
    table: pd.DataFrame,
    meta: Mapping[str, Any],
    folder: str | Path,
    title: str,
    histories: pd.DataFrame | None = None,
    *,
    publishable: bool = False,
    with_imported: bool = False,
    comparison: Comparison | None = None,
) -> tuple[Path, Path]:
    """Write report.md and report.html; gives both paths. The parameters are those of `markdown.write_report`."""
    run = assembled(table, meta, Path(folder), histories, publishable=publishable, with_imported=with_imported)
    return markdown.write(run, title, comparison), page.write(run, title)
