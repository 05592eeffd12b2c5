"""Solvers that are declared in a table, in a plan file or in a file of their own, and variants of solvers.

    [solver.mine]                         # a program in any language; paths are relative to the file
    node = "lcp"
    serve = "./mine --serve"              # or: command = "./mine {problem} {answer} --tol {tol}"
    options = {omega = 1.2, shuffle = true}

    [solver."mine@head"]                  # the same solver, another build: only what differs
    serve = "./build/mine --serve"

    [solver."nsgs@head"]                  # a solver in Python, under another interpreter or other variables
    interpreter = "/opt/head/bin/python"

With ``options`` of its own a variant has those, with their defaults, and no others: a build that knows fewer, or whose
defaults are others. Whatever is declared is put into the environment variable ``CPBENCH_SOLVERS`` too, as JSON
{name: table}: the other processes of a run find it there.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import shlex
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cpbench.errors import CpbenchError, DuplicateName, UnknownName
from cpbench.formulations.base import Kind, formulations
from cpbench.formulations.exchange import exchanges
from cpbench.registry import DECLARED, PLUGIN_MODULE
from cpbench.solvers.base import NoOptions, Solver, SolverSpec, Trait, solvers
from cpbench.solvers.external.command import PLACEHOLDERS, CommandSolver
from cpbench.solvers.external.served import MATRICES, ProgramSolver, ServedSolver

AT = "@"
"""Between the name of a solver and that of its variant."""
Table = Mapping[str, Any]
_NAME = re.compile(r"[A-Za-z0-9][\w.+-]*")
_ROUTE = re.compile(r"exact|(inner|outer|facets)\d+.*|necessary|relaxed")
"""Requests of routes, which stand behind an @ in the labels of rows."""
_SAFE = {"PYTHONSAFEPATH": "1", DECLARED: ""}
"""A module in the folder of a run is not imported; another cpbench need not know what is declared here."""

VARIANT_KEYS = ("interpreter", "command", "serve", "exchange", "matrices", "env", "cwd", "options")
KEYS: Mapping[str, type] = {
    "node": str,
    **dict.fromkeys(VARIANT_KEYS[1:], str),
    "env": dict,
    "options": dict,
    **dict.fromkeys(("summary", "method", "install", "licence", "publishing", "kind"), str),
    **dict.fromkeys(("warm_start", "deterministic", "by_default"), bool),
}
"""The keys of a table and the types of their values; a variant has those of `VARIANT_KEYS`."""
EXPECTED: Mapping[type, str] = {str: "a text", bool: "true or false", dict: "a table"}
MAY_BE_EMPTY = ("install", "publishing")
CHOICES = {"matrices": MATRICES, "kind": (Kind.EQUIVALENT, Kind.RELAXATION)}

MOST = 2**17 - 2**8
"""Bytes of all tables together: Linux starts no process with a longer variable."""
_declared: dict[str, tuple[Table, str]] = {}
"""Declarations of this process: the table, and its place."""


def declare(name: str, table: Any, origin: str, folder: str | Path = ".") -> Solver:
    """Register the solver of a table; what was declared before in the same words is there already.

    `origin` is what messages begin with (a file), `folder` what relative paths in the table are relative to. Raises
    CpbenchError, in one line with origin, table and key, DuplicateName.
    """
    prefix = f"{origin}: [solver.{_quoted(name)}]"
    if not isinstance(table, dict):
        raise CpbenchError(f"{prefix}: is not a table")
    plain = _placed(_checked(name, table, prefix), Path(folder).absolute())
    solvers.discover()  # what another process declared is known before it is declared again
    if name in _declared:
        if _declared[name][0] != plain:
            raise DuplicateName(f"{prefix}: was declared otherwise in {_declared[name][1]}: rename one")
        return solvers.get(name)
    base, at, _ = name.partition(AT)
    try:
        solver = _variant(name, plain, solvers.get(base)) if at else _program(name, plain)
    except UnknownName as cause:
        raise CpbenchError(f"{prefix}: {cause}") from None
    except CpbenchError as cause:
        key = next((key for key in ("command", "serve", "interpreter") if key in table), "")
        raise CpbenchError(f"{prefix}: {f'{key} = {_shown(table[key])}: ' if key else ''}{cause}") from None
    if name in solvers:
        raise DuplicateName(f"{prefix}: there is a solver of this name already: rename this one")
    text = json.dumps({**_inherited(), name: plain})
    if len(text) > MOST:
        raise CpbenchError(
            f"{prefix}: with it the tables of {len(_declared) + 1} solvers are {len(text)} bytes, of {MOST} "
            "that other processes of a run can be told: declare fewer in one run"
        )
    solvers.add(name, solver)
    _declared[name] = (plain, origin)
    os.environ[DECLARED] = text
    return solver


def declare_file(path: str | Path) -> None:
    """Register the solvers of a file with tables [solver.NAME]; raises CpbenchError."""
    path = Path(path)
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as cause:
        raise CpbenchError(f"{path}: is not valid TOML: {cause}") from None
    except OSError as cause:
        raise CpbenchError(f"{path}: cannot be read ({cause.strerror or cause})") from None
    declare_all(tables.get("solver"), path)


def declare_all(tables: Any, path: Path) -> None:
    """Register the tables below `solver` of a file, variants after what they are variants of."""
    if not isinstance(tables, dict) or not tables:
        raise CpbenchError(f"{path}: has no table [solver.NAME]")
    for name in sorted(tables, key=lambda name: AT in name):
        declare(name, tables[name], str(path), path.parent)


def declare_environment() -> None:
    """Register what the process that started this one has declared; raises CpbenchError."""
    tables = _inherited()
    for name in sorted(tables, key=lambda name: AT in name):
        declare(name, tables[name], DECLARED)


def _inherited() -> dict[str, Any]:
    text = os.environ.get(DECLARED, "")
    try:
        tables = json.loads(text) if text else {}
    except (ValueError, RecursionError) as cause:
        raise CpbenchError(f"{DECLARED}: is not valid JSON: {cause}") from None
    if not isinstance(tables, dict):
        raise CpbenchError(f"{DECLARED}: is not a JSON object of tables")
    return tables


def origin(name: str) -> str:
    """Return the file that another command needs for a solver (--plugin); '' for solvers that are known everywhere."""
    if name in _declared:
        return _declared[name][1]
    module = sys.modules.get(type(solvers.get(name)).__module__)
    is_plugin = module is not None and module.__name__.startswith(PLUGIN_MODULE)
    return str(module.__file__) if module is not None and is_plugin else ""


# --------------------------------------------------------------------------------------------- the table


def _program(name: str, table: Table) -> Solver:
    spec = SolverSpec(
        name=name,
        node=table["node"],
        summary=table.get("summary", f"a separate program: {table.get('serve') or table.get('command')}"),
        method=table.get("method", "external program"),
        install=table.get("install", ""),
        licence=table.get("licence", "not told"),
        publishing=table.get("publishing", ""),
        kind=Kind(table.get("kind", "equivalent")),
        traits=_traits(table),
        options=_options(name, table.get("options", {})),
        by_default=table.get("by_default", True),
    )
    return _solver(spec, table)


def _variant(name: str, table: Table, base: Solver) -> Solver:
    """Return the solver that `base` is too, by another program, interpreter or with other variables."""
    spec = dataclasses.replace(base.spec, name=name, requires=(), traits=base.spec.traits - {Trait.HISTORY})
    if "options" in table:
        spec = dataclasses.replace(spec, options=_options(name, table["options"]))
    external = isinstance(base, ProgramSolver)
    if external:  # a command that becomes a served program launches no more
        spec = dataclasses.replace(spec, traits=spec.traits - {Trait.LAUNCHES})
    if "interpreter" in table and external:
        raise CpbenchError(f"{base.spec.name} is a separate program: say serve or command")
    given: dict[str, Any] = {"exchange": "npy-dir", "matrices": "as-is"}
    if external:
        given = {"exchange": base.exchange, "matrices": base.matrices, "cwd": base.cwd}
        if not {"command", "serve"} & table.keys():
            given["serve" if isinstance(base, ServedSolver) else "command"] = shlex.join(base.command)
        given["env"] = {**base.env, **table.get("env", {})}
    elif not {"command", "serve"} & table.keys():
        python = table.get("interpreter", sys.executable)
        spec = dataclasses.replace(
            spec, install=f"{python} has to be a Python that finds cpbench: {python} -m pip install cpbench"
        )
        served = [python, "-m", "cpbench.solvers.external.serve", base.spec.name]
        given |= {"serve": shlex.join(served), "env": {**_SAFE, **table.get("env", {})}}
    settings = {key: value for key, value in table.items() if key != "env" or "env" not in given}
    return _solver(spec, {**given, **settings})


def _solver(spec: SolverSpec, table: Table) -> Solver:
    exchange = exchanges.get(table.get("exchange", "npy-dir"))
    if exchange.nodes is not None and spec.node not in exchange.nodes:
        raise CpbenchError(f"the exchange {exchange.name} carries {', '.join(sorted(exchange.nodes))}, not {spec.node}")
    matrices, env, cwd = table.get("matrices", "as-is"), table.get("env"), table.get("cwd")
    if "serve" in table:
        return ServedSolver(spec, shlex.split(table["serve"]), exchange.name, matrices, env, cwd)
    return CommandSolver(spec, table["command"], exchange.name, matrices, env, cwd)


def _traits(table: Table) -> frozenset[Trait]:
    wanted = {
        Trait.WARM_START: table.get("warm_start", False),
        Trait.DETERMINISTIC: table.get("deterministic", False),
        Trait.SPARSE: table.get("matrices", "as-is") != "dense",
    }
    return frozenset(trait for trait, holds in wanted.items() if holds)


def _options(name: str, defaults: Table) -> type:
    """Return a dataclass of options with these defaults, and their types."""
    if not defaults:
        return NoOptions
    fields = [(key, type(value), dataclasses.field(default=value)) for key, value in defaults.items()]
    return dataclasses.make_dataclass(f"Options of {name}".title().replace(" ", ""), fields, frozen=True)


# ---------------------------------------------------------------------------------------------- the keys


def _checked(name: str, table: Mapping[str, Any], where: str) -> dict[str, Any]:
    base, at, label = name.partition(AT)
    if not _NAME.fullmatch(base) or (at and not _NAME.fullmatch(label)):
        raise CpbenchError(f"{where}: is not a name of a solver: letters, digits, . + - _, and NAME@LABEL of a variant")
    if at and _ROUTE.fullmatch(label):
        raise CpbenchError(f"{where}: {label} is the name of a route, which labels of rows show as {name}: rename it")
    keys = VARIANT_KEYS if at else KEYS
    for key, value in table.items():
        if key not in keys:
            raise CpbenchError(f"{where}: {key} = {_shown(value)}: unknown key, known are {', '.join(keys)}")
        try:
            _require(key, value)
        except CpbenchError as cause:
            raise CpbenchError(f"{where}: {key} = {_shown(value)}: {cause}") from None
    if not at and "node" not in table:
        raise CpbenchError(f"{where}: node is missing, one of {', '.join(formulations.names())}")
    ways = [key for key in ("command", "serve", "interpreter") if key in table]
    if len(ways) > 1:
        raise CpbenchError(f"{where}: has {' and '.join(ways)}: keep one of them")
    if not ways and not at:
        raise CpbenchError(f"{where}: has neither command nor serve: say how it is run")
    if at and not ways and "env" not in table:
        raise CpbenchError(f"{where}: says nothing that differs: interpreter, command, serve or env")
    return dict(table)


def _placed(table: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the table with paths that hold in any folder; a program runs in that of the file which says how to
    start it."""
    placed = dict(table)
    if {"command", "serve", "interpreter", "cwd"} & table.keys():
        placed["cwd"] = os.path.normpath(folder / table.get("cwd", ""))
    if "interpreter" in table and os.path.dirname(table["interpreter"]):
        placed["interpreter"] = os.path.normpath(folder / table["interpreter"])
    for key in {"command", "serve"} & table.keys():
        first, *rest = shlex.split(table[key])
        if os.path.dirname(first):
            placed[key] = shlex.join([os.path.normpath(folder / first), *rest])
    return placed


def _require(key: str, value: Any) -> None:
    """Raise CpbenchError where a value cannot be that of its key."""
    kind = KEYS.get(key, str)
    if not isinstance(value, kind) or (not value and kind is str and key not in MAY_BE_EMPTY):
        raise CpbenchError(f"expected {EXPECTED[kind]}")
    if key in CHOICES and value not in CHOICES[key]:
        raise CpbenchError(f"expected {' or '.join(CHOICES[key])}")
    if key == "node":
        formulations.get(value)
    elif key == "exchange":
        exchanges.get(value)
    elif key in ("command", "serve"):
        try:
            empty = not shlex.split(value)
        except ValueError as cause:
            raise CpbenchError(f"cannot be split into words ({cause})") from None
        if empty:
            raise CpbenchError("is empty")
    elif key == "env" and not all(isinstance(text, str) for text in value.values()):
        raise CpbenchError("expected a table of texts")
    elif key == "options":
        _require_defaults(value)


def _require_defaults(options: Mapping[str, Any]) -> None:
    for name, default in options.items():
        if not name.isidentifier() or name in PLACEHOLDERS:
            taken = ", ".join(PLACEHOLDERS)
            raise CpbenchError(f"{name} is not a name for an option: letters, digits and _, and none of {taken}")
        if not isinstance(default, bool | int | float | str):
            raise CpbenchError(f"the default of {name} is not a number, text or truth value")


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _quoted(name: str) -> str:
    return f'"{name}"' if AT in name else name
