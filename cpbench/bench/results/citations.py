"""Citations of the problems of a results file, read from the problem files."""

from __future__ import annotations

from collections.abc import Mapping

from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError


def citations(store: Store) -> dict[str, str]:
    """Return citations by family, of families whose files still exist, are unchanged, and have one.

    One problem of each file is read; the citations of one family's files are joined.
    """
    formats: Mapping[str, str] = store.meta().get("formats", {})
    citing: dict[str, list[str]] = {}
    seen: set[tuple[str, str]] = set()
    for row in store.rows():
        family, address = row.family or "", row.address
        place = (family, address.partition("::")[0])
        if not family or place in seen:
            continue
        seen.add(place)
        try:
            problem = storage.load(address, format=formats.get(address))
        except CpbenchError:
            continue
        citation = problem.info.citation
        if problem.fingerprint == row.fingerprint and citation and citation not in citing.setdefault(family, []):
            citing[family].append(citation)
    return {family: "; ".join(citations) for family, citations in citing.items() if citations}
