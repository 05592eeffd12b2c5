"""An open results file with its seals: checked and taken over when it is opened, written in the transaction of a row.

Whatever is written of a row is sealed in the same transaction (`seals`), and so is what the file says beside its rows
(`file_seal`): from the values in memory, never from what SQLite hands back.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

from cpbench.bench.results import file_seal, seal_key, seals
from cpbench.bench.results.database import Database
from cpbench.bench.results.schema import MEASURED, PLANNED, SCHEMA, WHOLE_SINCE
from cpbench.bench.results.seal_key import Key
from cpbench.bench.results.seals import Audit, WrittenSeals
from cpbench.bench.results.store_reading import StoreReader
from cpbench.foundation.plurals import counted

KEPT = ("answers", "histories", "certificates")
"""Tables of what is kept of single rows."""
PLACE = {name: place for place, name in enumerate(MEASURED)}
"""Places of the measured columns among them."""
_SEALED_BY = len(PLANNED) + PLACE["sealed_by"]


class SealedStore(StoreReader):
    """A results file that is open, its seals, and the transactions in which it is written and sealed."""

    def __init__(self, path: str | Path, *, create: bool = False, keep: str = "all", expel: bool = False) -> None:
        self.path = Path(path)
        self._keep = keep
        self._state: _State | None = None
        self._notes: Sequence[str] = ()
        self._database = Database(self.path, create=create)
        try:  # whatever fails from here on, the lock must not stay
            self._key = seal_key.find_or_make() if create else seal_key.find()
            self.opened = self._take_over(self._key, expel) if create and self._key else Audit(str(self.path))
            self._whose = "" if create else self._whose_seals()
            self._kept = int(self._database.read("SELECT coalesce(sum(bytes), 0) FROM answers")[0][0])
        except BaseException:
            self._database.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None and self._state is not None and not self._database.closed:
                self.end()
        finally:
            self.close()

    def close(self) -> None:
        """Close the file and let others write it; harmless when done before."""
        self._database.close()

    def settle(self) -> None:
        """Move what is in SQLite's log into the file; raises StoreError when that fails, where `close` would leave the
        log."""
        self._database.settle()

    # ------------------------------------------------------------------------------------------- seals

    def audit(self) -> Audit:
        """Check all seals; of a file that this process writes also against what it has written."""
        version = SCHEMA if self._state is not None else self._database.found
        written = None if self._state is None else self._state.written
        result = seals.audit(self._database, str(self.path), self._key, written, version)
        self._notes = result.notes
        return result

    def require_unchanged(self) -> None:
        """Raise SealError when something else wrote into the file that this process writes; the rows concerned are
        marked, so that later commands find them."""
        result = self.audit()
        if result.broken:
            with self._database.transaction() as db:
                marks = [(one.key, seals.BROKEN) for one in result.broken]
                db.executemany("INSERT OR REPLACE INTO seals VALUES (?, ?)", marks)
        result.require()

    def end(self) -> None:
        """Seal the file as a whole: rows that are removed, or replaced by older versions, are found from now on."""
        state = self._writing
        if state.rows == file_seal.OPEN:
            with self._database.transaction() as db:
                rows = file_seal.digest_of_rows(sorted(state.written.seals.items()))
                file_seal.write(db, replace(state, rows=rows).file_seal())
            state.rows = rows

    @property
    def _writing(self) -> _State:
        assert self._state is not None, "only the process that writes a file seals"
        return self._state

    def _take_over(self, key: Key, expel: bool) -> Audit:
        """Check what is there, note what cannot be believed, and seal the rest by this user's key."""
        with self._database.transaction() as db:
            result = seals.audit(self._database, str(self.path), key, None, self._database.found or SCHEMA)
            new = not self._database.found
            if not (expel or new):
                result.require()
            for table in (*KEPT, "seals", "rows"):
                db.executemany(f"DELETE FROM {table} WHERE key = ?", [(one.key,) for one in result.broken])
            if result.whose not in ("", key.name):
                self._seal_as_own(db, key, result.whose)
            there: list[tuple[str, str]] = self._database.read("SELECT key, seal FROM seals")  # type: ignore[assignment]
            attempts = db.execute("SELECT key, attempts FROM rows WHERE attempts IS NOT NULL")
            written = WrittenSeals(dict(there), file_seal.contents(self._database))
            ended = self._database.found >= WHOLE_SINCE and file_seal.ended(self._database) and not result.broken
            self._state = _State(key, written, dict(attempts))
            if not new and (remarks := _lasting(result, self._database.found, key)):
                self._put_meta(db, seals=[*self._stored_meta().get("seals", []), *remarks])
            if ended:
                self._state.rows = file_seal.digest_of_rows(sorted(written.seals.items()))
            file_seal.write(db, self._state.file_seal())
        if not key.kept:
            warning = (
                f"the key of the seals could not be kept in {seal_key.folder()}: later commands find flipped bits only"
            )
            return replace(result, changed=() if new else result.changed, notes=[*result.notes, warning])
        return replace(result, changed=()) if new else result

    def _seal_as_own(self, db: sqlite3.Connection, key: Key, whose: str) -> None:
        """Seal all rows by the key, and note in them whose key they had, within the transaction that checked them."""
        for values in db.execute(seals.READ).fetchall():
            row = list(values)
            row[_SEALED_BY] = seals.origin(row[_SEALED_BY], whose, key.name)
            db.execute("UPDATE rows SET sealed_by = ? WHERE key = ?", (row[_SEALED_BY], row[0]))
            db.execute("INSERT OR REPLACE INTO seals VALUES (?, ?)", (row[0], seals.sealed(row, key)))

    @contextmanager
    def _rows_written(self) -> Generator[sqlite3.Connection]:
        """Write rows within this context, all or nothing; the run has then not ended."""
        state = self._writing
        with self._database.transaction() as db:
            if state.rows != file_seal.OPEN:
                file_seal.write(db, replace(state, rows=file_seal.OPEN).file_seal())
            state.sealing.clear()  # of a transaction that failed
            yield db
        state.rows = file_seal.OPEN
        state.written.seals.update(state.sealing)

    @contextmanager
    def _facts_written(self) -> Generator[tuple[sqlite3.Connection, file_seal.Contents]]:
        """Write tables beside the rows within this context, all or nothing, and seal what was noted of them."""
        state = self._writing
        with self._database.transaction() as db:
            yield db, state.written.contents
            file_seal.write(db, state.file_seal())

    def _seal(self, db: sqlite3.Connection, key: str, planned: str, measured: str, kept: str) -> None:
        """Seal a row by the digests of what was planned, measured and kept; part of the transaction that wrote it."""
        state = self._writing
        seal = seals.assembled((planned, measured, kept), state.key)
        db.execute("INSERT OR REPLACE INTO seals VALUES (?, ?)", (key, seal))
        state.sealing[key] = seal

    def _put_meta(self, db: sqlite3.Connection, **values: Any) -> None:
        for name, value in values.items():
            text = json.dumps(value)
            db.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (name, text))
            self._writing.written.contents.put("meta", name, text)


@dataclass
class _State:
    """State of the process that writes a file: its key, what it has written, how often rows were run, and the
    digest of all rows."""

    key: Key
    written: WrittenSeals
    attempts: dict[str, int]
    rows: str = file_seal.OPEN
    sealing: dict[str, str] = field(default_factory=dict)
    """Seals of the transaction that is under way."""

    def file_seal(self) -> str:
        """Return the seal over the whole file."""
        return file_seal.sealed(self.written.contents.digests(), self.rows, self.key)

    def count(self, key: str, attempts: int | None) -> None:
        """Note how often a row was run."""
        if attempts is None:
            self.attempts.pop(key, None)
        else:
            self.attempts[key] = attempts


def _lasting(found: Audit, version: int, key: Key) -> list[str]:
    """Return what was found of a file that all its later readers have to know, in a sentence each."""
    today = time.strftime("%Y-%m-%d")
    remarks = [f"on {today}: {one}, by another program" for one in found.changed]
    remarks += [f"on {today}: removed {counted(len(found.broken), 'row')} that could not be believed"] * bool(
        found.broken
    )
    if 0 < version < WHOLE_SINCE:
        remarks.append(f"until {today} its facts beside the rows had no seal: it was made by an older cpbench")
    elif found.whose not in ("", key.name):
        remarks.append(f"until {today} it was sealed by the key of another user or machine")
    return remarks
