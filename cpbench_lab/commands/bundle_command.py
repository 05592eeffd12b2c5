"""Put a run and what repeats it into one zip file: results, problem files, versions, command."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shlex
import sqlite3
import tempfile
import zipfile
from collections.abc import Iterable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import click

from cpbench.bench.results import problem_files
from cpbench.bench.results.store import Store
from cpbench.cli.options import Command, force_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import FILE, PATH
from cpbench.errors import CpbenchError
from cpbench.foundation.text import counted, on_one_line

RESULTS, VERSIONS, README, ELSEWHERE = "results.sqlite", "versions.txt", "README.md", "elsewhere"


@click.command(cls=Command)
@click.argument("results", type=PATH)
@click.option("-o", "--output", required=True, type=FILE, help="Zip file.")
@force_option
def command(results: Path, output: Path, force: bool) -> None:
    """Put a run and what repeats it into one zip file: results, problem files, versions of the installed packages, and
    the command, with a README that says how to repeat it.

    Plan and plugins that the command names are included; built-in problems and files of collections of others (cpbench
    collection) are not. The file contains names of hosts and folders.
    """
    if output.exists() and not force:
        raise CpbenchError(f"{output}: exists already: --force replaces it")
    with Store(results) as store:
        meta, remarks = store.meta(), problem_files.changed(store)
    command = str(meta.get("command", ""))
    names, absent = _names([*(meta.get("files") or {}), *_files_named(command)], results)
    with closing(sqlite3.connect(results)) as database:
        rows = database.serialize()
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=output.name) as folder:
        with zipfile.ZipFile(Path(folder) / output.name, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(README, _readme(meta, command, names, [*absent, *remarks]))
            archive.writestr(VERSIONS, _versions())
            archive.writestr(RESULTS, rows)
            for path, name in names.items():
                archive.write(path, name)
        os.replace(Path(folder) / output.name, output)
    print_lines([*absent, *remarks], err=True)
    print_lines([f"bundle: {output} ({counted(len(names), 'file')} beside the results)"])


def _files_named(command: str) -> list[str]:
    """Return the words of a command that are files: its plan, its plugins, its problems."""
    words = [word.partition("=")[2] if word.startswith("--") and "=" in word else word for word in shlex.split(command)]
    return [word for word in words if Path(word).is_file()]


def _names(files: Iterable[str], results: Path) -> tuple[dict[Path, str], list[str]]:
    """Return the names of files in the archive, and a line for each that is not in it.

    A relative path is one from here, or from the folder of the results.
    """
    from cpbench.generators.collection import builtin_folder
    from cpbench.storage.collections import added

    names: dict[Path, str] = {}
    absent: list[str] = []
    for file in sorted(set(files)):
        path = Path(file) if Path(file).exists() else results.parent / file
        where = path.resolve()
        if where == results.resolve() or where.is_relative_to(builtin_folder().resolve()):
            continue
        if where.is_relative_to(added.home().resolve()):
            absent.append(f"not in the bundle: {file}, of a collection of others (cpbench collection)")
        elif not path.is_file():
            absent.append(f"not in the bundle: {file}, which is not there any more")
        elif Path(file).is_absolute() or ".." in Path(file).parts:
            names[path] = f"{ELSEWHERE}/{len(names)}-{path.name}"
        else:
            names[path] = Path(file).as_posix()
    return names, absent


def _versions() -> str:
    """Return Python and the installed packages, as `pip freeze` has them."""
    installed = sorted({f"{one.name}=={one.version}" for one in importlib.metadata.distributions()}, key=str.lower)
    return "\n".join([f"# Python {platform.python_version()}, {platform.platform()}", *installed, ""])


def _readme(meta: Mapping[str, Any], command: str, names: Mapping[Path, str], remarks: Iterable[str]) -> str:
    """Return how to repeat the run."""
    elsewhere = {path: name for path, name in names.items() if name.startswith(f"{ELSEWHERE}/")}
    moved = [f"- `{name}` was `{path}`: give the command the new path." for path, name in elsewhere.items()]
    lines = [
        "# How to repeat this run",
        "",
        f"1. Install Python and the packages of `{VERSIONS}`; cpbench was {meta.get('cpbench', 'of unknown version')}.",
        "2. In the folder of this file, run the command below with another file behind `-o`:",
        "",
        f"        {on_one_line(command)}",
        "",
        f"3. `cpbench compare {RESULTS} AGAIN.sqlite` compares status, error and time of every pair. A pair that ran",
        "   into a limit may end otherwise on another machine. Plugins are code of the author: read them first.",
        "",
        *(on_one_line(line) for line in [*moved, *(f"- {remark}" for remark in remarks)]),
    ]
    return "\n".join(lines).rstrip() + "\n"
