"""Opens, checks, writes and reads the SQLite file of results.

One process writes, by a lock that ends with it; any number of others read, and leave the file as it is.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sqlite3
import tempfile
import threading
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cpbench.bench.results import schema
from cpbench.bench.results.schema import SCHEMA
from cpbench.errors import SealError, StoreError
from cpbench.foundation.locks import Held, Lock

PATIENCE = 30.0
"""Seconds to wait for another program that holds the database for a moment."""
REMOTE = {"nfs", "nfs4", "cifs", "smb3", "9p", "afs", "ceph", "lustre", "gpfs", "beegfs", "fuse.sshfs"}
"""File systems that other machines write to: SQLite's write-ahead log needs memory that all its readers share."""


class Database:
    """An open results file, with the tables of this version.

    For writing (`create=True`) this process alone may write it, and an older file is migrated; for reading, an older
    one is migrated in memory. May be used from several threads.

    Raises StoreError when the file is not a results file, is of a newer version, is being written by another process or
    cannot be written; SealError when it has a trigger, a view, a table or an index that no run makes; from every
    method StoreError, when SQLite fails.
    """

    def __init__(self, path: Path, *, create: bool = False) -> None:
        self._path = path
        self._real = Path(os.path.realpath(path))
        """The path without links: SQLite's helper files are beside it."""
        self._guard = threading.RLock()
        self._lock: Lock | None = None
        self._db: sqlite3.Connection | None = None
        self._copy: tempfile.TemporaryDirectory[str] | None = None
        self.found = 0
        """The version of the tables when the file was opened, 0 where there were none."""
        self._layout = -1
        """SQLite's number of the layout of the tables that was checked last; it goes up with every change of that."""
        self._examine(create)
        try:
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
        if self._copy is not None:
            self._copy.cleanup()

    @property
    def closed(self) -> bool:
        """Whether the file was closed."""
        return self._db is None

    @property
    def connection(self) -> sqlite3.Connection:
        """The connection of SQLite; raises StoreError when the file was closed."""
        if self._db is None:
            raise StoreError(f"{self._path}: was closed")
        return self._db

    @property
    def file(self) -> Path | None:
        """The file from which others read the same rows; None while this process writes, or has them in memory."""
        name = str(self.connection.execute("PRAGMA database_list").fetchone()[2])
        return Path(name) if name and self._lock is None else None

    @contextmanager
    def transaction(self) -> Generator[sqlite3.Connection]:
        """Write within this context all or nothing; raises SealError where the tables are not those of a run."""
        db = self.connection
        with self._guard, self._errors_explained():
            db.execute("BEGIN IMMEDIATE")
            try:
                self._require_layout(db)
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
            raise _explained(self._path, sqlite3.DatabaseError(one_line), sqlite3.SQLITE_CORRUPT)

    def _require_layout(self, db: sqlite3.Connection) -> None:
        """Check the tables where another program may have changed them since they were checked last."""
        (layout,) = db.execute("PRAGMA schema_version").fetchone()
        if layout != self._layout:
            schema.require_exact(db)
            self._layout = layout

    @contextmanager
    def _errors_explained(self) -> Generator[None]:
        """Turn exceptions of SQLite, and of values that it cannot store, into a StoreError with the cause."""
        try:
            yield
        except schema.Unexpected as cause:
            raise SealError(
                f"{self._path}: {cause}: another program changed the file, so that none of its rows is believed; "
                "remove what was added, or use another file with -o"
            ) from None
        except UnicodeDecodeError as cause:  # of a name in the schema, as sqlite3 hands it on
            raise _explained(self._path, sqlite3.DatabaseError(str(cause)), sqlite3.SQLITE_CORRUPT) from cause
        except (sqlite3.Error, OverflowError) as cause:
            raise _explained(self._path, cause) from cause

    # -------------------------------------------------------------------------------------------- open

    def _examine(self, create: bool) -> None:
        """Raise StoreError for anything but a results file, before it or files beside it are touched.

        Only SQLite opens the file: a plain open and close would release the locks that another connection of this
        process has on it.
        """
        path = self._path
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
                    self._require(int(db.execute("PRAGMA user_version").fetchone()[0]))
                except sqlite3.DatabaseError as cause:
                    if cause.sqlite_errorcode & 0xFF != sqlite3.SQLITE_CORRUPT:
                        raise
                    # a full disk may leave the file half way to its log; it is whole when read together with that

    def _require(self, version: int | None) -> int:
        if version is None:
            raise StoreError(f"{self._path}: not a results file (a database of something else); name another file")
        if version > SCHEMA:
            raise StoreError(
                f"{self._path}: has results schema {version}, this cpbench knows {SCHEMA}; update cpbench, or use "
                "another file with -o"
            )
        return version

    def _open_to_write(self) -> None:
        with self._errors_explained():
            db = self._db = self._connect("mode=rwc")
            self.found = version = self._require(schema.version(db))
            use_journal(db, self._path)
            db.execute("PRAGMA temp_store=MEMORY")
            db.execute("PRAGMA wal_autocheckpoint=4000")  # 16 MB: a page that several rows share is moved once
            if version == 0:
                db.execute("BEGIN IMMEDIATE")
                schema.create(db)
                db.execute("COMMIT")
            elif version < SCHEMA:
                schema.require_known(db)
                schema.migrate(db, version)
            self._require_layout(db)

    def _open_to_read(self) -> None:
        """Open as for writing, but only read: SQLite then uses the log of a killed run, and leaves no helper files."""
        with self._errors_explained():
            try:
                self._db = self._connect("mode=rw")
                version = schema.version(self._db)
            except sqlite3.OperationalError as cause:
                if cause.sqlite_errorcode & 0xFF == sqlite3.SQLITE_BUSY:
                    raise
                self._open_unwritable()
                version = schema.version(self.connection)
            self.found = version = self._require(version)
            self.connection.execute("PRAGMA query_only=ON")
            if version == 0:
                raise StoreError(f"{self._path}: is empty, not a results file")
            if version < SCHEMA:
                schema.require_known(self.connection)
                old, self._db = self.connection, sqlite3.connect("", isolation_level=None, check_same_thread=False)
                old.backup(self._db)
                old.close()
                schema.migrate(self._db, version)
            self._require_layout(self.connection)

    def _open_unwritable(self) -> None:
        """Open the file unchanged where SQLite cannot make helper files (a read-only folder, a full disk), or a copy of
        file and log where a killed run left a log."""
        if self._db is not None:
            self._db.close()
        logs = [path for path in (Path(f"{self._real}-wal"), Path(f"{self._real}-journal")) if path.exists()]
        if not any(path.stat().st_size for path in logs):
            self._db = self._connect("immutable=1")
            return
        self._copy = tempfile.TemporaryDirectory(prefix="cpbench-results-")
        try:
            for path in (self._real, *logs):
                shutil.copyfile(path, Path(self._copy.name) / path.name)
        except OSError as cause:
            raise StoreError(
                f"{self._path}: is in a folder that cannot be written, with the log of a killed run, and no copy of "
                f"them can be made in {self._copy.name} ({cause.strerror})"
            ) from None
        self._db = self._connect("mode=rw", Path(self._copy.name) / self._real.name)

    def _connect(self, how: str, path: Path | None = None) -> sqlite3.Connection:
        address = f"{(path or self._real).as_uri()}?{how}"
        return sqlite3.connect(address, uri=True, isolation_level=None, timeout=PATIENCE, check_same_thread=False)


def use_journal(db: sqlite3.Connection, path: Path) -> str:
    """Use a write-ahead log where readers share memory, else a rollback journal; return the mode.

    A commit survives kill -9 either way; on a power cut the last rows may be lost, the file stays whole. An fsync
    a row would cost milliseconds.
    """
    db.execute("PRAGMA synchronous=NORMAL")
    if _file_system(path) not in REMOTE:
        mode = str(db.execute("PRAGMA journal_mode=WAL").fetchone()[0])
        if mode == "wal":
            return mode
    return str(db.execute("PRAGMA journal_mode=TRUNCATE").fetchone()[0])


def _file_system(path: Path) -> str:
    """Return the type of the file system of `path`, '' where the system does not tell."""
    try:
        mounts = [line.split() for line in Path("/proc/self/mounts").read_text().splitlines()]
    except OSError:
        return ""
    folder = os.path.dirname(os.path.realpath(path))
    mount, kind = "", ""
    for _, point, name, *_ in mounts:
        point = point.replace("\\040", " ")
        if len(point) >= len(mount) and f"{folder}/".startswith(f"{point.rstrip('/')}/"):
            mount, kind = point, name
    return kind


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
