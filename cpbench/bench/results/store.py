"""Results in one SQLite file: a transaction a row, the answer and the history in the same transaction.

`kill -9` of the runner loses at most the pair in flight: planned rows are there from the start as `not_run`,
and a row is filled together with its answer or not at all. One process writes (`lock`), any number read.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import sqlite3
import tempfile
import threading
import time
from collections.abc import Collection, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.bench.planning.plan import Pair
from cpbench.bench.results import schema
from cpbench.bench.results.lock import Lock
from cpbench.bench.results.schema import MEASURED, PLANNED, SCHEMA
from cpbench.errors import StoreError

if TYPE_CHECKING:
    import pandas as pd

KEEP = ("none", "wrong", "all")
KEEP_LIMIT = 10**9
"""Bytes of answers after which `--keep all` stops keeping; rows without their answer say so."""
PATIENCE = 30.0
"""Seconds to wait for another program that holds the database for a moment."""
LIMITS = {"seconds": "timeout", "memory": "memory", "threads": "threads", "repeats_asked": "repeats"}
"""The columns of limits, by the name that an option gives them."""
REMOTE = {"nfs", "nfs4", "cifs", "smb3", "9p", "afs", "ceph", "lustre", "gpfs", "beegfs", "fuse.sshfs"}
"""File systems that other machines write to: SQLite's write-ahead log needs memory that all its readers share."""


class Store:
    """A results file, opened for running (`create=True`) or for reading.

    For running, this process alone may write it, and an older file is migrated; for reading, the file is left as it
    is, whoever writes it meanwhile. May be used from several threads.

    Raises StoreError when the file is no results file, is of a newer version, is being written by another process or
    cannot be written; from every method, when SQLite fails.
    """

    def __init__(self, path: str | Path, *, create: bool = False, keep: str = "all") -> None:
        self.path = Path(path)
        self._real = Path(os.path.realpath(path))
        """Where the file is, whatever links lead there: SQLite's helper files are beside it."""
        self._keep = keep
        self._guard = threading.RLock()
        self._lock: Lock | None = None
        self._db: sqlite3.Connection | None = None
        self._copy: tempfile.TemporaryDirectory[str] | None = None
        self._examine(create)
        try:
            if create:
                self._lock = Lock(self.path)
                self._open_to_write()
            else:
                self._open_to_read()
            self._kept = int(self._read("SELECT coalesce(sum(bytes), 0) FROM answers")[0][0])
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

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

    # -------------------------------------------------------------------------------------------- open

    def _examine(self, create: bool) -> None:
        """Refuse what is no results file before anything of it or beside it is touched.

        The file itself is opened by SQLite alone: a plain open and close would drop the locks that another connection
        of this process has on it.
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
            with self._told(), contextlib.closing(self._connect("immutable=1")) as db:
                try:
                    self._require(int(db.execute("PRAGMA user_version").fetchone()[0]))
                except sqlite3.DatabaseError as cause:
                    if cause.sqlite_errorcode & 0xFF != sqlite3.SQLITE_CORRUPT:
                        raise
                    # a full disk may leave the file half way to its log; it is whole when read together with that

    def _require(self, found: int | None) -> int:
        if found is None:
            raise StoreError(f"{self.path}: not a results file (a database of something else); name another file")
        if found > SCHEMA:
            raise StoreError(
                f"{self.path}: has results schema {found}, this cpbench knows {SCHEMA}; update cpbench, or use "
                "another file with -o"
            )
        return found

    def _open_to_write(self) -> None:
        with self._told():
            db = self._db = self._connect("mode=rwc")
            found = self._require(schema.version(db))
            use_journal(db, self.path)
            db.execute("PRAGMA temp_store=MEMORY")
            db.execute("PRAGMA wal_autocheckpoint=4000")  # 16 MB: a page that several rows share is moved once
            if found == 0:
                with self._transaction():
                    schema.create(db)
            elif found < SCHEMA:
                schema.migrate(db, found)

    def _open_to_read(self) -> None:
        """Opened as if to write, and then not written: SQLite reads what a killed run left in its log, and leaves no
        helper files behind."""
        with self._told():
            try:
                self._db = self._connect("mode=rw")
                found = schema.version(self._db)
            except sqlite3.OperationalError as cause:
                if cause.sqlite_errorcode & 0xFF == sqlite3.SQLITE_BUSY:
                    raise
                self._open_unwritable()
                found = schema.version(self._connection)
            found = self._require(found)
            self._connection.execute("PRAGMA query_only=ON")
            if found == 0:
                raise StoreError(f"{self.path}: is empty, not a results file")
            if found < SCHEMA:
                old, self._db = self._connection, sqlite3.connect("", isolation_level=None, check_same_thread=False)
                old.backup(self._db)
                old.close()
                schema.migrate(self._db, found)

    def _open_unwritable(self) -> None:
        """Where SQLite cannot make its helper files (a read-only folder, a full disk): the file as it is, or, where a
        killed run left a log beside it, a copy of both."""
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
                f"{self.path}: is in a folder that cannot be written, with the log of a killed run, and no copy of "
                f"them can be made in {self._copy.name} ({cause.strerror})"
            ) from None
        self._db = self._connect("mode=rw", Path(self._copy.name) / self._real.name)

    def _connect(self, how: str, path: Path | None = None) -> sqlite3.Connection:
        address = f"{(path or self._real).as_uri()}?{how}"
        return sqlite3.connect(address, uri=True, isolation_level=None, timeout=PATIENCE, check_same_thread=False)

    @property
    def _connection(self) -> sqlite3.Connection:
        if self._db is None:
            raise StoreError(f"{self.path}: was closed")
        return self._db

    @contextmanager
    def _told(self) -> Generator[None]:
        """What SQLite or a value it cannot store raises becomes a StoreError with the cause."""
        try:
            yield
        except (sqlite3.Error, OverflowError) as cause:
            raise _explained(self.path, cause) from cause

    @contextmanager
    def _transaction(self) -> Generator[sqlite3.Connection]:
        db = self._connection
        with self._guard, self._told():
            db.execute("BEGIN IMMEDIATE")
            try:
                yield db
                db.execute("COMMIT")
            except BaseException:
                with contextlib.suppress(sqlite3.Error):  # on a full disk SQLite has rolled back already
                    db.execute("ROLLBACK")
                raise

    def _read(self, query: str, parameters: Iterable[Any] = ()) -> list[tuple[Any, ...]]:
        with self._guard, self._told():
            return self._connection.execute(query, tuple(parameters)).fetchall()

    # ------------------------------------------------------------------------------------------- write

    def set_meta(self, **values: Any) -> None:
        with self._transaction() as db:
            db.executemany(
                "INSERT INTO meta VALUES (?, ?) ON CONFLICT(name) DO UPDATE SET value = excluded.value",
                [(name, json.dumps(value)) for name, value in values.items()],
            )

    def note_files(self, loaded: Iterable[str], refused: Iterable[tuple[str, str]]) -> None:
        """Note which files could not be read, and why; those that are read now are refused no longer."""
        with self._transaction() as db:
            db.executemany("DELETE FROM refused WHERE address = ?", [(_text(address),) for address in loaded])
            db.executemany("INSERT OR REPLACE INTO refused VALUES (?, ?)", [(_text(a), _text(r)) for a, r in refused])

    def note_machine(self, host: str, description: Mapping[str, Any]) -> None:
        """What a machine that solves is; told once a run."""
        with self._transaction() as db:
            db.execute("INSERT OR REPLACE INTO machines VALUES (?, ?)", (host, json.dumps(dict(description))))

    def add_reference(self, pairs: int, seconds: float, loadavg: float | None = None) -> None:
        """A solve of the reference just now, after so many pairs: what it took [s], NaN if it failed, and the load of
        the machine."""
        at = time.strftime("%Y-%m-%dT%H:%M:%S")
        self.add_references([{"at": at, "pairs": pairs, "seconds": seconds, "loadavg": loadavg}])

    def add_references(self, solves: Iterable[Mapping[str, Any]]) -> None:
        """Solves as `references` gives them."""
        with self._transaction() as db:
            db.executemany("INSERT INTO reference VALUES (:at, :pairs, :seconds, :loadavg)", map(dict, solves))

    def add(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Whole rows, as `rows` gives them, in one transaction."""
        names = (*PLANNED, *MEASURED)
        marks = ", ".join("?" * len(names))
        with self._transaction() as db:
            db.executemany(f"INSERT INTO rows ({_ALL}) VALUES ({marks})", ([row[n] for n in names] for row in rows))

    def put(self, row: Mapping[str, Any], answer: bytes | None) -> None:
        """A whole row with its answer, in place of the one of its key."""
        names = (*PLANNED, *MEASURED)
        marks = ", ".join("?" * len(names))
        keep = answer is not None and self._kept + len(answer) <= KEEP_LIMIT
        with self._transaction() as db:
            for table in ("answers", "histories"):
                db.execute(f"DELETE FROM {table} WHERE key = ?", (row["key"],))
            db.execute(f"INSERT OR REPLACE INTO rows ({_ALL}) VALUES ({marks})", [_text(row[n]) for n in names])
            if answer is not None and keep:
                db.execute("INSERT INTO answers VALUES (?, ?, ?)", (row["key"], len(answer), answer))
                self._kept += len(answer)

    def add_kept(self, answers: Iterable[tuple[str, bytes]], histories: Iterable[tuple[str, bytes]]) -> None:
        """Answers and histories of rows that are there, as `answers` and `histories` give them."""
        with self._transaction() as db:
            db.executemany("INSERT INTO answers VALUES (?, ?, ?)", ((key, len(blob), blob) for key, blob in answers))
            db.executemany("INSERT INTO histories VALUES (?, ?)", histories)

    def settle(self) -> None:
        """Bring all that is written into the one file; raises StoreError when that fails, where `close` would leave
        it in the log beside the file."""
        with self._guard, self._told():
            self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")

    def plan(self, pairs: Iterable[Pair]) -> None:
        """Add the rows of a plan as `not_run`; those that are there already stay as they are.

        Raises StoreError, before anything is written, when rows of the same set, or of the same key, were made with
        other limits.
        """
        pairs = list(pairs)
        keys = [p.key for p in pairs]
        names = ", ".join(f'"{c}"' for c in (*PLANNED, "status"))
        marks = ", ".join("?" * (len(PLANNED) + 1))
        rows = [(*map(_text, planned(p).values()), "not_run") for p in pairs]
        with self._transaction() as db:
            self._require_same_limits(pairs, keys)
            db.executemany(f"INSERT OR IGNORE INTO rows ({names}) VALUES ({marks})", rows)

    def _require_same_limits(self, pairs: list[Pair], keys: list[str]) -> None:
        columns = ", ".join(LIMITS)
        known: dict[str, set[tuple[Any, ...]]] = {}
        ours = "coalesce(origin, '') = ''"  # under which limits others solved is not known
        for name, *limits in self._read(f'SELECT DISTINCT "set", {columns} FROM rows WHERE {ours}'):
            known.setdefault(name, set()).add(tuple(limits))
        resumed = bool(known)
        for pair, key in zip(pairs, keys, strict=True):
            asked = (pair.limits.seconds, pair.limits.memory, pair.limits.threads, pair.limits.repeats)
            there = self._read(f"SELECT {columns} FROM rows WHERE key = ?", (key,)) if resumed else []
            before = set(there) or known.setdefault(pair.set, {asked})
            if not any(_agree(old, asked) for old in before):
                raise StoreError(f"{self.path}: {_difference(pair.set, next(iter(before)), asked)}")

    def finish(
        self, key: str, row: Mapping[str, Any], answer: bytes | None = None, history: bytes | None = None
    ) -> None:
        """Fill a planned row, with its answer and its history, in one transaction; `attempts` goes up by one unless
        the row tells it."""
        unknown = row.keys() - MEASURED.keys()
        if unknown:
            raise StoreError(f"{self.path}: no column {', '.join(sorted(unknown))}")
        keep = answer is not None and self._wants(str(row.get("status", "")))
        if keep and answer is not None and self._kept + len(answer) > KEEP_LIMIT:
            row = {**row, "message": f"{row.get('message') or ''} (answer not kept: over {KEEP_LIMIT} bytes)".strip()}
            keep = False
        sets = ", ".join(f'"{c}" = ?' for c in row)
        if "attempts" not in row:
            sets += ", attempts = coalesce(attempts, 0) + 1"
        with self._transaction() as db:
            done = db.execute(f"UPDATE rows SET {sets} WHERE key = ?", (*map(_text, row.values()), key))
            if done.rowcount != 1:
                raise StoreError(f"{self.path}: no row {key} was planned")
            if keep and answer is not None:
                db.execute("INSERT OR REPLACE INTO answers VALUES (?, ?, ?)", (key, len(answer), answer))
            if history is not None:
                db.execute("INSERT OR REPLACE INTO histories VALUES (?, ?)", (key, history))
        if keep and answer is not None:
            self._kept += len(answer)

    def _wants(self, status: str) -> bool:
        if self._keep == "wrong":
            return status in ("wrong", "inaccurate")
        return self._keep == "all"

    def reset(
        self,
        statuses: Collection[str] | None = None,
        keys: Iterable[str] | None = None,
        attempts: int | None = None,
    ) -> int:
        """Let rows be run again: those of `statuses`, among `keys`, that were run at most `attempts` times (None: all).

        They are `not_run` again and lose what was measured, their answer and their history; `attempts` stays. The
        number of rows.
        """
        chosen = ["status <> 'not_run'"]
        given: list[Any] = []
        if statuses is not None:
            chosen.append(f"status IN ({', '.join('?' * len(statuses))})")
            given += statuses
        if keys is not None:
            chosen.append("key IN (SELECT key FROM temp.asked)")
        if attempts is not None:
            chosen.append("coalesce(attempts, 0) <= ?")
            given.append(attempts)
        cleared = ", ".join(f'"{c}" = NULL' for c in MEASURED if c not in ("status", "attempts"))
        with self._transaction() as db:
            db.execute("CREATE TEMP TABLE asked (key TEXT PRIMARY KEY)")
            db.execute("CREATE TEMP TABLE chosen (key TEXT PRIMARY KEY)")
            db.executemany("INSERT OR IGNORE INTO temp.asked VALUES (?)", [(key,) for key in keys or ()])
            db.execute(f"INSERT INTO temp.chosen SELECT key FROM rows WHERE {' AND '.join(chosen)}", given)
            among = "key IN (SELECT key FROM temp.chosen)"
            count = db.execute(f"UPDATE rows SET {cleared}, status = 'not_run' WHERE {among}").rowcount
            freed = db.execute(f"SELECT coalesce(sum(bytes), 0) FROM answers WHERE {among}").fetchone()[0]
            for table in ("answers", "histories"):
                db.execute(f"DELETE FROM {table} WHERE {among}")
            db.execute("DROP TABLE temp.asked")
            db.execute("DROP TABLE temp.chosen")
        self._kept -= freed
        return count

    # -------------------------------------------------------------------------------------------- read

    def meta(self) -> dict[str, Any]:
        """Facts of the run by name, with the refused files under `refused`, the solves that tell the machine's drift
        under `references`."""
        values = {name: json.loads(value) for name, value in self._read("SELECT name, value FROM meta")}
        values["refused"] = self._read("SELECT address, reason FROM refused ORDER BY address")
        values["references"] = self.references()
        return values

    def machines(self) -> dict[str, dict[str, Any]]:
        """What the machines are that solved, by host."""
        return {host: json.loads(told) for host, told in self._read("SELECT * FROM machines ORDER BY host")}

    def references(self) -> list[dict[str, Any]]:
        """The solves of the reference, in order: at, pairs, seconds (None where it failed), loadavg."""
        names = ("at", "pairs", "seconds", "loadavg")
        found = self._read("SELECT at, pairs, seconds, loadavg FROM reference ORDER BY rowid")
        return [dict(zip(names, values, strict=True)) for values in found]

    def pending(self) -> set[str]:
        """Keys of planned rows that have not been run."""
        return {key for (key,) in self._read("SELECT key FROM rows WHERE status = 'not_run'")}

    def counts(self) -> dict[str, int]:
        """Rows by status."""
        return dict(self._read("SELECT status, count(*) FROM rows GROUP BY status"))

    def row(self, key: str) -> dict[str, Any]:
        """One row as a dictionary."""
        found = self._read(f"SELECT {_ALL} FROM rows WHERE key = ?", (key,))
        if not found:
            raise StoreError(f"{self.path}: no row {key}")
        return dict(zip((*PLANNED, *MEASURED), found[0], strict=True))

    def rows(self) -> Iterator[dict[str, Any]]:
        """Every row as a dictionary, in the order in which they were planned."""
        for values in self._stream(f"SELECT {_ALL} FROM rows ORDER BY rowid"):
            yield dict(zip((*PLANNED, *MEASURED), values, strict=True))

    def ending(self, key: str) -> tuple[str, bytes | None]:
        """How a row ended: its status, and its compressed answer where one is kept."""
        found = self._read("SELECT status, answer FROM rows LEFT JOIN answers USING (key) WHERE key = ?", (key,))
        if not found:
            raise StoreError(f"{self.path}: no row {key}")
        return found[0][0], found[0][1]

    def answers(self) -> Iterator[tuple[str, bytes]]:
        """(key, compressed answer) of every kept answer."""
        yield from self._stream("SELECT key, answer FROM answers ORDER BY key")

    def histories(self) -> Iterator[tuple[str, bytes]]:
        """(key, compressed history) of every kept history."""
        yield from self._stream("SELECT key, history FROM histories ORDER BY key")

    def _stream(self, query: str) -> Iterator[tuple[Any, ...]]:
        """Rows of a query, not all at once."""
        with self._told():
            cursor = self._connection.execute(query)
        while True:
            with self._told():
                found = cursor.fetchmany(256)
            if not found:
                return
            yield from found

    def table(self) -> pd.DataFrame:
        """All rows, in the order problem, label."""
        import pandas as pd

        found = self._read(f"SELECT {_ALL} FROM rows ORDER BY problem, label, key")
        kinds = {**PLANNED, **MEASURED}
        frame = pd.DataFrame(found, columns=list(kinds))
        for name in (name for name, kind in kinds.items() if kind == "REAL"):
            frame[name] = pd.to_numeric(frame[name])
        frame["error"] = frame["error"].fillna(float("inf"))
        return frame


_ALL = ", ".join(f'"{c}"' for c in (*PLANNED, *MEASURED))


def read_results(path: str | Path) -> pd.DataFrame:
    """The rows of a results file as a table, for scripts and notebooks; raises StoreError."""
    with Store(path) as store:
        return store.table()


def use_journal(db: sqlite3.Connection, path: Path) -> str:
    """Write ahead where readers share memory, else into a rollback journal; the mode in use.

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
    """Type of the file system that holds `path`, '' where the system does not tell."""
    try:
        mounts = [line.split() for line in Path("/proc/self/mounts").read_text().splitlines()]
    except OSError:
        return ""
    folder = os.path.dirname(os.path.realpath(path))
    found, kind = "", ""
    for _, point, name, *_ in mounts:
        point = point.replace("\\040", " ")
        if len(point) >= len(found) and f"{folder}/".startswith(f"{point.rstrip('/')}/"):
            found, kind = point, name
    return kind


def planned(pair: Pair) -> dict[str, Any]:
    """The planned columns of a pair's row."""
    return {
        "key": pair.key,
        "problem": pair.problem,
        "address": pair.address,
        "fingerprint": pair.fingerprint,
        "node": pair.node,
        "family": pair.family,
        "sizes": json.dumps(dict(pair.sizes)),
        "set": pair.set,
        "solver": pair.entry.solver,
        "label": pair.label,
        "request": pair.request.name,
        "options": json.dumps(dict(pair.entry.options), sort_keys=True),
        "tolerance": pair.tolerance,
        "measure": pair.measure,
        "start": pair.start,
        "sequence": pair.sequence,
        "step": pair.step,
        "seconds": pair.limits.seconds,
        "memory": pair.limits.memory,
        "threads": pair.limits.threads,
        "repeats_asked": pair.limits.repeats,
    }


def _agree(old: tuple[Any, ...], asked: tuple[Any, ...]) -> bool:
    return all(a is None or a == b for a, b in zip(old, asked, strict=True))


def _difference(name: str, old: tuple[Any, ...], asked: tuple[Any, ...]) -> str:
    for limit, before, now in zip(LIMITS.values(), old, asked, strict=True):
        if before is not None and before != now:
            made = f"set '{name}' was made" if name else "was made"
            return (
                f"{made} with {limit} {before:.12g}, now {now:.12g}; results of other limits do not mix: use another "
                "file with -o"
            )
    return "was made with other limits"


def _text(value: Any) -> Any:
    """`value` as SQLite can store it: text with halves of characters, as broken file names have them, is escaped."""
    if isinstance(value, str) and not value.isascii():
        return value.encode("utf-8", "backslashreplace").decode()
    return value


def _explained(path: Path, cause: Exception) -> StoreError:
    """One line: the file, the cause, what to do."""
    code = getattr(cause, "sqlite_errorcode", 0) & 0xFF
    kept = "what was finished is kept, and the same command goes on"
    told = {
        sqlite3.SQLITE_FULL: f"no room is left to write it ({cause}); make room: {kept}",
        sqlite3.SQLITE_IOERR: f"could not be read or written ({cause}); see to the disk: {kept}",
        sqlite3.SQLITE_READONLY: f"cannot be written ({cause}); name a file in another folder with -o",
        sqlite3.SQLITE_CANTOPEN: f"cannot be opened ({cause}); see to its folder, or name another file with -o",
        sqlite3.SQLITE_CORRUPT: f"is damaged ({cause}); go on with another file (-o), and save what can be read with: "
        f"sqlite3 {path} .recover",
        sqlite3.SQLITE_NOTADB: f"not a results file ({cause}); name another file",
        sqlite3.SQLITE_BUSY: f"is held by another program ({cause}); end that program, or use another file with -o",
    }
    return StoreError(f"{path}: {told.get(code, f'SQLite failed: {cause}')}")
