"""Merges results files: shards of a plan, or comparable runs.

Times with other limits, machines or versions do not compare. Such files are refused, or, with `mixed`, the rows
concerned carry the flag `mixed` and the meta table names the differences.
"""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from operator import attrgetter
from pathlib import Path
from typing import Any

from cpbench.bench.results.limits import LIMITS, limits_of
from cpbench.bench.results.rows import Row
from cpbench.bench.results.schema import MEASURED
from cpbench.bench.results.store import Store
from cpbench.errors import StoreError

FLAG = "mixed"
PREFER = ("first", "last")
"""Which of two rows of one key is taken. The better one is not an option: it would favour solvers that ran twice."""
_TABLES = {"refused", "references"}
"""Facts of a run that have tables of their own."""
_OF_ALL_ROWS = {"contradictions"}
"""Facts of all rows together, which have to be found again."""
_measured = attrgetter(*(name for name in MEASURED if name != "sealed_by"))
_PASSING = {"load"}
"""Momentary entries of a machine's description."""


@dataclass(frozen=True)
class Disagreement:
    """A difference between files that must not be: `what` differs, and the rows that it affects."""

    what: str
    column: str = ""
    value: Any = None

    def affects(self, row: Row) -> bool:
        """Return whether it affects a finished row; a difference without a column affects every row."""
        return row.status != "not_run" and (not self.column or getattr(row, self.column) == self.value)


@dataclass
class _Facts:
    """Facts that must agree, as one file has them."""

    limits: dict[str, set[tuple[Any, ...]]] = field(default_factory=dict)
    tolerances: dict[str, set[float]] = field(default_factory=dict)
    measures: dict[str, set[str]] = field(default_factory=dict)
    versions: dict[str, set[str]] = field(default_factory=dict)
    fingerprints: dict[str, set[str]] = field(default_factory=dict)
    machines: set[str] = field(default_factory=set)
    cpbench: set[str] = field(default_factory=set)


def merge(inputs: Sequence[str | Path], output: str | Path, *, mixed: bool = False, prefer: str = "") -> list[str]:
    """Write the rows of all inputs, with their answers and histories, to a new results file; return the differences.

    Rows of one key: the one that was run is taken; of two that were run, by `prefer` (first, last) the one of the
    first or the last file. Inputs stay as they are, and the output is there when it is complete.

    The seals of all inputs are checked, and every row is sealed anew.

    Raises SealError when a row is not as a run wrote it; StoreError when the files do not compare and `mixed` is not
    set, when a key was run twice and `prefer` is not set, and when the output is there already.
    """
    target = Path(output)
    for path in (target, Path(f"{target}-wal"), Path(f"{target}-journal")):
        if path.exists():
            raise StoreError(f"{path}: exists; merge into a file that is not there yet, or remove it")
    with ExitStack() as opened:
        stores = [opened.enter_context(Store(path)) for path in inputs]
        for store in stores:
            store.audit().require()
        facts = [_facts(store) for store in stores]
        differences = [
            d for pair in itertools.combinations(range(len(stores)), 2) for d in _between(stores, facts, *pair)
        ]
        if differences and not mixed:
            more = f" (and {len(differences) - 1} more differences)" if len(differences) > 1 else ""
            raise StoreError(f"{differences[0].what}{more}; --mixed merges them all the same, and marks the rows")
        chosen = _chosen(stores, prefer)
        partial = target.with_name(f".{target.name}.partial")
        _remove(partial)
        kinds = sorted({d.what for d in differences})
        try:
            with Store(partial, create=True) as merged:
                merged.add(_rows(stores, chosen, differences))
                for index, store in enumerate(stores):
                    merged.add_kept(item for item in store.kept() if chosen[item[0]] == index)
                    merged.note_proved_problems(store.proved_problems())
                leading = sorted(range(len(stores)), key=lambda i: not facts[i].machines)
                _merge_facts(merged, [stores[i] for i in leading], kinds)
                merged.end()
                merged.settle()
            _sync(partial)
            partial.replace(target)
        finally:
            _remove(partial)
    return kinds


def _facts(store: Store) -> _Facts:
    facts, ran = _Facts(), False
    judged = False
    for row in store.rows():
        judged = judged or row.status != "not_run"
        facts.tolerances.setdefault(row.set, set()).add(row.tolerance)
        facts.measures.setdefault(row.set, set()).add(row.measure or "")
        facts.fingerprints.setdefault(row.problem, set()).add(row.fingerprint)
        if row.origin:  # made elsewhere, under unknown limits
            continue
        facts.limits.setdefault(row.set, set()).add(limits_of(row))
        if row.version:
            facts.versions.setdefault(row.label, set()).add(row.version)
        ran = ran or row.status != "not_run"
    meta = store.meta()
    if judged:
        facts.cpbench = {str(meta.get("cpbench", ""))}
    if ran:  # a shard without rows has not been run on any machine
        descriptions = list(store.machines().values()) or [meta.get("machine") or {}]
        facts.machines = {_machine(description) for description in descriptions}
    return facts


def _machine(description: Mapping[str, Any]) -> str:
    return json.dumps({k: v for k, v in description.items() if k not in _PASSING}, sort_keys=True)


def _between(stores: Sequence[Store], facts: Sequence[_Facts], i: int, j: int) -> Iterator[Disagreement]:
    """Yield the differences between the files i and j."""
    names, (one, other) = f"{stores[i].path} and {stores[j].path}", (facts[i], facts[j])

    def differing(kind: str, a: Iterable[Any], b: Iterable[Any], of: str = "") -> str:
        return f"{names} differ in {kind}{of and ' of '}{of}: {_listed(a)} and {_listed(b)}"

    for name in sorted(one.limits.keys() & other.limits.keys()):
        of = f"set '{name}'" if name else ""
        if one.limits[name] != other.limits[name]:
            kind, a, b = _limit_that_differs(one.limits[name], other.limits[name])
            yield Disagreement(differing(kind, a, b, of), "set", name)
        if not one.tolerances[name] & other.tolerances[name]:
            yield Disagreement(differing("tolerance", one.tolerances[name], other.tolerances[name], of), "set", name)
        if not one.measures[name] & other.measures[name]:
            yield Disagreement(differing("measure", one.measures[name], other.measures[name], of), "set", name)
    for label in sorted(one.versions.keys() & other.versions.keys()):
        if one.versions[label] != other.versions[label]:
            yield Disagreement(differing("version", one.versions[label], other.versions[label], label), "label", label)
    for problem in sorted(one.fingerprints.keys() & other.fingerprints.keys()):
        a, b = one.fingerprints[problem], other.fingerprints[problem]
        if not a & b:
            yield Disagreement(differing("fingerprint", a, b, f"problem {problem}"), "problem", problem)
    if one.machines and other.machines and one.machines != other.machines:
        a, b = (_telling(mine, theirs) for mine, theirs in ((one, other), (other, one)))
        yield Disagreement(differing("machine", a, b))
    if one.cpbench and other.cpbench and one.cpbench != other.cpbench:
        yield Disagreement(differing("version", one.cpbench, other.cpbench, "cpbench"))


def _limit_that_differs(a: set[tuple[Any, ...]], b: set[tuple[Any, ...]]) -> tuple[str, set[Any], set[Any]]:
    for k, name in enumerate(LIMITS.values()):
        mine, theirs = ({limits[k] for limits in side} for side in (a, b))
        if mine != theirs:
            return name, mine, theirs
    return "limits", a, b


def _telling(mine: _Facts, theirs: _Facts) -> list[str]:
    """Return the entries of machines that no machine of the other file has."""
    known = [item for text in theirs.machines for item in json.loads(text).items()]
    own = (", ".join(f"{k} {v}" for k, v in json.loads(text).items() if (k, v) not in known) for text in mine.machines)
    return [text for text in own if text] or [f"{len(mine.machines)} kinds"]


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


def _rows(stores: Sequence[Store], chosen: Mapping[str, int], differences: Sequence[Disagreement]) -> Iterator[Row]:
    for index, store in enumerate(stores):
        for row in store.rows():
            if chosen[row.key] != index:
                continue
            affected = any(difference.affects(row) for difference in differences)
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
    merged["seals"] = [
        line if str(store.path) in line else f"{store.path.name}: {line}"
        for store, meta in zip(stores, metas, strict=True)
        for line in meta.get("seals", [])
    ]
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
