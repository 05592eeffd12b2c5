"""The results file of a bundle: a fresh one, with rows whose addresses are those of the bundle.

Nothing is copied as pages of the old file: what was once in it and was replaced or deleted may still stand there.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cpbench.bench.planning.plan import Entry, Limits, Pair, Request
from cpbench.bench.results import seal_key
from cpbench.bench.results.limits import limits_of
from cpbench.bench.results.rows import Row
from cpbench.bench.results.store import Store
from cpbench.bundle.problems import Place, Unit, unit
from cpbench.bundle.scrub import Scrub
from cpbench.errors import CpbenchError

NAME = "results.sqlite"
ELSEWHERE = "elsewhere"
_META = ("cpbench", "date", "seed", "jobs", "builtin", "versions")
"""Facts of a run that an anonymous bundle keeps, beside those that are made anew."""
_TABLES = ("refused", "references", "merged", "formats")
_MACHINE = ("cpu", "cores", "threads", "ram_gib", "python")


def rows_of(store: Store) -> list[Row]:
    """Return all rows of a results file; raises CpbenchError where none was run."""
    rows = list(store.rows())
    if not any(row.status != "not_run" for row in rows):
        raise CpbenchError(f"{store.path}: has no results; make some with: cpbench run PROBLEMS -o {store.path}")
    return rows


def moved(row: Row, place: Place, scrub: Scrub | None, own: bool) -> Row:
    """Return the row in the bundle, under the key that its pair has there; `own` : whether its solver is cpbench's."""
    new = replace(row, address=place.address)
    if scrub is not None:
        new = _anonymous(new, scrub, own)
    key, label = identity(new)
    return replace(new, key=key, label=new.label if scrub is None else label)


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


def _anonymous(row: Row, scrub: Scrub, own: bool) -> Row:
    """Return the row without what may tell somebody. What a plugin says is its author's, and left out."""

    def renamed(text: str) -> str:
        return scrub.name(text) if text else text

    def reworded(text: str | None) -> str | None:
        return scrub.code(text) if text else text

    return replace(
        row,
        problem=renamed(row.problem),
        family=renamed(row.family),
        set=renamed(row.set),
        solver=renamed(row.solver),
        sequence=renamed(row.sequence),
        options=reworded(row.options),
        version=reworded(row.version),
        claim=reworded(row.claim),
        message=scrub.text(row.message) if row.message and own else row.message and "",
        counters=json.dumps(scrub.deep(json.loads(row.counters))) if row.counters else row.counters,
        host=scrub.host(row.host or "") or None,
        origin=ELSEWHERE if row.origin else row.origin,
    )


def write(
    store: Store,
    rows: Sequence[Row],
    places: Mapping[Unit, Place],
    target: Path,
    plan: Mapping[str, Any],
    foreign: Iterable[str],
    names: Mapping[str, str],
    scrub: Scrub | None,
) -> list[Row]:
    """Write the results file of a bundle; its rows.

    `foreign` : solvers that are not cpbench's own. `names` : of plugin files in the bundle, by where they were.
    """
    others = set(foreign)
    keys: dict[str, str] = {}
    new: list[Row] = []
    for row in rows:
        own = row.solver not in others and not row.origin
        renamed = moved(row, places[unit(row)], scrub, own)
        keys[row.key] = renamed.key
        new.append(renamed)
    key = None if scrub is None else seal_key.for_one_file(row.key for row in new)
    with Store(target, create=True, key=key) as target_store:
        target_store.set_meta(**_meta(store, plan, names, scrub))
        for host, about in store.machines().items():
            name = host if scrub is None else scrub.host(host)
            target_store.note_machine(name, about if scrub is None else _machine(about, scrub))
        target_store.note_features(store.features() if scrub is None else scrub.deep(store.features(), scrub.name))
        if scrub is None:
            target_store.note_files([], store.meta()["refused"])
        target_store.add_references(store.references())
        target_store.add(new)
        target_store.add_kept(
            sorted((keys[key], blob) for key, blob in store.answers()),
            sorted((keys[key], blob) for key, blob in store.histories()),
            sorted((keys[key], kind, proof) for key, kind, proof in store.certificates()),
        )
        if scrub is None:
            inside = {row.fingerprint for row in rows if not places[unit(row)].withheld}
            target_store.note_proved_problems(item for item in store.proved_problems() if item[0] in inside)
        target_store.settle()
    return new


def _meta(store: Store, plan: Mapping[str, Any], names: Mapping[str, str], scrub: Scrub | None) -> dict[str, Any]:
    meta = store.meta()
    sheets = {label: _placed(sheet, names) for label, sheet in (meta.get("solvers") or {}).items()}
    own: dict[str, Any] = {"command": "cpbench run --plan plan.toml"}
    if scrub is None:
        kept = {name: value for name, value in meta.items() if name not in _TABLES}
        return {**kept, "command": meta.get("command", own["command"]), "formats": {}, "solvers": sheets}
    kept = {name: scrub.deep(meta[name]) for name in _META if name in meta}
    sheets = {scrub.name(label): _sheet(sheet, scrub) for label, sheet in sheets.items()}
    own |= {"machine": _machine(meta.get("machine") or {}, scrub), "solvers": sheets, "formats": {}, "plan": plan}
    if meta.get("mixed"):
        own["mixed"] = [f"{len(meta['mixed'])} differences between files that were merged"]
    return {**kept, **own}


def _placed(sheet: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """Return what is told of a solver, with its plugin where it is in the bundle."""
    plugin = str(sheet.get("plugin") or "")
    return {**sheet, "plugin": names.get(plugin, plugin)}


def _sheet(sheet: Mapping[str, Any], scrub: Scrub) -> dict[str, Any]:
    """Return what is told of a solver; of a plugin nothing but what it solves and how."""
    cleaned: dict[str, Any] = scrub.deep(sheet)
    if sheet.get("plugin"):
        cleaned |= {"citation": "", "summary": "", "written": cleaned.get("name", "")}
    return cleaned


def _machine(about: Mapping[str, Any], scrub: Scrub) -> dict[str, Any]:
    """Return the machine without its name, and without the release of its system, which may be one of a kind."""
    cleaned = {name: scrub.deep(about[name]) for name in _MACHINE if name in about}
    system = re.match(r"[A-Za-z]+", str(about.get("os", "")))
    return cleaned | ({"os": system[0]} if system else {})
