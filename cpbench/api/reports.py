"""The report of a results file: what stands in it is read and brought to the pages and figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.api.start_answers import start_answers
from cpbench.api.thumbnails import Thumbnails
from cpbench.bench import history
from cpbench.bench.results.store import Store
from cpbench.generators.collection import address_text
from cpbench.report import row_files
from cpbench.report.folder import write_folder

if TYPE_CHECKING:
    import pandas as pd

    from cpbench.analysis.comparison import Comparison


def write_report(
    store: Store,
    folder: Path,
    title: str,
    table: pd.DataFrame | None = None,
    *,
    data: Sequence[str] | None = ("csv",),
    comparison: Comparison | None = None,
    publishable: bool = False,
    with_imported: bool = False,
    count_stationary: bool = False,
) -> tuple[list[Path], list[str]]:
    """Write Markdown, the offline page, figures and rows into a folder; returns the files, and what was left out.

    Parameters
    ----------
    table : the rows of the store, read here where they are not at hand. data : formats of the rows; None for all that
        are not too large. The other ones are those of `report.folder.write_folder`.
    """
    rows = store.table() if table is None else table
    forms, told = row_files.chosen(len(rows), data)
    places = {address: address_text(address) for address in rows["address"].unique()}
    files = write_folder(
        rows.assign(address=rows["address"].map(places)),
        store.meta(),
        folder,
        title,
        history.table(store.histories()),
        comparison=comparison,
        data=forms,
        thumbnails=Thumbnails(store, rows),
        answers=start_answers(store, rows),
        publishable=publishable,
        with_imported=with_imported,
        count_stationary=count_stationary,
    )
    return list(files), list(told)
