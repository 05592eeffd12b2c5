"""Merges results files: shards of a plan, or runs that compare.

Times with other limits, machines or versions do not compare: such files are refused, with the first difference.
"""

from __future__ import annotations

import itertools
import os
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from operator import attrgetter
from pathlib import Path
from typing import Any, TypeAlias

from cpbench.bench.results.rows import LIMITS, MEASURED, limits_of
from cpbench.bench.results.store import Store
from cpbench.errors import StoreError

_TABLES = {"refused", "references"}
"""Facts of a run that have tables of their own."""
_OF_ALL_ROWS = {"contradictions"}
"""Facts of all rows together, which have to be found again."""
_measured = attrgetter(*MEASURED)
_PASSING = {"load"}
"""Momentary entries of a machine's description."""
_SHARED = ("tolerance", "measure", "fingerprint")
"""Beginnings of facts that agree where files have a value in common: a part of a plan need not have all of them."""
_Facts: TypeAlias = Mapping[str, set[Any]]
"""What files have to agree on, as `timeout of set 'small'`, with the values that rows of a file have."""


def merge(inputs: Sequence[str | Path], output: str | Path) -> None:
    """Write the rows of all inputs, with their answers and histories, to a new results file.

    Of the rows of one key the one that was run is taken. Inputs stay as they are, and the output is there when it is
    complete.

    Raises StoreError when the files do not compare, when a key was run twice, and when the output is there already.
    """
    target = Path(output)
    for path in (target, Path(f"{target}-wal"), Path(f"{target}-journal")):
        if path.exists():
            raise StoreError(f"{path}: exists; merge into a file that is not there yet, or remove it")
    with ExitStack() as opened:
        stores = [opened.enter_context(Store(path)) for path in inputs]
        for store in stores:
            store.require_whole()
        for (one, its), (other, others) in itertools.combinations([(store, _facts(store)) for store in stores], 2):
            _require_comparable(one, its, other, others)
        chosen = _chosen(stores)
        partial = target.with_name(f".{target.name}.partial")
        _remove(partial)
        try:
            with Store(partial, create=True) as merged:
                merged.add(row for i, store in enumerate(stores) for row in store.rows() if chosen[row.key] == i)
                for index, store in enumerate(stores):
                    merged.add_kept(item for item in store.kept() if chosen[item[0]] == index)
                _merge_facts(merged, sorted(stores, key=lambda store: store.counts().keys() <= {"not_run"}))
                merged.settle()
            _sync(partial)
            partial.replace(target)
        finally:
            _remove(partial)


def _facts(store: Store) -> _Facts:
    facts: dict[str, set[Any]] = defaultdict(set)
    meta = store.meta()
    for row in store.rows():
        of_set = f" of set '{row.set}'" if row.set else ""
        facts[f"tolerance{of_set}"].add(row.tolerance)
        facts[f"measure{of_set}"].add(row.measure or "")
        facts[f"fingerprint of problem {row.problem}"].add(row.fingerprint)
        was_run = row.status != "not_run"
        if was_run and meta.get("cpbench"):
            facts["version of cpbench"] = {meta["cpbench"]}
        for limit, value in zip(LIMITS.values(), limits_of(row), strict=True):
            facts[f"{limit}{of_set}"].add(value)
        if row.version:
            facts[f"version of {row.label}"].add(row.version)
        if was_run and "machine" not in facts:  # a file without results was run on no machine
            machines = list(store.machines().values()) or [meta.get("machine") or {}]
            entries = (item for machine in machines for item in machine.items())
            facts["machine"] = {f"{name} {value}" for name, value in entries if name not in _PASSING}
    return facts


def _require_comparable(one: Store, its: _Facts, other: Store, others: _Facts) -> None:
    """Raise StoreError on the first fact on which two files do not agree."""
    for fact, values in its.items():
        theirs = others.get(fact, values)
        if values != theirs and not (fact.startswith(_SHARED) and values & theirs):
            sides = f"{_listed(values - theirs or values)} and {_listed(theirs - values or theirs)}"
            raise StoreError(f"{one.path} and {other.path} differ in {fact}: {sides}; leave one of them out")


def _listed(values: Iterable[Any]) -> str:
    return ", ".join(f"{v:.12g}" if isinstance(v, float) else str(v) or "none" for v in sorted(values, key=str))


def _chosen(stores: Sequence[Store]) -> dict[str, int]:
    """Return the file from which each key's row is taken."""
    chosen: dict[str, int] = {}
    seen: dict[str, int] = {}
    for index, store in enumerate(stores):
        for row in store.rows():
            if row.status == "not_run":
                chosen.setdefault(row.key, index)
                continue
            measured = hash(_measured(row))
            if row.key not in seen:
                seen[row.key], chosen[row.key] = measured, index
            elif seen[row.key] != measured:
                raise StoreError(
                    f"{stores[chosen[row.key]].path} and {store.path}: {row.label} on {row.problem} was run in both; "
                    "leave one of them out"
                )
    return chosen


def _merge_facts(target: Store, stores: Sequence[Store]) -> None:
    """Merge facts of the runs: where they differ, those of the first file; every file's own are under `merged`."""
    metas = [store.meta() for store in stores]
    merged: dict[str, Any] = {}
    for meta in reversed(metas):
        merged |= {name: value for name, value in meta.items() if name not in _TABLES | _OF_ALL_ROWS}
    for name in ("solvers", "formats"):
        merged[name] = {k: v for meta in reversed(metas) for k, v in meta.get(name, {}).items()}
    plans = [meta["plan"] for meta in metas if meta.get("plan")]
    if plans and all(_whole(plan) == _whole(plans[0]) for plan in plans):
        merged["plan"] = _whole(plans[0])
    merged["kept_all"] = all(meta.get("kept_all") for meta in metas)
    merged["jobs"] = max((meta.get("jobs") or 1 for meta in metas), default=1)
    names = ("command", "date", "cpbench", "seed", "jobs", "machine", "versions", "plan")
    merged["merged"] = [
        {"file": store.path.name, **{name: meta[name] for name in names if name in meta}}
        for store, meta in zip(stores, metas, strict=True)
    ]
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
