"""Where the problems of a results file were published: what their files say, read again at their addresses."""

from __future__ import annotations

from collections.abc import Mapping

from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError


def citations(store: Store) -> dict[str, str]:
    """Citation by family, of the families whose files are still there, the same, and have one.

    One problem is read of each file of a family; what the files of one family say is joined.
    """
    formats: Mapping[str, str] = store.meta().get("formats", {})
    found: dict[str, list[str]] = {}
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
        told = problem.info.citation
        if problem.fingerprint == row.fingerprint and told and told not in found.setdefault(family, []):
            found[family].append(told)
    return {family: "; ".join(told) for family, told in found.items() if told}
