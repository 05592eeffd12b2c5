"""Results in one SQLite file: a transaction a row, the answer and the history in the same transaction.

`kill -9` of the runner loses at most the pair in flight: planned rows are there from the start as `not_run`,
and a row is filled together with its answer or not at all. One process writes, any number read (`database`).
"""

from __future__ import annotations

import json
import sqlite3
import subprocess
import sys
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.database import Database
from cpbench.bench.results.rows import (
    LIMITS,
    MEASURED,
    PLANNED,
    Measured,
    Outcome,
    Planned,
    Row,
    difference,
    limits_of,
)
from cpbench.errors import StoreError
from cpbench.verification import CHARGED_TO_ROUTE, FALSE_CLAIMS, Status

if TYPE_CHECKING:
    import pandas as pd

KEEP = ("none", "wrong", "all")
KEEP_LIMIT = 10**9
"""Bytes of answers after which `--keep all` stops keeping; rows without their answer say so."""
NOT_KEPT = "answer not kept"
CHUNK = 5_000
"""Rows of a table that are held as Python objects at a time; equal texts among them are one object."""
_KINDS = {**PLANNED, **MEASURED}
_KEPT = ("answers", "histories", "certificates")
"""Tables of what is kept of single rows."""


class Store(Database):
    """A results file, opened for running (`create=True`) or for reading. May be used from several threads.

    For running, this process alone may write it; for reading, the file is left as it is, whoever writes it meanwhile.
    Raises what `Database` does. `keep` : of which answers (KEEP).
    """

    def __init__(self, path: str | Path, *, create: bool = False, keep: str = "all") -> None:
        super().__init__(Path(path), create=create)
        self._keep = keep
        try:  # whatever fails from here on, the lock must not stay
            self._kept = int(self.read("SELECT coalesce(sum(bytes), 0) FROM answers")[0][0])
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def sha256(self) -> str:
        """Return the SHA-256 of the file, with all that was written so far."""
        self.settle()
        # by another process: to close a file would release the locks that SQLite has on it in this one
        command = [sys.executable, "-I", "-S", "-c", _DIGEST, str(self.path)]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    # ------------------------------------------------------------------------------------------------ read

    def meta(self) -> dict[str, Any]:
        """Return facts of the run by name, with the refused files under `refused`, and the solves that tell the
        machine's drift under `references`."""
        values = {name: json.loads(value) for name, value in self.read("SELECT name, value FROM meta")}
        values["refused"] = self.read("SELECT address, reason FROM refused ORDER BY address")
        values["references"] = self.references()
        return values

    def machines(self) -> dict[str, dict[str, Any]]:
        """Return what the machines are that solved, by host."""
        return self._facts("SELECT host, description FROM machines ORDER BY host")

    def features(self) -> dict[str, dict[str, Any]]:
        """Return the features of the problems by fingerprint, as `bench.planning.features` found them."""
        return self._facts("SELECT fingerprint, features FROM problems ORDER BY fingerprint")

    def _facts(self, query: str) -> dict[str, dict[str, Any]]:
        return {name: json.loads(facts) for name, facts in self.read(query)}

    def references(self) -> list[dict[str, Any]]:
        """Return the solves of the reference, in order: at, pairs, seconds (None where it failed), loadavg."""
        names = ("at", "pairs", "seconds", "loadavg")
        rows = self.read(f"SELECT {', '.join(names)} FROM reference ORDER BY rowid")
        return [dict(zip(names, values, strict=True)) for values in rows]

    def pending(self) -> set[str]:
        """Return keys of planned rows that have not been run."""
        return {key for (key,) in self.read("SELECT key FROM rows WHERE status = 'not_run'")}

    def counts(self) -> dict[str, int]:
        """Return rows by status."""
        return dict(self.read("SELECT status, count(*) FROM rows GROUP BY status"))

    def row(self, key: str) -> Row:
        """Return one row; raises StoreError where there is none."""
        return Row(*self._one(f"SELECT {_ALL} FROM rows WHERE key = ?", key))

    def rows(self) -> Iterator[Row]:
        """Yield every row, in the order in which they were planned."""
        for values in self.stream(f"SELECT {_ALL} FROM rows ORDER BY rowid"):
            yield Row(*values)

    def ending(self, key: str) -> tuple[str, bytes | None]:
        """Return how a row ended: its status, and its compressed answer where one is kept."""
        status, answer = self._one("SELECT status, answer FROM rows LEFT JOIN answers USING (key) WHERE key = ?", key)
        return status, answer

    def _one(self, query: str, key: str) -> tuple[Any, ...]:
        rows = self.read(query, (key,))
        if not rows:
            raise StoreError(f"{self.path}: no row {key}")
        return rows[0]

    def kept(self) -> Iterator[tuple[str, bytes | None, bytes | None, str | None, bytes | None]]:
        """Yield (key, compressed answer, history, kind of proof, proof) of every row of which something is kept."""
        yield from self.stream(_READ_KEPT)  # type: ignore[misc]

    def answers(self) -> Iterator[tuple[str, bytes]]:
        """Yield (key, compressed answer) of every kept answer."""
        yield from self.stream("SELECT key, answer FROM answers ORDER BY key")

    def histories(self) -> Iterator[tuple[str, bytes]]:
        """Yield (key, compressed history) of every kept history."""
        yield from self.stream("SELECT key, history FROM histories ORDER BY key")

    def certificates(self) -> Iterator[tuple[str, str, bytes]]:
        """Yield (key, kind, proof) of every row that is proved to have no solution."""
        yield from self.stream("SELECT key, kind, proof FROM certificates ORDER BY key")

    def table(self) -> pd.DataFrame:
        """Return all rows in the order problem, label, key, with `error` ∞ where none was measured."""
        import pandas as pd

        parts = {name: [_column(name, ())] for name in _KINDS}
        for rows in self.chunks(f"SELECT {_ALL} FROM rows ORDER BY rowid", CHUNK):
            for name, values in zip(_KINDS, zip(*rows, strict=True), strict=True):
                parts[name].append(_column(name, values))
        # column by column, so that there is never a second table
        with pd.option_context("mode.string_storage", "python"):  # where pyarrow is, each cell would be a separate text
            columns = {name: pd.Series(np.concatenate(parts.pop(name))).infer_objects() for name in _KINDS}
        columns["error"] = columns["error"].fillna(float("inf"))
        names = pd.DataFrame({name: columns[name] for name in ("problem", "label", "key")}, copy=False)
        order = names.sort_values(list(names)).index
        return pd.DataFrame({name: pd.Series(columns.pop(name).array.take(order)) for name in _KINDS}, copy=False)

    # ----------------------------------------------------------------------------------- facts of the run

    def set_meta(self, **values: Any) -> None:
        """Store facts of the run by name."""
        with self.transaction() as db:
            db.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", [(n, json.dumps(v)) for n, v in values.items()])

    def note_files(self, loaded: Iterable[str], refused: Iterable[tuple[str, str]]) -> None:
        """Note which files could not be read, and why; those that are read now are refused no longer."""
        with self.transaction() as db:
            db.executemany("DELETE FROM refused WHERE address = ?", [(_text(address),) for address in loaded])
            lines = [(_text(address), _text(reason)) for address, reason in refused]
            db.executemany("INSERT OR REPLACE INTO refused VALUES (?, ?)", lines)

    def note_machine(self, host: str, description: Mapping[str, Any]) -> None:
        """Store the description of a machine that solves."""
        with self.transaction() as db:
            db.execute("INSERT OR REPLACE INTO machines VALUES (?, ?)", (host, json.dumps(dict(description))))

    def note_features(self, features: Mapping[str, Mapping[str, Any]]) -> None:
        """Note the features of problems by fingerprint, in place of what was noted of them."""
        with self.transaction() as db:
            lines = [(fingerprint, json.dumps(dict(facts))) for fingerprint, facts in features.items()]
            db.executemany("INSERT OR REPLACE INTO problems VALUES (?, ?)", lines)

    def add_reference(self, pairs: int, seconds: float, loadavg: float | None = None) -> None:
        """Add a reference solve of this moment: pairs run before, its time [s] (NaN if it failed), and the load of the
        machine."""
        at = time.strftime("%Y-%m-%dT%H:%M:%S")
        self.add_references([{"at": at, "pairs": pairs, "seconds": seconds, "loadavg": loadavg}])

    def add_references(self, solves: Iterable[Mapping[str, Any]]) -> None:
        """Add reference solves as `references` returns them."""
        with self.transaction() as db:
            db.executemany("INSERT INTO reference VALUES (:at, :pairs, :seconds, :loadavg)", solves)

    # ------------------------------------------------------------------------------------------------ rows

    def plan(self, pairs: Iterable[Pair]) -> None:
        """Add the rows of a plan as `not_run`; those that are there already stay as they are.

        Raises StoreError, before anything is written, when rows of the same set, or of the same key, were made with
        other limits.
        """
        pairs = list(pairs)
        rows = [Planned.of(pair) for pair in pairs]
        self._require_same_limits(rows)
        by_key = {row.key: row for row in rows}
        with self.transaction() as db:
            values = [(*map(_text, _planned_values(row)), *_UNMEASURED) for row in by_key.values()]
            db.executemany(f"INSERT OR IGNORE INTO rows {_WHOLE}", values)

    def _require_same_limits(self, rows: Sequence[Planned]) -> None:
        columns = ", ".join(LIMITS)
        of_set: dict[str, set[tuple[Any, ...]]] = {}
        for name, *limits in self.read(f'SELECT DISTINCT "set", {columns} FROM rows'):
            of_set.setdefault(name, set()).add(tuple(limits))
        resumed = bool(of_set)
        for row in rows:
            wanted = limits_of(row)
            planned = self.read(f"SELECT {columns} FROM rows WHERE key = ?", (row.key,)) if resumed else []
            before = set(planned) or of_set.setdefault(row.set, {wanted})
            if wanted not in before:
                raise StoreError(f"{self.path}: {difference(row.set, next(iter(before)), wanted)}")

    def finish(self, key: str, outcome: Outcome) -> None:
        """Fill a planned row, with its answer, its history and the proof of its status, in one transaction; `attempts`
        goes up by one unless the outcome tells it."""
        answer = outcome.answer if self._wants(outcome.status) else None
        if answer is not None and self._kept + len(answer) > KEEP_LIMIT:
            message = f"{outcome.message or ''} ({NOT_KEPT}: over {KEEP_LIMIT} bytes)".strip()
            outcome, answer = replace(outcome, message=message), None
        kind = outcome.status if outcome.proof is not None else None
        with self.transaction() as db:
            if db.execute(_FINISH, (*map(_text, _measured_values(outcome)), key)).rowcount != 1:
                raise StoreError(f"{self.path}: no row {key} was planned")
            for table in _KEPT:
                db.execute(f"DELETE FROM {table} WHERE key = ?", (key,))
            _keep(db, key, answer, outcome.history, kind, outcome.proof)
        self._kept += len(answer or b"")

    def _wants(self, status: str) -> bool:
        if self._keep == "wrong":
            return status in (*FALSE_CLAIMS, *CHARGED_TO_ROUTE, str(Status.UNRESOLVABLE))
        return self._keep == "all"

    def add(self, rows: Iterable[Row]) -> None:
        """Add rows as `rows` yields them, in one transaction."""
        with self.transaction() as db:
            db.executemany(f"INSERT INTO rows {_WHOLE}", (list(map(_text, _row_values(row))) for row in rows))

    def add_kept(self, kept: Iterable[tuple[str, bytes | None, bytes | None, str | None, bytes | None]]) -> None:
        """Add what is kept of existing rows, as `kept` yields it."""
        with self.transaction() as db:
            for one in kept:
                _keep(db, *one)

    def note_certificate(self, key: str, certainty: str, distance: float | None, words: str) -> None:
        """Put down how certain the answer of a row is."""
        change = "UPDATE rows SET certainty = ?, distance = ?, certificate = ? WHERE key = ?"
        with self.transaction() as db:
            if db.execute(change, (certainty, distance, _text(words), key)).rowcount != 1:
                raise StoreError(f"{self.path}: no row {key}")

    def reset(
        self,
        statuses: Collection[str] | None = None,
        keys: Iterable[str] | None = None,
    ) -> int:
        """Let rows be run again: those of `statuses`, among `keys` (None: all).

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
        cleared = ", ".join(f'"{c}" = NULL' for c in MEASURED if c not in ("status", "attempts"))
        with self.transaction() as db:
            db.execute("CREATE TEMP TABLE asked (key TEXT PRIMARY KEY)")
            db.execute("CREATE TEMP TABLE chosen (key TEXT PRIMARY KEY)")
            db.executemany("INSERT OR IGNORE INTO temp.asked VALUES (?)", [(key,) for key in keys or ()])
            db.execute(f"INSERT INTO temp.chosen SELECT key FROM rows WHERE {' AND '.join(chosen)}", given)
            among = "key IN (SELECT key FROM temp.chosen)"
            count = db.execute(f"UPDATE rows SET {cleared}, status = 'not_run' WHERE {among}").rowcount
            freed = db.execute(f"SELECT coalesce(sum(bytes), 0) FROM answers WHERE {among}").fetchone()[0]
            for table in _KEPT:
                db.execute(f"DELETE FROM {table} WHERE {among}")
            db.execute("DROP TABLE temp.asked")
            db.execute("DROP TABLE temp.chosen")
        self._kept -= freed
        return count

    def withdraw(self, keys: Iterable[str]) -> None:
        """Take rows out of the results, with all that is kept of them."""
        gone = [(key,) for key in keys]
        with self.transaction() as db:
            for table in (*_KEPT, "rows"):
                db.executemany(f"DELETE FROM {table} WHERE key = ?", gone)


def read_results(path: str | Path) -> pd.DataFrame:
    """Return the rows of a results file as a table, for scripts and notebooks; raises StoreError."""
    with Store(path) as store:
        return store.table()


def _keep(
    db: sqlite3.Connection,
    key: str,
    answer: bytes | None,
    history: bytes | None,
    kind: str | None,
    proof: bytes | None,
) -> None:
    """Write what is kept of a row, within the caller's transaction."""
    if answer is not None:
        db.execute("INSERT INTO answers VALUES (?, ?, ?)", (key, len(answer), answer))
    if history is not None:
        db.execute("INSERT INTO histories VALUES (?, ?)", (key, history))
    if proof is not None:
        db.execute("INSERT INTO certificates VALUES (?, ?, ?)", (key, kind, proof))


def _text(value: Any) -> Any:
    """Return `value` as SQLite can store it: text with halves of characters, as broken file names have them, is
    escaped."""
    if not isinstance(value, str) or value.isascii():
        return value
    return value.encode("utf-8", "backslashreplace").decode()


def _column(name: str, values: Sequence[Any]) -> Any:
    """Return a part of a column as an array: NaN where a number is missing, equal texts one object."""
    if _KINDS[name] == "REAL":
        return np.array(values, dtype=float)
    once: dict[Any, Any] = {}
    return np.fromiter(map(once.setdefault, values, values), dtype=object, count=len(values))


def _setting(name: str) -> str:
    """Return how an outcome sets a column; of `attempts`, which it may not tell, one more than before."""
    return f'"{name}" = ?' if name != "attempts" else '"attempts" = coalesce(?, coalesce(attempts, 0) + 1)'


_ALL = ", ".join(f'"{name}"' for name in _KINDS)
_WHOLE = f"({_ALL}) VALUES ({', '.join('?' * len(_KINDS))})"
_FINISH = f"UPDATE rows SET {', '.join(map(_setting, MEASURED))} WHERE key = ?"
_READ_KEPT = """
    SELECT key, answer, history, certificates.kind, proof FROM rows LEFT JOIN answers USING (key)
    LEFT JOIN histories USING (key) LEFT JOIN certificates USING (key)
    WHERE coalesce(answer, history, proof) IS NOT NULL ORDER BY key
"""
_DIGEST = "import hashlib, sys; print(hashlib.file_digest(open(sys.argv[1], 'rb'), 'sha256').hexdigest())"
_planned_values, _measured_values = attrgetter(*PLANNED), attrgetter(*MEASURED)
_row_values = attrgetter(*_KINDS)
_UNMEASURED = _measured_values(Measured())
