"""The report that a bundle may carry."""

from __future__ import annotations

from pathlib import Path

from cpbench.analysis.run_table import RunTable
from cpbench.bench import history
from cpbench.bench.results.store import Store


def write_report(results: Path, folder: Path, title: str) -> object:
    """Write the report of a results file into a folder, without what needs the files of its problems."""
    from cpbench.report.folder import write_folder

    with Store(results) as store:
        run = RunTable.of(store.table(), store.meta())
        return write_folder(run, folder, title, history.table(store.histories()))
