"""The folder of a report: the Markdown with its figures, the page and the rows, of one assembled run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from cpbench.analysis.run_table import RunTable
from cpbench.report import documents, page, row_files
from cpbench.report.run import assembled

if TYPE_CHECKING:
    from cpbench.analysis.comparison import Comparison
    from cpbench.report.run import ProblemOrigin


def write_folder(
    given: RunTable,
    folder: str | Path,
    title: str,
    histories: pd.DataFrame | None = None,
    *,
    publishable: bool = False,
    count_stationary: bool = False,
    comparison: Comparison | None = None,
    has_csv: bool = True,
    origins: Mapping[str, ProblemOrigin] | None = None,
    address: Callable[[str], str] = str,
) -> tuple[Path, Path]:
    """Write report.md, report.html and results.csv; gives the paths of the first two.

    Parameters
    ----------
    given : the rows of the results store, with facts of the run by name (command, date, timeout [s], machine, ...).
    histories : judged iterates of recorded solves, in the columns of `analysis.histories`.
    publishable : whether solvers whose figures must not be published are left out of everything.
    count_stationary : whether answers that are stationary only are among the solved.
    comparison : with another run (`analysis.comparison`), a separate section in the Markdown.
    has_csv : whether results.csv is beside it.
    address : what the report says in place of the address of a problem.
    origins : source and licence of the problems, by family.
    """
    chosen = {"publishable": publishable, "count_stationary": count_stationary}
    run = assembled(given, Path(folder), histories, origins=origins, address=address, has_csv=has_csv, **chosen)
    markdown, given_text = documents.write(run, title, comparison)
    html = page.write(run, given_text)
    if has_csv:
        row_files.write(run.timed, run.folder / "results.csv")
    return markdown, html
