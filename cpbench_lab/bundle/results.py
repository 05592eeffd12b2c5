"""The results file of a bundle: a fresh one, with rows whose addresses are those of the bundle.

Nothing is copied as pages of the old file: what was once in it and was replaced or deleted may still stand there.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cpbench.bench.planning.plan import Entry, Limits, Pair, Request
from cpbench.bench.results.rows import Row, limits_of
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench_lab.bundle.problems import Place, Unit, unit

NAME = "results.sqlite"
_TABLES = ("refused", "references", "merged", "formats", "files")


def rows_of(store: Store) -> list[Row]:
    """Return all rows of a results file; raises CpbenchError where none was run."""
    rows = list(store.rows())
    if not any(row.status != "not_run" for row in rows):
        raise CpbenchError(f"{store.path}: has no results; make some with: cpbench run PROBLEMS -o {store.path}")
    return rows


def moved(row: Row, place: Place) -> Row:
    """Return the row in the bundle, under the key that its pair has there."""
    new = replace(row, address=place.address)
    return replace(new, key=identity(new)[0])


def identity(row: Row) -> tuple[str, str]:
    """Return the key and label of the pair of a row."""
    limits: tuple[Any, ...] = limits_of(row)  # one that is not known is None
    pair = Pair(
        address=row.address,
        problem=row.problem,
        fingerprint=row.fingerprint,
        node=row.node,
        family=row.family,
        sizes={},
        request=Request(row.request),
        entry=Entry(row.solver, json.loads(row.options or "{}")),
        target="",
        tolerance=float(row.tolerance),
        limits=Limits(*limits),
        start=str(row.start or "cold"),
        set=row.set or "",
        measure=row.measure,
        sequence=row.sequence or "",
        step=int(row.step or 0),
    )
    return pair.key, pair.label


def write(
    store: Store, rows: Sequence[Row], places: Mapping[Unit, Place], target: Path, names: Mapping[str, str]
) -> list[Row]:
    """Write the results file of a bundle; its rows. `names` : of plugin files in the bundle, by where they were."""
    keys: dict[str, str] = {}
    new: list[Row] = []
    for row in rows:
        renamed = moved(row, places[unit(row)])
        keys[row.key] = renamed.key
        new.append(renamed)
    with Store(target, create=True) as target_store:
        target_store.set_meta(**_meta(store, names))
        for host, about in store.machines().items():
            target_store.note_machine(host, about)
        target_store.note_features(store.features())
        target_store.note_files([], store.meta()["refused"])
        target_store.add_references(store.references())
        target_store.add(new)
        target_store.add_kept(sorted((keys[key], *kept) for key, *kept in store.kept()))  # type: ignore[misc]
        inside = {row.fingerprint for row in rows if not places[unit(row)].withheld}
        target_store.note_proved_problems(item for item in store.proved_problems() if item[0] in inside)
        target_store.settle()
    return new


def _meta(store: Store, names: Mapping[str, str]) -> dict[str, Any]:
    meta = store.meta()
    sheets = {label: _placed(sheet, names) for label, sheet in (meta.get("solvers") or {}).items()}
    kept = {name: value for name, value in meta.items() if name not in _TABLES}
    command = meta.get("command", "cpbench run --plan plan.toml")
    return {**kept, "command": command, "formats": {}, "solvers": sheets}


def _placed(sheet: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """Return the description of a solver, with its plugin where it is in the bundle."""
    plugin = str(sheet.get("plugin") or "")
    return {**sheet, "plugin": names.get(plugin, plugin)}
