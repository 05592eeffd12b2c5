"""Opens, refuses, writes and reads the SQLite file of results.

One process writes, by a lock that ends with it; any number of others read, and leave the file as it is. Beside the
rows, with answers, histories and certificates by their key, the file has the features of the problems, the data of
problems of which an answer has a proof, reference solves, the machines, the refused files, and facts of the run in
`meta`.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
import threading
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cpbench.bench.results.rows import MEASURED, PLANNED
from cpbench.errors import StoreError
from cpbench.foundation.locks import Held, Lock

SCHEMA = 1
"""The version of the tables."""
PATIENCE = 30.0
"""Seconds to wait for another program that holds the database for a moment."""
_COLUMNS = ", ".join(
    f'"{name}" {kind}{" PRIMARY KEY" if name == "key" else ""}' for name, kind in {**PLANNED, **MEASURED}.items()
)
_TABLES = (
    f"CREATE TABLE rows ({_COLUMNS})",
    "CREATE TABLE answers (key TEXT PRIMARY KEY REFERENCES rows(key), bytes INTEGER NOT NULL, answer BLOB NOT NULL)",
    "CREATE TABLE histories (key TEXT PRIMARY KEY REFERENCES rows(key), history BLOB NOT NULL)",
    "CREATE TABLE certificates (key TEXT PRIMARY KEY REFERENCES rows(key), kind TEXT NOT NULL, proof BLOB NOT NULL)",
    "CREATE TABLE problems (fingerprint TEXT PRIMARY KEY, features TEXT NOT NULL)",
    "CREATE TABLE reference (at TEXT NOT NULL, pairs INTEGER NOT NULL, seconds REAL, loadavg REAL)",
    "CREATE TABLE machines (host TEXT PRIMARY KEY, description TEXT NOT NULL)",
    "CREATE TABLE refused (address TEXT PRIMARY KEY, reason TEXT NOT NULL)",
    "CREATE TABLE meta (name TEXT PRIMARY KEY, value TEXT NOT NULL)",
    "CREATE INDEX answers_bytes ON answers(bytes)",  # their sum, without reading an answer
    "CREATE INDEX rows_status ON rows(status)",  # what is left to run, without reading the rows
    f"PRAGMA user_version={SCHEMA}",
)


def create(db: sqlite3.Connection) -> None:
    """Make the tables, within the caller's transaction."""
    for statement in _TABLES:
        db.execute(statement)


class Database:
    """An open results file: for writing (`create=True`), which only this process may do then, or for reading. May be
    used from several threads.

    Raises StoreError when the file is not a results file, is of another version, is being written by another process or
    cannot be written, and for writing also where it is damaged; from every method when SQLite fails.
    """

    def __init__(self, path: Path, *, create: bool = False) -> None:
        self.path = path
        self._real = Path(os.path.realpath(path))
        """The path without links: SQLite's helper files are beside it."""
        self._guard = threading.RLock()
        self._lock: Lock | None = None
        self._db: sqlite3.Connection | None = None
        self._examine(create)
        try:
            with self._errors_explained():
                if create:
                    self._lock = _locked(path)
                    self._open_to_write()
                else:
                    self._open_to_read()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the file and let others write it; harmless when done before."""
        db, self._db = self._db, None
        if db is not None:
            with contextlib.suppress(sqlite3.Error):  # what is committed is safe in the log
                db.close()
        lock, self._lock = self._lock, None
        if lock is not None:
            lock.release()

    @property
    def connection(self) -> sqlite3.Connection:
        """The connection of SQLite; raises StoreError when the file was closed."""
        if self._db is None:
            raise StoreError(f"{self.path}: was closed")
        return self._db

    @contextmanager
    def transaction(self) -> Generator[sqlite3.Connection]:
        """Write within this context all or nothing."""
        db = self.connection
        with self._guard, self._errors_explained():
            db.execute("BEGIN IMMEDIATE")
            try:
                yield db
                db.execute("COMMIT")
            except BaseException:
                with contextlib.suppress(sqlite3.Error):  # on a full disk SQLite has rolled back already
                    db.execute("ROLLBACK")
                raise

    def read(self, query: str, parameters: Iterable[Any] = ()) -> list[tuple[Any, ...]]:
        """Return all rows of a query."""
        with self._guard, self._errors_explained():
            return self.connection.execute(query, tuple(parameters)).fetchall()

    def stream(self, query: str) -> Iterator[tuple[Any, ...]]:
        """Yield rows of a query without holding all of them."""
        for rows in self.chunks(query, 256):
            yield from rows

    def chunks(self, query: str, size: int) -> Iterator[list[tuple[Any, ...]]]:
        """Yield rows of a query, so many at a time."""
        with self._errors_explained():
            cursor = self.connection.execute(query)
        while True:
            with self._errors_explained():
                rows = cursor.fetchmany(size)
            if not rows:
                return
            yield rows

    def settle(self) -> None:
        """Move what is in SQLite's log into the file; raises StoreError when that fails, where `close` would leave the
        log."""
        with self._guard, self._errors_explained():
            self.connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")

    def require_whole(self) -> None:
        """Check the file; raises StoreError when its pages are inconsistent."""
        (state,) = self.read("PRAGMA quick_check(1)")[0]
        if state != "ok":
            one_line = " ".join(str(state).split())
            raise _explained(self.path, sqlite3.DatabaseError(one_line), sqlite3.SQLITE_CORRUPT)

    @contextmanager
    def _errors_explained(self) -> Generator[None]:
        """Turn exceptions of SQLite, and of values that it cannot store, into a StoreError with the cause."""
        try:
            yield
        except UnicodeDecodeError as cause:  # of a name in the schema, as sqlite3 hands it on
            raise _explained(self.path, sqlite3.DatabaseError(str(cause)), sqlite3.SQLITE_CORRUPT) from cause
        except (sqlite3.Error, OverflowError) as cause:
            raise _explained(self.path, cause) from cause

    # -------------------------------------------------------------------------------------------- open

    def _examine(self, create: bool) -> None:
        """Raise StoreError for anything but a results file, before it or files beside it are touched.

        Only SQLite opens the file: a plain open and close would release the locks that another connection of this
        process has on it.
        """
        path = self.path
        if path.is_dir():
            raise StoreError(f"{path}: is a folder, not a results file; name a file in it")
        if path.exists() and not path.is_file():
            raise StoreError(f"{path}: is not a regular file; name another with -o")
        if not path.exists() and not create:
            raise StoreError(f"{path}: no such results file; make one with: cpbench run PROBLEMS -o {path}")
        if not path.parent.is_dir():
            raise StoreError(f"{path}: there is no folder {path.parent}; make it first")
        if path.exists():
            with self._errors_explained(), contextlib.closing(self._connect("immutable=1")) as db:
                try:
                    self._require_version(db)
                except sqlite3.DatabaseError as cause:
                    if cause.sqlite_errorcode & 0xFF != sqlite3.SQLITE_CORRUPT:
                        raise
                    # a full disk may leave the file half way to its log; it is whole when read together with that

    def _require_version(self, db: sqlite3.Connection) -> int:
        """Return the version of the tables, 0 of an empty file; raises StoreError where it is not ours."""
        version = int(db.execute("PRAGMA user_version").fetchone()[0])
        tables = {name for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if version == 0 and not tables:
            return 0
        if version == 0 or not tables >= {"rows", "answers", "meta"}:
            raise StoreError(f"{self.path}: not a results file (a database of something else); name another file")
        if version != SCHEMA:
            raise StoreError(
                f"{self.path}: has results schema {version}, this cpbench knows {SCHEMA} only; use the cpbench that "
                "made it, or another file with -o"
            )
        return version

    def _open_to_write(self) -> None:
        """Open with a write-ahead log, or with a rollback journal where the file system has no memory for readers to
        share.

        A commit survives kill -9 either way; on a power cut the last rows may be lost, the file stays whole. An fsync
        a row would cost milliseconds.
        """
        db = self._db = self._connect("mode=rwc")
        version = self._require_version(db)
        db.execute("PRAGMA journal_mode=WAL")
        db.execute("PRAGMA synchronous=NORMAL")
        db.execute("PRAGMA temp_store=MEMORY")
        db.execute("PRAGMA wal_autocheckpoint=4000")  # 16 MB: a page that several rows share is moved once
        if version == 0:
            with self.transaction() as db:
                create(db)
        self.require_whole()

    def _open_to_read(self) -> None:
        """Open as for writing, but only read: SQLite then uses the log of a killed run, and leaves no helper files."""
        try:
            self._db = self._connect("mode=rw")
            version = self._require_version(self._db)
        except sqlite3.OperationalError as cause:
            if cause.sqlite_errorcode & 0xFF == sqlite3.SQLITE_BUSY:
                raise
            self._db = self._connect_unwritable()
            version = self._require_version(self._db)
        self.connection.execute("PRAGMA query_only=ON")
        if version == 0:
            raise StoreError(f"{self.path}: is empty, not a results file")

    def _connect_unwritable(self) -> sqlite3.Connection:
        """Open the file unchanged where SQLite cannot make helper files (a read-only folder, a full disk)."""
        if self._db is not None:
            self._db.close()
        for log in (Path(f"{self._real}-wal"), Path(f"{self._real}-journal")):
            if log.exists() and log.stat().st_size:
                raise StoreError(
                    f"{self.path}: is in a folder that cannot be written, with the log of a killed run: copy it and "
                    f"{log.name} into another folder, and read it there"
                )
        return self._connect("immutable=1")

    def _connect(self, how: str) -> sqlite3.Connection:
        address = f"{self._real.as_uri()}?{how}"
        return sqlite3.connect(address, uri=True, isolation_level=None, timeout=PATIENCE, check_same_thread=False)


def _explained(path: Path, cause: Exception, code: int = 0) -> StoreError:
    """Return an error in one line: the file, the cause, what to do. `code` : of SQLite, where the cause has none."""
    code = getattr(cause, "sqlite_errorcode", code) & 0xFF
    kept = "what was finished is kept, and the same command goes on"
    causes = {
        sqlite3.SQLITE_FULL: f"no room is left to write it ({cause}); make room: {kept}",
        sqlite3.SQLITE_IOERR: f"could not be read or written ({cause}); see to the disk: {kept}",
        sqlite3.SQLITE_READONLY: f"cannot be written ({cause}); name a file in another folder with -o",
        sqlite3.SQLITE_CANTOPEN: f"cannot be opened ({cause}); see to its folder, or name another file with -o",
        sqlite3.SQLITE_CORRUPT: f"is damaged ({cause}); go on with another file (-o), and save what can be read with: "
        f"sqlite3 {path} .recover",
        sqlite3.SQLITE_NOTADB: f"not a results file ({cause}); name another file",
        sqlite3.SQLITE_BUSY: f"is held by another program ({cause}); end that program, or use another file with -o",
    }
    return StoreError(f"{path}: {causes.get(code, f'SQLite failed: {cause}')}")


def _locked(path: Path) -> Lock:
    """Lock a results file for writing; raises StoreError."""
    try:
        return Lock(path)
    except Held as holder:
        raise StoreError(f"{path}: {holder}; wait for it, or use another file with -o") from None
    except OSError as cause:
        why = cause.strerror or cause
        raise StoreError(f"{path}: cannot be written ({why}); name a file in another folder with -o") from None
