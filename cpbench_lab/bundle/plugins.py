"""The plugins of a bundle: the texts of the files that made its solvers known, and of the scripts that they start.

Python plugins are copied as they are. Of files with tables [solver.NAME] the tables that the rows need are written,
with the programs that are texts beside them; a compiled program stays where it is, and the bundle says so.
"""

from __future__ import annotations

import itertools
import os
import shlex
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cpbench.bench.planning import plan_file
from cpbench.bench.results.rows import Row
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench.foundation import toml_text
from cpbench.registry import PLUGIN_FILES
from cpbench_lab.bundle.archive import name_of

FOLDER = "plugins"
LARGEST = 2**20
"""Bytes of the largest script."""


@dataclass
class Plugins:
    """Files, tables and notices of plugins in a bundle.

    Attributes
    ----------
    loaded : names in the bundle, in the order in which they are loaded. texts : name -> text, scripts too.
    absent : what belongs to them and is not in the bundle, in words.
    names : where each file was -> what it is in the bundle.
    """

    loaded: list[str] = field(default_factory=list)
    texts: dict[str, str] = field(default_factory=dict)
    absent: list[str] = field(default_factory=list)
    names: dict[str, str] = field(default_factory=dict)


def gather(store: Store, rows: Sequence[Row]) -> Plugins:
    """Return the plugins of the solvers of the rows, of the command that ran them, and those that are loaded here."""
    sheets: Mapping[str, Mapping[str, Any]] = store.meta().get("solvers") or {}
    needed = {row.solver for row in rows}
    needed |= {name.partition("@")[0] for name in needed}
    in_sheets = [str(sheet.get("plugin") or "") for sheet in sheets.values() if sheet.get("name") in needed]
    named = [*_in_command(str(store.meta().get("command", ""))), *os.environ.get(PLUGIN_FILES, "").split(os.pathsep)]
    result = Plugins()
    files: dict[Path, None] = {}
    origins: dict[Path, list[str]] = {}
    for text in dict.fromkeys(filter(None, [*named, *in_sheets])):
        path = _located(text, store)
        if path is None:
            result.absent.append(f"{text}, which is not there any more")
        else:
            files[path] = None
            origins.setdefault(path, []).append(text)
    for path in sorted(files, key=lambda path: (path.suffix == ".toml", str(path))):
        before = len(result.loaded)
        _add(result, path, needed)
        result.names |= {text: name for text in origins[path] for name in result.loaded[before:]}
    return result


def _in_command(command: str) -> list[str]:
    """Return files of --plugin, and of --plan for its solvers, in a command line."""
    try:
        words = shlex.split(command)
    except ValueError:
        return []
    pairs = [*itertools.pairwise(words), *(tuple(word.split("=", 1)) for word in words if "=" in word)]
    return [value for option, value in pairs if option == "--plugin"]


def _located(text: str, store: Store) -> Path | None:
    for path in (Path(text), store.path.resolve().parent / text):
        if path.is_file():
            return path.resolve()
    return None


def _add(found: Plugins, path: Path, needed: set[str]) -> None:
    try:
        source = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as cause:
        raise CpbenchError(f"{path}: a plugin that cannot be read as text ({cause})") from None
    if path.suffix != ".toml":
        _put(found, f"{FOLDER}/{name_of(path.stem)}.py", source)
        return
    tables = {name: table for name, table in _tables(path, source).items() if name in needed}
    if tables:
        folder = f"{FOLDER}/{name_of(path.stem)}"
        _put(found, f"{folder}/{name_of(path.stem)}.toml", _text(tables))
        for name, table in sorted(tables.items()):
            _add_scripts(found, name, table, path.parent, folder)


def _put(found: Plugins, name: str, source: str) -> None:
    stem, dot, suffix = name.rpartition(".")
    k, free = 1, name
    while free in found.texts:
        k += 1
        free = f"{stem}_{k}{dot}{suffix}"
    found.texts[free] = source
    found.loaded.append(free)


def _tables(path: Path, source: str) -> dict[str, dict[str, Any]]:
    try:
        tables: dict[str, Any] = tomllib.loads(source)
    except ValueError as cause:
        raise CpbenchError(f"{path}: is not valid TOML: {cause}") from None
    if path.name == plan_file.PROJECT:
        tables = tables.get("tool", {}).get("cpbench", {})
    return tables.get("solver", {})


def _add_scripts(found: Plugins, name: str, table: Mapping[str, Any], here: Path, folder: str) -> None:
    """Add the files that the command of a solver names, below the folder of its table."""
    base = (here / table.get("cwd", "")).resolve()
    words = shlex.split(table.get("serve") or table.get("command") or "")
    if table.get("interpreter"):
        found.absent.append(f"the interpreter of {name}")
    for k, word in enumerate(words):
        file = (base / word).resolve()
        if not file.is_file():
            continue
        inside = here.resolve() in file.parents
        source = _script(file) if inside else None
        if source is not None:
            place = "/".join(name_of(part) for part in file.relative_to(here.resolve()).parts)
            found.texts[f"{folder}/{place}"] = source
        elif k == 0 or inside:
            found.absent.append(f"the program of {name} ({file.name})")


def _script(file: Path) -> str | None:
    if file.stat().st_size > LARGEST:
        return None
    try:
        source = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None
    return source if "\0" not in source else None


def _text(tables: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the tables as TOML."""
    lines: list[str] = []
    for name, table in sorted(tables.items(), key=lambda item: ("@" in item[0], item[0])):
        lines += [f"[solver.{toml_text.value(name)}]", *toml_text.lines(table), ""]
    return "\n".join(lines)


def programs(text: str) -> list[str]:
    """Return what the tables of a file start, one line each, for who is asked whether they may."""
    tables: Mapping[str, Mapping[str, Any]] = tomllib.loads(text).get("solver", {})
    return [f"{name}: {_started(table)}" for name, table in tables.items()]


def _started(table: Mapping[str, Any]) -> str:
    return next((str(table[key]) for key in ("serve", "command", "interpreter") if key in table), "variables only")


def write(found: Plugins, folder: Path) -> None:
    """Put the texts below the folder of a bundle."""
    for name, source in found.texts.items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(source, encoding="utf-8")


def paths(names: Iterable[str], folder: Path) -> list[str]:
    """Return the plugin files of an unpacked bundle, as --plugin takes them."""
    return [str((folder / name).absolute()) for name in names]
