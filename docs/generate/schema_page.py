"""The page of the file schemas: what modules that read and write them say, and the columns of a results file."""

from __future__ import annotations

import inspect
import sqlite3

from page_parts import table, verbatim

from cpbench.bench.planning import plan_file, run_plan
from cpbench.bench.results import database
from cpbench.solvers.external import declared
from cpbench.storage import annotations, hdf5_points, native


def page() -> str:
    """Return the schemas of problem files, results files, plans and tables of solvers."""
    parts = ["# File schemas", "## Problems: HDF5"]
    parts += [verbatim(inspect.getdoc(module) or "") for module in (native, annotations, hdf5_points)]
    parts += [
        "## Results: SQLite",
        f"Version {database.SCHEMA}. {' '.join((database.__doc__ or '').split(chr(10) * 2, 1)[1].split())}",
        "Numbers are SI units: seconds, bytes. Text in `sizes`, `options`, `parts`, `counters`, `samples` and `flags` "
        "is JSON or a list of words.",
        *_tables(),
        "## Plans: TOML",
        verbatim(inspect.getdoc(plan_file) or ""),
        f"Keys of a run: {_code(run_plan.RUN_SETTINGS)}.",
        f"Keys of a set: {_code(run_plan.SET_SETTINGS)}. `cpbench run --help` explains each.",
        "## Declared solvers: TOML",
        verbatim(inspect.getdoc(declared) or ""),
    ]
    return "\n\n".join(parts)


def _tables() -> list[str]:
    """Read the tables from an empty file, so that the page cannot differ from what is written."""
    db = sqlite3.connect(":memory:")
    try:
        database.create(db)
        names = [name for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY rowid")]
        columns = {name: db.execute(f'PRAGMA table_info("{name}")').fetchall() for name in names}
    finally:
        db.close()
    return [
        f"### {name}\n\n"
        + table(["column", "type", "key"], ([f"`{c[1]}`", c[2], "yes" if c[5] else ""] for c in found))
        for name, found in columns.items()
    ]


def _code(names: tuple[str, ...]) -> str:
    return ", ".join(f"`{name}`" for name in names)
