"""Merges results files: shards of a plan, or comparable runs.

Times with other limits, machines or versions do not compare. Such files are refused, or, with `mixed`, the rows
concerned carry the flag `mixed` and the meta table names the differences.
"""

from __future__ import annotations

import itertools
import os
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from cpbench.bench.results.rows import LIMITS, MEASURED, Row, limits_of
from cpbench.bench.results.store import Store
from cpbench.errors import StoreError

FLAG = "mixed"
PREFER = ("first", "last")
"""Which of two rows of one key is taken. The better one is not an option: it would favour solvers that ran twice."""
_TABLES = {"refused", "references"}
"""Facts of a run that have tables of their own."""
_OF_ALL_ROWS = {"contradictions"}
"""Facts of all rows together, which have to be found again."""
_measured = attrgetter(*MEASURED)
_PASSING = {"load"}
"""Momentary entries of a machine's description."""


class CommonFact(NamedTuple):
    """A fact on which files have to agree: `what`, of the rows with `value` in `column`, or of all rows."""

    what: str
    column: str = ""
    value: str = ""

    def affects(self, row: Row) -> bool:
        """Return whether it is of a finished row."""
        return row.status != "not_run" and (not self.column or getattr(row, self.column) == self.value)

    def __str__(self) -> str:
        named = {"set": f"set '{self.value}'", "problem": f"problem {self.value}", "label": self.value}
        return f"{self.what} of {named[self.column]}" if self.value else self.what


_MACHINE, _CPBENCH = CommonFact("machine"), CommonFact("version of cpbench")
_SHARED = ("tolerance", "measure", "fingerprint")
"""Facts that agree where files have one in common: a part of a plan need not have all of them."""
_Facts: TypeAlias = Mapping[CommonFact, set[Any]]


def merge(inputs: Sequence[str | Path], output: str | Path, *, mixed: bool = False, prefer: str = "") -> list[str]:
    """Write the rows of all inputs, with their answers and histories, to a new results file; return the differences.

    Rows of one key: the one that was run is taken; of two that were run, by `prefer` (first, last) the one of the
    first or the last file. Inputs stay as they are, and the output is there when it is complete.

    Raises StoreError when the files do not compare and `mixed` is not set, when a key was run twice and `prefer` is not
    set, and when the output is there already.
    """
    target = Path(output)
    for path in (target, Path(f"{target}-wal"), Path(f"{target}-journal")):
        if path.exists():
            raise StoreError(f"{path}: exists; merge into a file that is not there yet, or remove it")
    with ExitStack() as opened:
        stores = [opened.enter_context(Store(path)) for path in inputs]
        for store in stores:
            store.require_whole()
        facts = [_facts(store) for store in stores]
        differences = [one for pair in itertools.combinations(range(len(stores)), 2) for one in _between(facts, *pair)]
        kinds = sorted({_told(stores, facts, *one) for one in differences})
        if differences and not mixed:
            first = _told(stores, facts, *differences[0])
            more = f" (and {len(differences) - 1} more differences)" if len(differences) > 1 else ""
            raise StoreError(f"{first}{more}; --mixed merges them all the same, and marks the rows")
        chosen = _chosen(stores, prefer)
        partial = target.with_name(f".{target.name}.partial")
        _remove(partial)
        try:
            with Store(partial, create=True) as merged:
                merged.add(_rows(stores, chosen, {fact for fact, *_ in differences}))
                for index, store in enumerate(stores):
                    merged.add_kept(item for item in store.kept() if chosen[item[0]] == index)
                    merged.note_proved_problems(store.proved_problems())
                leading = sorted(range(len(stores)), key=lambda i: _MACHINE not in facts[i])
                _merge_facts(merged, [stores[i] for i in leading], kinds)
                merged.settle()
            _sync(partial)
            partial.replace(target)
        finally:
            _remove(partial)
    return kinds


def _facts(store: Store) -> _Facts:
    """Return the facts of a file, each with the values that its rows have."""
    facts: dict[CommonFact, set[Any]] = defaultdict(set)
    meta = store.meta()
    for row in store.rows():
        facts[CommonFact("tolerance", "set", row.set)].add(row.tolerance)
        facts[CommonFact("measure", "set", row.set)].add(row.measure or "")
        facts[CommonFact("fingerprint", "problem", row.problem)].add(row.fingerprint)
        if row.status != "not_run" and meta.get("cpbench"):
            facts[_CPBENCH] = {meta["cpbench"]}
        if row.origin:  # made elsewhere, under unknown limits
            continue
        for limit, value in zip(LIMITS.values(), limits_of(row), strict=True):
            facts[CommonFact(limit, "set", row.set)].add(value)
        if row.version:
            facts[CommonFact("version", "label", row.label)].add(row.version)
        if row.status != "not_run" and _MACHINE not in facts:  # a file without results was run on no machine
            machines = list(store.machines().values()) or [meta.get("machine") or {}]
            facts[_MACHINE] = set(map(_entries, machines))
    return facts


def _entries(machine: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return the lasting entries of a machine's description."""
    return tuple(sorted((name, str(value)) for name, value in machine.items() if name not in _PASSING))


def _between(facts: Sequence[_Facts], i: int, j: int) -> Iterator[tuple[CommonFact, int, int]]:
    """Yield the facts on which the files i and j do not agree, with i and j."""
    for fact, one in facts[i].items():
        other = facts[j].get(fact, one)
        agree = bool(one & other) if fact.what in _SHARED else one == other
        if not agree:
            yield fact, i, j


def _told(stores: Sequence[Store], facts: Sequence[_Facts], fact: CommonFact, i: int, j: int) -> str:
    """Return a sentence about a difference."""
    one, other = facts[i][fact], facts[j][fact]
    if fact == _MACHINE:
        one, other = _only_in(one, other), _only_in(other, one)
    return f"{stores[i].path} and {stores[j].path} differ in {fact}: {_listed(one)} and {_listed(other)}"


def _only_in(mine: set[Any], theirs: set[Any]) -> set[str]:
    """Return the entries of machines that no machine of the other file has."""
    known = set(itertools.chain(*theirs))
    own = (", ".join(f"{k} {v}" for k, v in machine if (k, v) not in known) for machine in mine)
    return set(filter(None, own)) or {f"{len(mine)} kinds"}


def _listed(values: Iterable[Any]) -> str:
    return ", ".join(f"{v:.12g}" if isinstance(v, float) else str(v) or "none" for v in sorted(values, key=str))


def _chosen(stores: Sequence[Store], prefer: str) -> dict[str, int]:
    """Return the file from which each key's row is taken."""
    chosen: dict[str, int] = {}
    seen: dict[str, int] = {}
    for index, store in enumerate(stores):
        for row in store.rows():
            key = row.key
            if row.status == "not_run":
                chosen.setdefault(key, index)
                continue
            measured = hash(_measured(row))
            if key not in seen:
                seen[key], chosen[key] = measured, index
            elif seen[key] != measured:
                if prefer not in PREFER:
                    raise StoreError(
                        f"{stores[chosen[key]].path} and {store.path}: {row.label} on {row.problem} was run in "
                        "both; --prefer first or --prefer last says which counts"
                    )
                if prefer == "last":
                    seen[key], chosen[key] = measured, index
    return chosen


def _rows(stores: Sequence[Store], chosen: Mapping[str, int], differing: Iterable[CommonFact]) -> Iterator[Row]:
    for index, store in enumerate(stores):
        for row in store.rows():
            if chosen[row.key] != index:
                continue
            affected = any(fact.affects(row) for fact in differing)
            flags = [flag for flag in (row.flags or "").split(",") if flag]
            yield replace(row, flags=",".join([*flags, FLAG])) if affected and FLAG not in flags else row


def _merge_facts(target: Store, stores: Sequence[Store], differences: Sequence[str]) -> None:
    """Merge facts of the runs: where they differ, those of the first file; every file's own are under `merged`."""
    metas = [store.meta() for store in stores]
    merged: dict[str, Any] = {}
    for meta in reversed(metas):
        merged |= {name: value for name, value in meta.items() if name not in _TABLES | _OF_ALL_ROWS}
    for name in ("solvers", "formats", "files"):
        merged[name] = {k: v for meta in reversed(metas) for k, v in meta.get(name, {}).items()}
    plans = [meta["plan"] for meta in metas if meta.get("plan")]
    if plans and all(_whole(plan) == _whole(plans[0]) for plan in plans):
        merged["plan"] = _whole(plans[0])
    merged["jobs"] = max((meta.get("jobs") or 1 for meta in metas), default=1)
    names = ("command", "date", "cpbench", "seed", "jobs", "machine", "versions", "plan")
    merged["merged"] = [
        {"file": store.path.name, **{name: meta[name] for name in names if name in meta}}
        for store, meta in zip(stores, metas, strict=True)
    ]
    if differences:
        merged[FLAG] = list(differences)
    target.set_meta(**merged)
    read = {row.address for row in target.rows()}
    target.note_files([], {a: r for meta in metas for a, r in meta["refused"] if a not in read}.items())
    for store in stores:
        for host, description in store.machines().items():
            target.note_machine(host, description)
    for store in reversed(stores):
        target.note_features(store.features())
    solves = [solve for store in stores for solve in store.references()]
    target.add_references(sorted(solves, key=lambda solve: str(solve["at"])))


def _whole(plan: Mapping[str, Any]) -> dict[str, Any]:
    """Return the plan that a shard belongs to."""
    return {**plan, "shard": [1, 1], "output": "", "report": None}


def _remove(path: Path) -> None:
    for ending in ("", "-wal", "-shm", "-journal"):
        Path(f"{path}{ending}").unlink(missing_ok=True)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
