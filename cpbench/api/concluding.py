"""Notes in a results file, when all its rows are there, the collection that they quote and their contradictions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from cpbench.analysis import contradictions
from cpbench.analysis import table as rows_of
from cpbench.analysis.contradictions import Contradiction
from cpbench.analysis.run_table import META
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench.foundation.extensions import HOOKS, added, hook
from cpbench.foundation.text import counted, on_one_line
from cpbench.generators.collection import catalogue, identity

if TYPE_CHECKING:
    import pandas as pd

LINES = 12
"""The most contradictions that a command prints."""


def conclude(
    store: Store, rows: pd.DataFrame | None = None, say: Callable[[str], None] = lambda line: None
) -> list[Contradiction]:
    """Note the collection and the contradictions in results that are open for writing, and return the latter.

    Parameters
    ----------
    rows : the normalised rows of the store, read here where they are not at hand. say : takes a line for a reader.
    """
    quote_collection(store)
    rows = rows_of.normalised(store.table()) if rows is None else rows
    deeper = "cross_examine" in added(HOOKS)
    conflicts = hook("cross_examine")(store, rows, say) if deeper else list(contradictions.of_claims(rows))
    store.set_meta(**{contradictions.META: [asdict(one) for one in conflicts]})
    return conflicts


def contradiction_lines(contradictions: Sequence[Contradiction]) -> Iterator[str]:
    """Yield the contradictions for a reader, a line each; at most LINES of them. Nothing where there is none."""
    if contradictions:
        yield f"{counted(len(contradictions), 'contradiction')} (rows that cannot all be right):"
        yield from (f"- {on_one_line(str(one))}" for one in contradictions[:LINES])
        if len(contradictions) > LINES:
            yield f"and {len(contradictions) - LINES} more in the report"
        yield ""


def quote_collection(store: Store) -> None:
    """Write into results that are open for writing how many of their problems are of the collection, and its name,
    version and hash; nothing where none are or none are installed."""
    try:
        entries = catalogue()
    except CpbenchError:  # no problems are installed
        return
    listed = {entry.fingerprint for entry in entries}
    fingerprints = {row.fingerprint for row in store.rows()}
    if fingerprints & listed:
        whole = identity(entries)
        store.set_meta(
            **{
                META: {
                    "name": whole.name,
                    "problems": whole.problems,
                    "sha256": whole.digest,
                    "here": len(fingerprints & listed),
                }
            }
        )
