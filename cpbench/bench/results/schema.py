"""Tables of a results file, by version, and the migration of older files.

Version 1 had one set of limits a file, in `meta`; since version 2 they are columns of every row, and histories,
reference solves and machines have tables of their own. Version 3 keeps the features of the problems, version 4
certificates of what has no solution, seals of the rows, and the tolerance that a solver was asked for, version 5 how
certain the answers are, version 6 how many problems a call solved, version 7 the data of problems of which answers have
a proof, version 8 the clocks of served solvers, version 9 a seal over the whole file, and whose key sealed a row first.
"""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from functools import cache

from cpbench.bench.results.rows import Measured, Planned, columns
from cpbench.foundation.plain_text import printable

SCHEMA = 9
SEALED_SINCE = 4
WHOLE_SINCE = 9
"""The first version with a seal over the whole file."""

PLANNED, MEASURED = columns(Planned), columns(Measured)
"""Columns of a row that the plan fixes, and those that the run fills, with their SQL types."""
_OURS = {"rows", "answers", "meta"}
_COLUMNS = ", ".join(
    f'"{name}" {kind}{" PRIMARY KEY" if name == "key" else ""}' for name, kind in {**PLANNED, **MEASURED}.items()
)
_SHARED_WITH_1 = (
    "CREATE TABLE refused (address TEXT PRIMARY KEY, reason TEXT NOT NULL)",
    "CREATE TABLE meta (name TEXT PRIMARY KEY, value TEXT NOT NULL)",
)
_NEW_IN_2 = (
    f"CREATE TABLE rows ({_COLUMNS})",
    "CREATE TABLE answers (key TEXT PRIMARY KEY REFERENCES rows(key), bytes INTEGER NOT NULL, answer BLOB NOT NULL)",
    "CREATE TABLE histories (key TEXT PRIMARY KEY REFERENCES rows(key), history BLOB NOT NULL)",
    "CREATE TABLE reference (at TEXT NOT NULL, pairs INTEGER NOT NULL, seconds REAL, loadavg REAL)",
    "CREATE TABLE machines (host TEXT PRIMARY KEY, description TEXT NOT NULL)",
    "CREATE INDEX answers_bytes ON answers(bytes)",  # their sum, without reading an answer
    "CREATE INDEX rows_status ON rows(status)",  # what is left to run, without reading the rows
)
_NEW_IN_3 = ("CREATE TABLE problems (fingerprint TEXT PRIMARY KEY, features TEXT NOT NULL)",)
_NEW_IN_4 = (
    "CREATE TABLE certificates (key TEXT PRIMARY KEY REFERENCES rows(key), kind TEXT NOT NULL, proof BLOB NOT NULL)",
    "CREATE TABLE seals (key TEXT PRIMARY KEY REFERENCES rows(key), seal TEXT NOT NULL)",
)
_NEW_IN_7 = ("CREATE TABLE proved_problems (fingerprint TEXT PRIMARY KEY, data BLOB NOT NULL)",)
_NEW_IN_9 = ("CREATE TABLE file_seal (one INTEGER PRIMARY KEY, seal TEXT NOT NULL)",)
_LAYOUT = "SELECT type, name, tbl_name, coalesce(sql, '') FROM sqlite_master"


def create(db: sqlite3.Connection) -> None:
    """Make the tables of this version, within the caller's transaction."""
    made = (*_SHARED_WITH_1, *_NEW_IN_2, *_NEW_IN_3, *_NEW_IN_4, *_NEW_IN_7, *_NEW_IN_9)
    for statement in (*made, f"PRAGMA user_version={SCHEMA}"):
        db.execute(statement)


@cache
def _expected() -> frozenset[tuple[str, str, str, str]]:
    """Return type, name, table and statement of everything that is in a results file of this version."""
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as db:
        create(db)
        return frozenset(db.execute(_LAYOUT))


class Unexpected(Exception):
    """Something in a file that no run makes: a trigger or a view could hand back other values than were written."""


def require_known(db: sqlite3.Connection) -> None:
    """Raise Unexpected where a file of any version has something that no version makes, judged by type and name."""
    known = {one[:2] for one in _expected()}
    _require(frozenset(one for one in db.execute(_LAYOUT) if one[:2] not in known))


def require_exact(db: sqlite3.Connection) -> None:
    """Raise Unexpected where a file of this version has not exactly the tables and indexes that a run makes."""
    _require(frozenset(db.execute(_LAYOUT)) ^ _expected())


def _require(differing: frozenset[tuple[str, str, str, str]]) -> None:
    """Raise Unexpected with the first of the differences."""
    names = {one[:2] for one in _expected()}
    # what was added explains more than what was changed
    for kind, name in sorted({one[:2] for one in differing}, key=lambda one: (one in names, one)):
        how = "is not as a run makes it" if (kind, name) in names else "is made by no run"
        raise Unexpected(f"its {kind} {printable(name)} {how}")


def version(db: sqlite3.Connection) -> int | None:
    """Return the version of a file's tables: 0 for an empty file, None for one of something else."""
    tables = {name for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    version = int(db.execute("PRAGMA user_version").fetchone()[0])
    if not tables and version == 0:
        return 0
    return version if version > 0 and tables >= _OURS else None


def migrate(db: sqlite3.Connection, found: int) -> None:
    """Migrate the tables of version `found`, in one transaction: a file has its old tables or the new."""
    db.execute("BEGIN IMMEDIATE")
    try:
        for step in _STEPS[found - 1 :]:
            step(db)
        require_exact(db)
        db.execute(f"PRAGMA user_version={SCHEMA}")
    except BaseException:
        db.execute("ROLLBACK")
        raise
    db.execute("COMMIT")


def _from_1(db: sqlite3.Connection) -> None:
    """Make the tables again rather than alter them: a migrated file has the columns in the order of a new one."""
    meta = {name: json.loads(value) for name, value in db.execute("SELECT name, value FROM meta")}
    old = [name for _, name, *_ in db.execute("PRAGMA table_info(rows)")]
    db.execute("ALTER TABLE answers RENAME TO answers_1")
    db.execute("ALTER TABLE rows RENAME TO rows_1")
    for statement in _NEW_IN_2:
        db.execute(statement)
    columns = ", ".join(f'"{name}"' for name in old)
    db.execute(
        f'INSERT INTO rows ({columns}, "set", sequence, step, seconds, memory, repeats_asked)'
        f" SELECT {columns}, '', '', 0, ?, ?, ? FROM rows_1",
        (meta.get("timeout"), meta.get("memory"), meta.get("repeats")),
    )
    db.execute(
        "UPDATE rows SET attempts = 1, started = 'cold', jobs = ? WHERE status <> 'not_run'", (meta.get("jobs"),)
    )
    db.execute("INSERT INTO answers SELECT key, length(answer), answer FROM answers_1")
    db.execute("DROP TABLE answers_1")
    db.execute("DROP TABLE rows_1")


def _from_2(db: sqlite3.Connection) -> None:
    """Add the table of features, which is empty for older rows."""
    for statement in _NEW_IN_3:
        db.execute(statement)


def _from_3(db: sqlite3.Connection) -> None:
    """Add certificates and seals, which older rows do not have, as readers report. What tolerance they asked of a
    converted problem is unknown, so that their statuses stay."""
    for statement in _NEW_IN_4:
        db.execute(statement)
    if "target_tolerance" not in {name for _, name, *_ in db.execute("PRAGMA table_info(rows)")}:
        db.execute('ALTER TABLE rows ADD COLUMN "target_tolerance" REAL')


def _from_4(db: sqlite3.Connection) -> None:
    """Answers of older rows have no certificates; seals do not count columns without a value."""
    there = {name for _, name, *_ in db.execute("PRAGMA table_info(rows)")}
    for name, kind in (("certainty", "TEXT"), ("distance", "REAL"), ("certificate", "TEXT")):
        if name not in there:
            db.execute(f'ALTER TABLE rows ADD COLUMN "{name}" {kind}')


def _from_5(db: sqlite3.Connection) -> None:
    """Older rows are each of a call of their own, and no set asked for throughput."""
    if "batch" not in {name for _, name, *_ in db.execute("PRAGMA table_info(rows)")}:
        db.execute('ALTER TABLE rows ADD COLUMN "batch" INTEGER')


def _from_6(db: sqlite3.Connection) -> None:
    """Certified answers of older rows have no proof; `certify` looks for what is not certified only."""
    for statement in _NEW_IN_7:
        db.execute(statement)


def _from_7(db: sqlite3.Connection) -> None:
    """Add the clocks of served solvers. The solve of an older row is what passed in the worker."""
    there = {name for _, name, *_ in db.execute("PRAGMA table_info(rows)")}
    for name in ("trip", "solve_wall"):
        if name not in there:
            db.execute(f'ALTER TABLE rows ADD COLUMN "{name}" REAL')


def _from_8(db: sqlite3.Connection) -> None:
    """Add the seal over the whole file, which older files do not have, as readers report. Older rows do not tell whose
    key sealed them before the present one."""
    for statement in _NEW_IN_9:
        db.execute(statement)
    if "sealed_by" not in {name for _, name, *_ in db.execute("PRAGMA table_info(rows)")}:
        db.execute('ALTER TABLE rows ADD COLUMN "sealed_by" TEXT')


_STEPS = (_from_1, _from_2, _from_3, _from_4, _from_5, _from_6, _from_7, _from_8)
"""From version 1 to 2, from 2 to 3, ..."""
