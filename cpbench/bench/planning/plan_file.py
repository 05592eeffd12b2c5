"""Plans as files: `cpbench.toml`, or the table `[tool.cpbench]` of a `pyproject.toml`.

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
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpbench.bench.planning import features, grids, quantities, where
from cpbench.bench.planning.plan import pinned
from cpbench.bench.planning.run_plan import BUILTIN, RUN_KEYS, SET_KEYS
from cpbench.bench.planning.suites import SUITES
from cpbench.bench.results.store import KEEP
from cpbench.bench.starts import parse_start
from cpbench.errors import CpbenchError, UnknownName
from cpbench.solvers.external import declared
from cpbench.storage.base import formats
from cpbench.storage.collections import PREFIX
from cpbench.verification import CONTRADICTION, Status

NAME, PROJECT = "cpbench.toml", "pyproject.toml"
ROUTES = ("exact", "facets", "all")
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


def find(folder: str | Path = ".") -> Path | None:
    """Return the plan file of a folder: its `cpbench.toml`, else a `pyproject.toml` that has a `[tool.cpbench]`."""
    own, project = Path(folder) / NAME, Path(folder) / PROJECT
    if own.is_file():
        return own
    if project.is_file() and _table(project) is not None:
        return project
    return None


def read(path: str | Path) -> PlanFile:
    """Return the plan file at `path`, its solvers declared; raises PlanError, and CpbenchError about a solver."""
    path = Path(path)
    table = _table(path)
    if table is None:
        raise PlanError(f"{path}: has no table [tool.cpbench]")
    if "solver" in table:
        declared.declare_all(table.pop("solver"), path)
    sets = _tables(table.pop("set", []), path)
    top = _checked(
        table, [k for k in (*RUN_KEYS, *SET_KEYS) if k not in ("name", *ONLY_SAID)], path, "", ["set", "solver"]
    )
    if path.name not in (NAME, PROJECT):
        top.setdefault("output", f"{path.stem}.sqlite")
    parts = [_checked(part, SET_KEYS, path, _title(part, i)) for i, part in enumerate(sets, 1)]
    names = [part.get("name", "") for part in parts]
    for i, name in enumerate(names, 1):
        if len(names) > 1 and not name:
            raise PlanError(f"{path}: [[set]] {i}: has no name; with several sets each needs one")
        if names.index(name) != i - 1:
            raise PlanError(f"{path}: [[set]] {i}: name = '{name}': is the name of [[set]] {names.index(name) + 1} too")
    return PlanFile(path, top, tuple(parts))


def check(key: str, value: Any) -> Any:
    """Return the value of a key, in its own type, from a file or from the command line; raises CpbenchError."""
    return READERS[key](value)


# ----------------------------------------------------------------------------------------------- the file


def _table(path: Path) -> dict[str, Any] | None:
    try:
        with path.open("rb") as file:
            result = tomllib.load(file)
    except (ValueError, RecursionError) as cause:  # a number of 5000 digits is a ValueError of Python's own
        raise PlanError(f"{path}: is not valid TOML: {str(cause).splitlines()[0]}") from None
    except OSError as cause:
        raise PlanError(f"{path}: cannot be read ({cause.strerror or cause})") from None
    if path.name != PROJECT:
        return result
    tool = result.get("tool")
    table = tool.get("cpbench") if isinstance(tool, dict) else None
    return table if isinstance(table, dict) else None


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
    place = f"{path}: {title}: " if title else f"{path}: "
    result: dict[str, Any] = {}
    for key, value in table.items():
        if key not in allowed:
            known = [*allowed, *more]
            near = difflib.get_close_matches(key.replace("-", "_"), known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(sorted(known))}"
            raise PlanError(f"{place}{key} = {_shown(value)}: unknown key, {hint}")
        try:
            result[key] = _beside(path.parent, key, check(key, value))
        except CpbenchError as cause:
            raise PlanError(f"{place}{key} = {_shown(value)}: {cause}") from None
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


# --------------------------------------------------------------------------------------------- the values


def _wrong(value: Any, expected: str) -> CpbenchError:
    return CpbenchError(f"expected {expected}, found a {_TYPES.get(type(value), type(value).__name__)}")


_TYPES = {str: "text", bool: "truth value", int: "number", float: "number", list: "list", tuple: "list", dict: "table"}


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise _wrong(value, "a text")
    return value


def _texts(value: Any) -> tuple[str, ...]:
    items = [value] if isinstance(value, str) else value
    if not isinstance(items, list | tuple) or not all(isinstance(item, str) and item for item in items):
        raise _wrong(value, "a text or a list of texts")
    return tuple(items)


def _some_texts(value: Any) -> tuple[str, ...]:
    if not (items := _texts(value)):
        raise CpbenchError("is empty; leave it out for the default")
    return items


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise _wrong(value, "true or false")
    return value


def _whole(least: int) -> Callable[[Any], int]:
    def read(value: Any) -> int:
        if not isinstance(value, int) or isinstance(value, bool):
            raise _wrong(value, "a whole number")
        if value < least:
            raise CpbenchError(f"must be at least {least}")
        if value > quantities.LARGEST:
            raise CpbenchError(f"is too large, at most {quantities.LARGEST} is kept")
        return value

    return read


def _choice(*choices: str) -> Callable[[Any], str]:
    def read(value: Any) -> str:
        if _text(value) not in choices:
            raise UnknownName("choice", value, choices)
        return value

    return read


def _tolerances(value: Any) -> tuple[float, ...]:
    items = value if isinstance(value, list | tuple) else [value]
    if not items or not all(isinstance(item, int | float) and not isinstance(item, bool) for item in items):
        raise _wrong(value, "a number or a list of numbers")
    for item in items:
        if not 0 < item < float("inf"):
            raise CpbenchError(f"the tolerance {item:g} is not positive")
    return tuple(dict.fromkeys(float(item) for item in items))


def _facets(value: Any) -> tuple[int, ...]:
    items = value if isinstance(value, list | tuple) else [value]
    return tuple(quantities.facet_count(_whole(0)(item)) for item in items) or (8, 16)


def _seconds(value: Any) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool):
        value = f"{value:f}" if value < float("inf") else "none"
    return quantities.seconds(_text(value))


def _size(value: Any) -> int:
    return _whole(0)(value) if isinstance(value, int) else quantities.size(_text(value))


def _solvers(value: Any) -> tuple[str, ...]:
    texts = _texts(value)
    grids.entries(texts)
    return texts


def _via(value: Any) -> tuple[str, ...]:
    texts = _texts(value)
    pinned(texts, {})
    return texts


def _starts(value: Any) -> tuple[str, ...]:
    return tuple(dict.fromkeys(str(parse_start(text)) for text in _texts(value))) or ("cold",)


def _format(value: Any) -> str:
    formats.get(_text(value))
    return value


def _where(value: Any) -> str:
    where.require_condition(_text(value), features.known())
    return value


def _report(value: Any) -> str | None:
    return None if value is False else _text(value)


def _failures(value: Any) -> tuple[str, ...]:
    known = (*map(str, Status), CONTRADICTION)
    for text in _texts(value):
        if text not in known:
            raise UnknownName("status", text, known)
    return _texts(value)


def _shard(value: Any) -> tuple[int, int]:
    part, _, parts = _text(value).partition("/")
    if not (part.isdecimal() and parts.isdecimal() and len(value) < 20 and 1 <= int(part) <= int(parts)):
        raise CpbenchError(f"'{value}' is no shard; write 1/4 to 4/4")
    return int(part), int(parts)


READERS: Mapping[str, Callable[[Any], Any]] = {
    "name": _text,
    "problems": _some_texts,
    "suite": _choice(*SUITES),
    "solvers": _solvers,
    "routes": _choice(*ROUTES),
    "facets": _facets,
    "via": _via,
    "tolerance": _tolerances,
    "timeout": _seconds,
    "memory": _size,
    "repeats": _whole(1),
    "repeat_below": _seconds,
    "history": _flag,
    "measure": _text,
    "start": _starts,
    "format": _format,
    "where": _where,
    "seed": _whole(0),
    "output": _text,
    "report": _report,
    "keep": _choice(*KEEP),
    "threads": _whole(1),
    "jobs": _whole(1),
    "cluster": _text,
    "shard": _shard,
    "rerun": _choice("failed", "timeouts", "all"),
    "retry": _whole(0),
    "fail_on": _failures,
}
"""Readers of values by key, for files and for the command line."""
