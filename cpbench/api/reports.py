"""The report of a results file: what stands in it is read and brought to the pages and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.analysis import table as rows_of
from cpbench.analysis.run_table import RunTable
from cpbench.bench import history
from cpbench.bench.results.store import Store
from cpbench.generators.collection import address_text
from cpbench.report import documents, page, row_files
from cpbench.report.run import ProblemOrigin, assembled
from cpbench.report.text import cut

if TYPE_CHECKING:
    import pandas as pd

ABOUT = 400
"""Characters of a source or a licence."""


def write_report(
    store: Store,
    folder: Path,
    title: str,
    run: RunTable | None = None,
    *,
    csv: bool | None = True,
    publishable: bool = False,
    count_stationary: bool = False,
) -> tuple[list[Path], list[str]]:
    """Write report.md, report.html, figures and results.csv; returns the first two, and what was left out.

    Parameters
    ----------
    run : the rows of the store, read here where they are not at hand. csv : whether the rows are written; None where
        they are not too many.
    publishable : whether solvers whose figures must not be published are left out of everything.
    count_stationary : whether answers that are stationary only are among the solved.
    """
    run = RunTable.of(store.table(), store.meta()) if run is None else run
    many = csv is None and len(run.rows) > row_files.MOST
    notes = [f"no results.csv: {len(run.rows)} rows are more than {row_files.MOST}; --csv writes it all the same"]
    has_csv = csv is not False and not many
    chosen = {"publishable": publishable, "count_stationary": count_stationary, "has_csv": has_csv}
    origins, histories = _origins(store, run.stored), history.table(store.histories())
    whole = assembled(run, folder, histories, origins=origins, address=address_text, **chosen)
    whole = replace(whole, meta={**whole.meta, "sha256": store.sha256()})
    markdown, text = documents.write(whole, title)
    html = page.write(whole, text)
    if has_csv:
        row_files.write(whole.timed, folder / "results.csv")
    return [markdown, html], notes if many else []


def _origins(store: Store, table: pd.DataFrame) -> dict[str, ProblemOrigin]:
    """Return source and licence of the families of problems, each text once, as their files gave them to the run."""
    facts = store.features()
    by_family: dict[str, list[Mapping[str, Any]]] = {}
    rows = rows_of.normalised(table, ("family",)).drop_duplicates("fingerprint")
    for fingerprint, family in zip(rows["fingerprint"], rows["family"], strict=True):
        if fingerprint in facts:
            by_family.setdefault(str(family), []).append(facts[fingerprint])
    return {
        family: ProblemOrigin(_joined(infos, "source", "citation"), _joined(infos, "licence"))
        for family, infos in by_family.items()
    }


def _joined(infos: Sequence[Mapping[str, Any]], *names: str) -> str:
    return cut("; ".join(dict.fromkeys(info[name] for info in infos for name in names if name in info)), ABOUT)
