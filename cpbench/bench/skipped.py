"""Pairs that a run skips: of solvers that are not installed, or whose route turned out to be closed.

A pair that cannot be run says nothing about a solver. Unless the solver was named by the user, such a pair has no row
but is counted under its reason, in `left_out` of the results: a list of `status` (missing, licence, unsupported),
`node` (of the problems), `reason`, `solvers` (name: pairs) and the `keys` of the pairs, which a later command tries
again only with `--rerun`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Row
from cpbench.bench.results.store import Store
from cpbench.verification import Status

MISSING, LICENCE = "missing", "licence"
AGAIN: Mapping[str, tuple[str, ...]] = {"failed": (LICENCE, MISSING), "all": (LICENCE, MISSING, "unsupported")}
"""Statuses of skipped pairs that `--rerun` tries again."""


def planned(store: Store, pairs: Sequence[Pair], rerun: str) -> list[Pair]:
    """Return the pairs without those that an earlier command skipped and whose solver is not named now."""
    again = AGAIN.get(rerun, ())
    out = {key for entry in _entries(store) if entry["status"] not in again for key in entry["keys"]}
    return [pair for pair in pairs if pair.named or pair.key not in out]


def statuses(store: Store) -> dict[str, str]:
    """Return the statuses of skipped pairs by key, as rows would have them."""
    absent = str(Status.UNAVAILABLE)
    return {
        key: absent if entry["status"] in (MISSING, LICENCE) else entry["status"]
        for entry in _entries(store)
        for key in entry["keys"]
    }


def settle(store: Store, pairs: Iterable[Pair], absent: Mapping[str, str]) -> None:
    """Remove the rows of `pairs` that could not be run, of solvers that were not named, from the results; note why.

    absent : how to install the solvers for which no pair was planned, by name.
    """
    mine = {pair.key for pair in pairs}
    unnamed = {pair.key for pair in pairs if not pair.named}
    found: dict[tuple[str, str, str], dict[str, Any]] = {}

    def note(status: str, node: str, reason: str, solver: str, keys: Sequence[str], count: int = 1) -> None:
        entry = found.setdefault((status, node, _pattern(reason)), _entry(status, node, reason))
        entry["solvers"][solver] = entry["solvers"].get(solver, 0) + count
        entry["keys"] += keys

    for entry in _entries(store):
        kept = [key for key in entry["keys"] if key not in mine]
        if kept:
            found[entry["status"], entry["node"], _pattern(entry["reason"])] = {**entry, "keys": kept}
    for solver, hint in absent.items():
        note(MISSING, "", hint, solver, [], 0)
    gone: list[str] = []
    for row in store.rows() if unnamed else ():
        status = _status(row) if row.key in unnamed else ""
        if status:
            _, _, reason = (row.message or "").partition(": ")
            note(status, row.node if status == Status.UNSUPPORTED else "", reason, row.solver, [row.key])
            gone.append(row.key)
    store.withdraw(gone)
    store.set_meta(left_out=[found[key] for key in sorted(found)])


def _entries(store: Store) -> list[Any]:
    return list(store.meta().get("left_out", []))


def _entry(status: str, node: str, reason: str) -> dict[str, Any]:
    return {"status": status, "node": node, "reason": reason, "solvers": {}, "keys": []}


def _status(row: Row) -> str:
    """Return why a row is skipped, '' where it is kept: that of a broken solver is, so that somebody mends it."""
    if row.status == Status.UNSUPPORTED:
        return str(Status.UNSUPPORTED)
    state = (row.message or "").partition(":")[0]
    return state if row.status == Status.UNAVAILABLE and state in (MISSING, LICENCE) else ""


def _pattern(reason: str) -> str:
    """Return a reason without its numbers, so that one cause has one entry."""
    return re.sub(r"\d[\d.e+-]*", "#", reason)
