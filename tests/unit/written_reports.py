"""One file of a report of a table, for tests that look at that file alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from cpbench.report import markdown
from cpbench.report.easel import Easel
from cpbench.report.html import page
from cpbench.report.run import assembled


class Undrawn(Easel):
    """Takes figures and draws none, for tests of a report's text: three formats of one take half a second."""

    def draw(self, name: str, make: Callable[..., Any], *given: Any) -> None:
        pass


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
    run = assembled(table, meta, folder, histories, **chosen)
    with markdown.rows_beside(run), markdown.easel_of(run) if drawn else Undrawn(folder) as easel:
        return markdown.write_text(run, easel, title)


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
    return page.write(assembled(table, meta, folder, histories, **chosen), title)
