"""Features of the problems of a results file, read again where an older file does not have them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cpbench import storage
from cpbench.bench.planning.features import features
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError


def problem_features(store: Store) -> tuple[dict[str, dict[str, Any]], int]:
    """Return features by fingerprint, and the number of problems without any.

    Where an older file has none, they are measured on the problem at its address, if it still exists unchanged.
    """
    found = store.features()
    addresses = {row.fingerprint: row.address for row in store.rows()}
    formats: Mapping[str, str] = store.meta().get("formats", {})
    lost = 0
    for fingerprint, address in addresses.items():
        if fingerprint in found:
            continue
        try:
            problem = storage.load(address, format=formats.get(address))
        except CpbenchError:
            lost += 1
            continue
        if problem.fingerprint == fingerprint:
            found[fingerprint] = features(problem)
        else:
            lost += 1
    return found, lost
