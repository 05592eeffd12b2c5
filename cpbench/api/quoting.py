"""Quotes the collection in the results of a run: which of their problems are its own, by their fingerprints."""

from __future__ import annotations

from cpbench.analysis.quotation import META
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench.generators.collection import catalogue, identity


def quote_collection(store: Store) -> None:
    """Write into results that are open for writing how many of their problems are of the collection, and its name,
    version and hash; nothing where none are or none are installed."""
    try:
        entries = catalogue()
    except CpbenchError:  # no problems are installed
        return
    own = {entry.fingerprint for entry in entries}
    fingerprints = {row.fingerprint for row in store.rows()}
    if fingerprints & own:
        whole = identity(entries)
        store.set_meta(
            **{
                META: {
                    "name": whole.name,
                    "problems": whole.problems,
                    "sha256": whole.digest,
                    "here": len(fingerprints & own),
                }
            }
        )
