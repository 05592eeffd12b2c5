"""Results in one SQLite file: a transaction a row, the answer in the same transaction.

`kill -9` of the runner loses at most the pair in flight: planned rows are there from the start as `not_run`,
and a row is filled together with its answer or not at all.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.bench.plan import Pair
from cpbench.errors import StoreError

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = 1
KEEP = ("none", "wrong", "all")
KEEP_LIMIT = 10**9
"""Bytes of answers after which `--keep all` stops keeping; rows without their answer say so."""

PLANNED = (
    "key", "problem", "address", "fingerprint", "node", "family", "sizes", "solver", "label", "request",
    "options", "tolerance", "start", "threads",
)  # fmt: skip
MEASURED = (
    "status", "route", "kind", "claim", "error", "flags", "message", "parts", "counters", "load", "convert",
    "setup", "solve", "lift", "verify", "cpu", "repeats", "solve_min", "solve_iqr", "signal", "version", "finished",
)  # fmt: skip
_NUMBERS = {
    "tolerance",
    "error",
    "load",
    "convert",
    "setup",
    "solve",
    "lift",
    "verify",
    "cpu",
    "solve_min",
    "solve_iqr",
}
_INTEGERS = {"threads", "repeats", "signal"}


class Store:
    """A results file, opened for running (`create=True`) or for reading.

    Raises StoreError when the file is no results file of this schema.
    """

    def __init__(self, path: str | Path, *, create: bool = False, keep: str = "all") -> None:
        self.path = Path(path)
        if not create and not self.path.exists():
            raise StoreError(f"{self.path}: no such results file; make one with: cpbench run PROBLEMS -o {self.path}")
        try:
            self._db = sqlite3.connect(self.path, isolation_level=None, timeout=5.0)
            found = self._db.execute("PRAGMA user_version").fetchone()[0]
            self._db.execute("PRAGMA synchronous=NORMAL")  # a commit survives kill -9; an fsync a row costs 4 ms
            empty = not self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        except sqlite3.Error as cause:
            raise StoreError(f"{self.path}: not a results file ({cause})") from None
        if empty and create:
            self._make()
        elif found != SCHEMA:
            raise StoreError(
                f"{self.path}: has results schema {found}, this cpbench reads {SCHEMA}; use another file with -o"
            )
        self._keep = keep
        self._kept = int(self._db.execute("SELECT coalesce(sum(length(answer)), 0) FROM answers").fetchone()[0])

    def _make(self) -> None:
        columns = ", ".join(
            f'"{c}" {"REAL" if c in _NUMBERS else "INTEGER" if c in _INTEGERS else "TEXT"}'
            + (" PRIMARY KEY" if c == "key" else "")
            for c in (*PLANNED, *MEASURED)
        )
        self._db.executescript(
            f"PRAGMA journal_mode=WAL; BEGIN; CREATE TABLE rows ({columns});"
            "CREATE TABLE answers (key TEXT PRIMARY KEY REFERENCES rows(key), answer BLOB NOT NULL);"
            "CREATE TABLE refused (address TEXT PRIMARY KEY, reason TEXT NOT NULL);"
            "CREATE TABLE meta (name TEXT PRIMARY KEY, value TEXT NOT NULL);"
            f"PRAGMA user_version={SCHEMA}; COMMIT;"
        )

    def close(self) -> None:
        self._db.close()

    @contextmanager
    def _transaction(self) -> Generator[None]:
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")

    # ------------------------------------------------------------------------------------------- write

    def set_meta(self, **values: Any) -> None:
        with self._transaction():
            self._db.executemany(
                "INSERT INTO meta VALUES (?, ?) ON CONFLICT(name) DO UPDATE SET value = excluded.value",
                [(name, json.dumps(value)) for name, value in values.items()],
            )

    def note_files(self, loaded: Iterable[str], refused: Iterable[tuple[str, str]]) -> None:
        """Note which files could not be read, and why; those that are read now are refused no longer."""
        with self._transaction():
            self._db.executemany("DELETE FROM refused WHERE address = ?", [(address,) for address in loaded])
            self._db.executemany("INSERT OR REPLACE INTO refused VALUES (?, ?)", refused)

    def plan(self, pairs: Iterable[Pair]) -> None:
        """Add the rows of a plan as `not_run`; those that are there already stay as they are."""
        rows = [
            (
                p.key, p.problem, p.address, p.fingerprint, p.node, p.family, json.dumps(dict(p.sizes)), p.entry.solver,
                p.label, p.request.name, json.dumps(dict(p.entry.options), sort_keys=True), p.tolerance, p.start,
                p.threads, "not_run",
            )
            for p in pairs
        ]  # fmt: skip
        names = ", ".join(f'"{c}"' for c in (*PLANNED, "status"))
        marks = ", ".join("?" * (len(PLANNED) + 1))
        with self._transaction():
            self._db.executemany(f"INSERT OR IGNORE INTO rows ({names}) VALUES ({marks})", rows)

    def finish(self, key: str, row: Mapping[str, Any], answer: bytes | None = None) -> None:
        """Fill a planned row, with its answer, in one transaction."""
        unknown = set(row) - set(MEASURED)
        if unknown:
            raise StoreError(f"{self.path}: no column {', '.join(sorted(unknown))}")
        keep = answer is not None and self._wants(str(row.get("status", "")))
        if keep and answer is not None and self._kept + len(answer) > KEEP_LIMIT:
            row = {**row, "message": f"{row.get('message') or ''} (answer not kept: over {KEEP_LIMIT} bytes)".strip()}
            keep = False
        sets = ", ".join(f'"{c}" = ?' for c in row)
        with self._transaction():
            self._db.execute(f"UPDATE rows SET {sets} WHERE key = ?", (*row.values(), key))
            if keep and answer is not None:
                self._db.execute("INSERT OR REPLACE INTO answers VALUES (?, ?)", (key, answer))
                self._kept += len(answer)

    def _wants(self, status: str) -> bool:
        if self._keep == "wrong":
            return status in ("wrong", "inaccurate")
        return self._keep == "all"

    def rejudge(self, key: str, row: Mapping[str, Any]) -> None:
        """Overwrite measured columns of a finished row (a new measure or tolerance on the kept answer)."""
        sets = ", ".join(f'"{c}" = ?' for c in row)
        with self._transaction():
            self._db.execute(f"UPDATE rows SET {sets} WHERE key = ?", (*row.values(), key))

    # -------------------------------------------------------------------------------------------- read

    def meta(self) -> dict[str, Any]:
        """Facts of the run by name, with the refused files under `refused`."""
        values = {name: json.loads(value) for name, value in self._db.execute("SELECT name, value FROM meta")}
        values["refused"] = self._db.execute("SELECT address, reason FROM refused ORDER BY address").fetchall()
        return values

    def pending(self) -> set[str]:
        """Keys of planned rows that have not been run."""
        return {key for (key,) in self._db.execute("SELECT key FROM rows WHERE status = 'not_run'")}

    def counts(self) -> dict[str, int]:
        """Rows by status."""
        return dict(self._db.execute("SELECT status, count(*) FROM rows GROUP BY status").fetchall())

    def row(self, key: str) -> dict[str, Any]:
        """One row as a dictionary."""
        cursor = self._db.execute("SELECT * FROM rows WHERE key = ?", (key,))
        found = cursor.fetchone()
        if found is None:
            raise StoreError(f"{self.path}: no row {key}")
        return dict(zip((c[0] for c in cursor.description), found, strict=True))

    def answers(self) -> Iterator[tuple[str, bytes]]:
        """(key, compressed answer) of every kept answer."""
        yield from self._db.execute("SELECT key, answer FROM answers ORDER BY key")

    def table(self) -> pd.DataFrame:
        """All rows, in the order problem, label."""
        import pandas as pd

        cursor = self._db.execute("SELECT * FROM rows ORDER BY problem, label, key")
        frame = pd.DataFrame(cursor.fetchall(), columns=[c[0] for c in cursor.description])
        for name in _NUMBERS:
            frame[name] = pd.to_numeric(frame[name])
        frame["error"] = frame["error"].fillna(float("inf"))
        return frame


def read_results(path: str | Path) -> pd.DataFrame:
    """The rows of a results file as a table, for scripts and notebooks; raises StoreError."""
    store = Store(path)
    try:
        return store.table()
    finally:
        store.close()
