"""The problems of a bundle: a file each, or, where they are built in, of a collection of others, or may not be handed
on, what finds them again.

All files are written anew in cpbench's own format, with the starting points and solutions that the old ones had: one
layout whatever the problems came in, and nothing in it that was not read as a part of the problem. Steps of a scene
keep a folder of their own, by which they are known as one.
"""

from __future__ import annotations

import fnmatch
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cpbench import storage
from cpbench.bench.planning.run_plan import BUILTIN
from cpbench.bench.results.rows import Row
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError, FormatError
from cpbench.formulations.base import Point, Problem
from cpbench.storage.base import SEPARATOR, split_address
from cpbench.storage.collections import added, manifests
from cpbench.storage.collections.manifests import Manifest
from cpbench.storage.hdf5_files import write_problem
from cpbench.storage.hdf5_points import put_guesses, put_solution
from cpbench.storage.hdf5_writer import new_file
from cpbench_lab.bundle.archive import name_of

FOLDER = "problems"
FORBIDS = re.compile(
    r"\b(?:no|not|non|without)\b[\s-]*(?:\w+\s+){0,3}(?:re-?)?(?:distribut|publi|shar)\w*|proprietary|confidential"
    r"|\b(?:re-?)?(?:distribut|publi|shar)\w*\s+(?:\w+\s+){0,2}(?:not|forbidden|prohibited)\b"
    r"|all rights reserved|no licen[cs]e\b|internal use",
    re.IGNORECASE,
)
"""Licences that do not let a file be handed on."""


@dataclass(frozen=True)
class Place:
    """Place of a problem of a bundle.

    Attributes
    ----------
    address : in the plan and the rows of the bundle: a file below it, or `builtin/...`. withheld : why there is no
    such file, empty where there is. source : what makes the problem, where that is known.
    """

    address: str
    fingerprint: str
    name: str
    node: str
    licence: str = ""
    withheld: str = ""
    source: str = ""
    citation: str = ""

    @property
    def builtin(self) -> bool:
        return self.address.partition("/")[0] == BUILTIN


Unit = tuple[str, str]
"""A fingerprint, and the address where a scene tells equal problems apart."""


def unit(row: Row) -> Unit:
    """Return which problem a row is about."""
    return row.fingerprint, row.address if row.sequence else ""


def shipped(folder: Path) -> dict[str, Place]:
    """Return the built-in problems by fingerprint, from the sheets beside them."""
    result: dict[str, Place] = {}
    for sheet in sorted(folder.glob("*/*.toml")):
        described = _sheet(sheet)
        about = {key: str(described[key]) for key in ("node", "licence", "source", "citation")}
        pack = f"{BUILTIN}/{sheet.parent.name}/{sheet.stem}.h5"
        several = len(described["problem"]) > 1
        for problem in described["problem"]:
            address = f"{pack}{SEPARATOR}{problem['name']}" if several else pack
            place = Place(address, problem["fingerprint"], problem["name"], **about)
            result.setdefault(place.fingerprint, place)
    return result


def gather(
    store: Store, rows: Sequence[Row], folder: Path, builtin: Mapping[str, Place], withhold: Sequence[str] = ()
) -> dict[Unit, Place]:
    """Write the problems of the rows below `folder`; where each is.

    `withhold` : globs of names, families or addresses of problems that stay out, whatever their licence.
    """
    formats: Mapping[str, str] = store.meta().get("formats") or {}
    result: dict[Unit, Place] = {}
    used: set[str] = set()
    scenes: dict[tuple[str, str], str] = {}
    for row in sorted(rows, key=lambda row: (row.node, row.problem, int(row.step or 0))):
        key = unit(row)
        if key in result:
            continue
        if not row.sequence and key[0] in builtin:
            result[key] = builtin[key[0]]
            continue
        place = _place(row, used, scenes)
        result[key] = _written(row, place, store, folder, formats.get(row.address), withhold)
    return result


def _place(row: Row, used: set[str], scenes: dict[tuple[str, str], str]) -> Place:
    """Return a separate name below the folder of the node; steps of a scene in a folder of their scene."""
    node, problem, scene = row.node, row.problem, row.sequence or ""
    base = f"{FOLDER}/{name_of(node)}/{name_of(scene or problem)}"
    if scene:
        file, pack, _ = row.address.partition(SEPARATOR)
        origin = (file if pack else str(Path(file).parent), row.sequence)
        if origin not in scenes:
            scenes[origin] = _free(base, used)
        address = _free(f"{scenes[origin]}/step-{int(row.step or 0):06d}", used)
    else:
        address = _free(base, used)
    return Place(f"{address}.h5", row.fingerprint, problem, node)


def _free(name: str, used: set[str]) -> str:
    k, free = 1, name
    while free.casefold() in used:
        k += 1
        free = f"{name}-{k}"
    used.add(free.casefold())
    return free


def _written(row: Row, place: Place, store: Store, folder: Path, format: str | None, withhold: Sequence[str]) -> Place:
    """Return the place with what is known of the problem, once its file is written or the reason is found why it is
    not."""
    address = located(row.address, store.path)
    if (known := _collection_of(address)) is not None:
        why = f"its file is one of the collection {known.name} of others ({known.licence})"
        return replace(place, licence=known.licence, withheld=why, source=known.source, citation=known.citation)
    try:
        problem = storage.load(address, format=format)
    except CpbenchError:
        return replace(place, withheld="its file could not be read when the bundle was made")
    info, licence = problem.info, problem.info.licence or _licence_beside(address)
    about = replace(place, licence=licence, source=info.source, citation=info.citation)
    if problem.fingerprint != place.fingerprint:
        return replace(about, withheld="its file was changed after the run")
    if FORBIDS.search(licence):
        return replace(about, withheld=f"its licence does not let it be handed on: {about.licence}")
    names = (problem.name, info.family, row.problem, row.address)
    if any(fnmatch.fnmatchcase(name, pattern) for name in names for pattern in withhold):
        return replace(about, withheld="whoever made the bundle kept it")
    save(problem, address, folder / place.address)
    return about


def _collection_of(address: str) -> Manifest | None:
    """Return the collection that others publish and the user has added, where the problem is in its copy."""
    file, home = split_address(address)[0].resolve(), added.home().resolve()
    if not file.is_relative_to(home):
        return None
    name = file.relative_to(home).parts[0]
    return manifests.manifest(name) if name in manifests.names() else None


def _licence_beside(address: str) -> str:
    """Return the licence in the sheet of a collection, `pack.toml` beside `pack.h5`; '' where there is none."""
    sheet = split_address(address)[0].with_suffix(".toml")
    return str(_sheet(sheet).get("licence", "")) if sheet.is_file() else ""


def _sheet(path: Path) -> dict[str, Any]:
    """Return what a sheet says; nothing where it is none."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def located(address: str, results: Path) -> str:
    """Return an address of a row as a path from here: relative ones were from where the run was, or beside the
    results."""
    file, member = split_address(address)
    if file.is_absolute() or file.exists():
        return address
    beside = results.resolve().parent / file
    return f"{beside}{SEPARATOR}{member}" if member and beside.exists() else str(beside if beside.exists() else address)


def save(problem: Problem, address: str, target: Path) -> None:
    """Write a problem with the guesses and the solution that stand beside it at `address`; raises FormatError."""
    guesses, solution = _points(address)
    target.parent.mkdir(parents=True, exist_ok=True)
    with new_file() as (root, image):
        write_problem(root, problem, compress=False)
        if solution is not None:
            put_solution(root, problem, solution, {"name": problem.name})
        put_guesses(root, problem, guesses)
    target.write_bytes(image[0])


def _points(address: str) -> tuple[list[Point], Point | None]:
    """Return starting points and the solution of a file, none where it is not of a kind that has any, or they are
    damaged."""
    try:
        solution = storage.solution(address)
        return storage.guesses(address), solution[0] if solution is not None else None
    except FormatError:
        return [], None


def adopt(candidates: Sequence[str], wanted: Mapping[str, Sequence[str]], folder: Path) -> int:
    """Put the problems at `candidates` that a bundle was made without into its folder; how many.

    `wanted` : places in the bundle by fingerprint. What cannot be read is passed over: it is somebody's own folder.
    """
    done = 0
    for address in candidates:
        try:
            problem = storage.load(address)
        except CpbenchError:
            continue
        for place in wanted.get(problem.fingerprint, ()):
            save(problem, address, folder / place)
            done += 1
    return done
