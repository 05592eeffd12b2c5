"""Plans as files: `cpbench.toml`, or any other that is named.

    output = "night.sqlite"          # what all sets share; keys of a set stand for every set
    timeout = "1m"

    [[set]]
    name = "contacts"
    problems = ["scenes/*.hdf5", "builtin"]
    solvers = ["nsgs[omega=0.8:1.4:0.2]", "newton-*", "mine"]
    where = "nc > 100"

    [solver.mine]                    # a solver that is a program: see `cpbench.solvers.external.declared`
    node = "lcp"
    serve = "./mine --serve"

The keys are the options of `cpbench run`, with _ for -, and `facets`, `format`, `measure`, `report` and `threads`.
Paths are relative to the file. Results of `night.toml` go to `night.sqlite` here, unless it says otherwise. Whatever is
wrong is said in one line with the file, the table, the key and the value.
"""

from __future__ import annotations

import difflib
import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpbench.bench.planning.places import BUILTIN
from cpbench.bench.planning.run_plan import SET_SETTINGS, SETTINGS
from cpbench.errors import CpbenchError
from cpbench.solvers.external import declared
from cpbench.storage.collections import PREFIX

NAME = "cpbench.toml"
ONLY_SAID = ("shard", "rerun")
"""Keys of one command, not of a plan."""


class PlanError(CpbenchError):
    """A plan file is not valid; the message is `file: table: key = value: cause`."""


@dataclass(frozen=True)
class PlanFile:
    """The checked content of a plan file: keys of the run and of all sets, and keys of each set."""

    path: Path
    top: Mapping[str, Any]
    sets: tuple[Mapping[str, Any], ...]


def read(path: str | Path) -> PlanFile:
    """Return the plan file at `path`, its solvers declared; raises PlanError, and CpbenchError about a solver."""
    path = Path(path)
    table = _table(path)
    if "solver" in table:
        declared.declare_all(table.pop("solver"), path)
    sets = _tables(table.pop("set", []), path)
    shared = [key for key in SETTINGS if key not in ("name", *ONLY_SAID)]
    top = _checked(table, shared, path, "", ["set", "solver"])
    if path.name != NAME:
        top.setdefault("output", f"{path.stem}.sqlite")
    parts = [_checked(part, SET_SETTINGS, path, _title(part, i)) for i, part in enumerate(sets, 1)]
    names = [part.get("name", "") for part in parts]
    for i, name in enumerate(names, 1):
        if len(names) > 1 and not name:
            raise PlanError(f"{path}: [[set]] {i}: has no name; with several sets each needs one")
        if names.index(name) != i - 1:
            raise PlanError(f"{path}: [[set]] {i}: name = '{name}': is the name of [[set]] {names.index(name) + 1} too")
    return PlanFile(path, top, tuple(parts))


def _table(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except (ValueError, RecursionError) as cause:  # a number of 5000 digits is a ValueError of Python's own
        raise PlanError(f"{path}: is not valid TOML: {str(cause).splitlines()[0]}") from None
    except OSError as cause:
        raise PlanError(f"{path}: cannot be read ({cause.strerror or cause})") from None


def _tables(value: Any, path: Path) -> list[dict[str, Any]]:
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise PlanError(f"{path}: set: is not a list of tables; write [[set]] above each")
    return value


def _title(part: Mapping[str, Any], i: int) -> str:
    name = part.get("name")
    return f"[[set]] {i} '{name}'" if isinstance(name, str) and name else f"[[set]] {i}"


def _checked(
    table: Mapping[str, Any], allowed: Iterable[str], path: Path, title: str, more: Iterable[str] = ()
) -> dict[str, Any]:
    allowed = list(allowed)
    prefix = f"{path}: {title}: " if title else f"{path}: "
    result: dict[str, Any] = {}
    for key, value in table.items():
        if key not in allowed:
            keys = [*allowed, *more]
            near = difflib.get_close_matches(key.replace("-", "_"), keys, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(sorted(keys))}"
            raise PlanError(f"{prefix}{key} = {_shown(value)}: unknown key, {hint}")
        try:
            result[key] = _beside(path.parent, key, SETTINGS[key].read(value))
        except CpbenchError as cause:
            raise PlanError(f"{prefix}{key} = {_shown(value)}: {cause}") from None
    return result


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _beside(folder: Path, key: str, value: Any) -> Any:
    """Return paths relative to the plan file, as paths from here."""
    if key == "problems":
        return tuple(text if _builtin(text) else os.path.normpath(folder / text) for text in value)
    if key in ("output", "report") and value:
        return os.path.normpath(folder / value)
    return value


def _builtin(text: str) -> bool:
    return text.split("/")[0] in (BUILTIN, PREFIX)
