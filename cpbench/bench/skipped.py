"""Pairs without a row that a run can show: skipped, waiting, or of solvers that could not be run.

A pair is skipped where its solver is not installed, or its route turned out to be closed.

A pair that cannot be run says nothing about a solver. Unless the solver was named by the user, such a pair has no row
but is counted under its reason, in `left_out` of the results: a list of `status` (missing, licence, unsupported),
`node` (of the problems), `reason`, `solvers` (name: pairs) and the `keys` of the pairs, which a later command tries
again only with `--rerun`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from cpbench.bench.planning import grids
from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.results.rows import Row
from cpbench.bench.results.store import Store
from cpbench.foundation.text import counted
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


def statuses_of(path: Path) -> dict[str, str]:
    """Return the status of every row and of every skipped pair of a results file, by key; nothing where there is no
    such file."""
    if not path.exists():
        return {}
    with Store(path) as store:
        return {**statuses(store), **{row.key: row.status for row in store.rows()}}


def gaps(store: Store, assembly: Assembly) -> list[str]:
    """Return what the plan asked for and the results lack; nothing after a complete run."""
    waiting = store.pending() & {pair.key for pair in assembly.pairs}
    rows = [f"{len(waiting)} of {counted(len(assembly.pairs), 'pair')} not run"] if waiting else []
    files = [f"the content of {address} is unknown" for address in assembly.unread[:1]]
    more = [f"and that of {len(assembly.unread) - 1} more files"] if len(assembly.unread) > 1 else []
    return [*rows, *files, *more]


def not_run(store: Store, assembly: Assembly) -> list[str]:
    """Return the solvers that were named and could not be run: those with rows that are `unavailable`, and those that
    no route leads to."""
    status = str(Status.UNAVAILABLE)
    absent: Counter[str] = Counter()
    if store.counts().get(status):
        named = {pair.key for pair in assembly.pairs if pair.named}
        absent = Counter(row.solver for row in store.rows() if row.status == status and row.key in named)
    names = {
        name for part in assembly.parts if part.problem_set.chosen for name in grids.named(part.problem_set.solvers)
    }
    return [
        *(f"{name} ({counted(rows, 'row')} {status})" for name, rows in sorted(absent.items())),
        *(f"{name} (no route)" for name in assembly.idle if name in names),
    ]


def failures(store: Store, run_plan: RunPlan, planned: Sequence[Pair]) -> Counter[str]:
    """Count the planned pairs that ended in a status which the plan calls a failure."""
    if not run_plan.fail_on:
        return Counter()
    keys = {pair.key for pair in planned}
    ended = [*((row.key, row.status) for row in store.rows()), *statuses(store).items()]
    return Counter(status for key, status in ended if key in keys and status in run_plan.fail_on)


def settle(store: Store, pairs: Iterable[Pair], absent: Mapping[str, str]) -> None:
    """Remove the rows of `pairs` that could not be run, of solvers that were not named, from the results; note why.

    absent : how to install the solvers for which no pair was planned, by name.
    """
    mine = {pair.key for pair in pairs}
    unnamed = {pair.key for pair in pairs if not pair.named}
    entries: dict[tuple[str, str, str], dict[str, Any]] = {}

    def note(status: str, node: str, reason: str, solver: str, keys: Sequence[str], count: int = 1) -> None:
        entry = entries.setdefault((status, node, _pattern(reason)), _entry(status, node, reason))
        entry["solvers"][solver] = entry["solvers"].get(solver, 0) + count
        entry["keys"] += keys

    for entry in _entries(store):
        kept = [key for key in entry["keys"] if key not in mine]
        if kept:
            entries[entry["status"], entry["node"], _pattern(entry["reason"])] = {**entry, "keys": kept}
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
    store.set_meta(left_out=[entries[key] for key in sorted(entries)])


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
