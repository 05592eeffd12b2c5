"""`python -m cpbench.solvers.external.builds LABEL ROOT PLUGIN`: the solvers of one build, as tables of variants.

    $ python -m cpbench.solvers.external.builds base ../before mine.toml
    [solver."mine@base"]
    "serve" = "/ci/before/build/mine --serve"
    "cwd" = "/ci/before"

ROOT is a checkout and PLUGIN a file in it, in words of ROOT. The tables of two checkouts, in one file for `--plugin`,
are two builds in one run, each pair of them on the same problem at about the same time. A program is the one of its
checkout. A solver in Python runs in a separate process, which loads the plugin of its checkout and imports from there
first; with ``--python .venv/bin/python`` (in words of ROOT) under the interpreter of its checkout, which needs cpbench.
Each build has its own options and defaults: what a change adds to them is not asked of the build before.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cpbench import registry
from cpbench.errors import CpbenchError
from cpbench.solvers.base import solvers
from cpbench.solvers.external import declared
from cpbench.solvers.external.command import PLACEHOLDERS

Tables = dict[str, dict[str, Any]]


def tables(label: str, root: Path, plugin: str, python: str | None = None) -> Tables:
    """Return NAME@`label` -> its table, for each solver that the plugin of a checkout has. Raises CpbenchError.

    The solvers become known to this process too: one build a process.
    """
    root = root.absolute()
    path = root / plugin
    if not path.is_file():
        raise CpbenchError(f"{path}: is not a file: say where the plugin of the solver is, in words of {root}")
    if path.suffix == registry.TABLES:
        if python is not None:
            raise CpbenchError(f"{path}: declares programs; --python is for solvers in Python")
        programs = _programs(path)
    else:
        programs = _classes(root, path, python)
    if not programs:
        raise CpbenchError(f"{path}: has no solver")
    return {f"{name}{declared.AT}{label}": table for name, table in programs.items()}


def _programs(path: Path) -> Tables:
    before = set(solvers.names())
    declared.declare_file(path)
    known = json.loads(os.environ[registry.DECLARED])  # with paths that hold anywhere
    return {
        name: {"options": {}} | {key: value for key, value in known[name].items() if key in declared.VARIANT_KEYS}
        for name in sorted(known.keys() - before)
        if declared.AT not in name
    }


def _classes(root: Path, path: Path, python: str | None) -> Tables:
    folders = [str(folder) for folder in (path.parent, root / "src", root) if folder.is_dir()]
    folders = list(dict.fromkeys(folders))
    sys.path[:0] = folders
    before = set(solvers.names())
    registry.load_plugin(path)
    inherited = [os.environ["PYTHONPATH"]] if os.environ.get("PYTHONPATH") else []
    env = {registry.PLUGIN_FILES: str(path), "PYTHONPATH": os.pathsep.join([*folders, *inherited])}
    table: dict[str, Any] = {"env": env}
    if python is not None:
        table["interpreter"] = str(root / python) if os.path.dirname(python) else python
    fresh = sorted(set(solvers.names()) - before)
    return {name: {**table, "options": _defaults(solvers.get(name).spec.options())} for name in fresh}


def _defaults(options: Any) -> dict[str, Any]:
    """Return the defaults that a table can have; a solver that does not get an option takes its own default."""
    values = {field.name: getattr(options, field.name) for field in dataclasses.fields(options)}
    return {
        name: value
        for name, value in values.items()
        if isinstance(value, bool | int | float | str) and name not in PLACEHOLDERS
    }


def as_toml(tables: Tables) -> str:
    """Return the tables in a file that `--plugin` takes; every key is quoted, as any may be.

    >>> print(as_toml({"mine@base": {"serve": "./mine", "options": {"omega": 1.5, "a b": True}}}), end="")
    [solver."mine@base"]
    "serve" = "./mine"
    "options" = {"omega" = 1.5, "a b" = true}
    """
    lines: list[str] = []
    for name, table in tables.items():
        lines += [f"[solver.{_value(name)}]", *(f"{_value(key)} = {_value(entry)}" for key, entry in table.items()), ""]
    return "\n".join(lines)


def _value(entry: Any) -> str:
    """Return a value in TOML: texts are those of JSON save one character, a mapping is an inline table."""
    if isinstance(entry, Mapping):
        return "{" + ", ".join(f"{_value(key)} = {_value(item)}" for key, item in entry.items()) + "}"
    if isinstance(entry, float):
        return repr(entry)
    return json.dumps(entry, ensure_ascii=False).replace("\x7f", "\\u007f")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m cpbench.solvers.external.builds", description=__doc__)
    parser.add_argument("label")
    parser.add_argument("root", type=Path)
    parser.add_argument("plugin")
    parser.add_argument("--python")
    arguments = parser.parse_args()
    try:
        sys.stdout.write(as_toml(tables(arguments.label, arguments.root, arguments.plugin, arguments.python)))
    except CpbenchError as refusal:
        sys.exit(f"cpbench: {refusal}")


if __name__ == "__main__":
    main()
