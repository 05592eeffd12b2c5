"""Results in one SQLite file: a transaction a row, the answer and the history in the same transaction.

`kill -9` of the runner loses at most the pair in flight: planned rows are there from the start as `not_run`,
and a row is filled together with its answer or not at all. One process writes, any number read (`database`). Here is
what is written; a store is opened and sealed in `store_sealing`, and read in `store_reading`.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.bench.planning.plan import Pair
from cpbench.bench.results import file_seal, seals
from cpbench.bench.results.limits import LIMITS, agree, difference, limits_of
from cpbench.bench.results.rows import Measured, Outcome, Planned, Row, stored
from cpbench.bench.results.schema import MEASURED, PLANNED
from cpbench.bench.results.store_sealing import KEPT, PLACE, SealedStore
from cpbench.errors import SealError, StoreError
from cpbench.verification import CHARGED_TO_ROUTE, FALSE_CLAIMS, Status

if TYPE_CHECKING:
    import pandas as pd

KEEP = ("none", "wrong", "all")
KEEP_LIMIT = 10**9
"""Bytes of answers after which `--keep all` stops keeping; rows without their answer say so."""


class Store(SealedStore):
    """A results file, opened for running (`create=True`) or for reading.

    For running, this process alone may write it, and an older file is migrated; for reading, the file is left as it
    is, whoever writes it meanwhile. May be used from several threads.

    For running, the seals are checked: rows that do not fit are refused, or with `expel` removed, so that they are
    planned and run again; all others are sealed by this user's key, and say whose key it was before
    (`sealed_by`). `opened` says what was found. For reading, `audit` checks them. A file that was left without an
    exception has a seal over the whole (`end`).

    Raises StoreError when the file is not a results file, is of a newer version, is being written by another process or
    cannot be written; SealError; from every method StoreError, when SQLite fails.
    """

    def set_meta(self, **values: Any) -> None:
        with self._database.transaction() as db:
            self._put_meta(db, **values)
            file_seal.write(db, self._writing.file_seal())

    def note_files(self, loaded: Iterable[str], refused: Iterable[tuple[str, str]]) -> None:
        """Note which files could not be read, and why; those that are read now are refused no longer."""
        with self._facts_written() as (db, contents):
            for address in map(_text, loaded):
                db.execute("DELETE FROM refused WHERE address = ?", (address,))
                contents.remove("refused", address)
            for address, reason in refused:
                db.execute("INSERT OR REPLACE INTO refused VALUES (?, ?)", (_text(address), _text(reason)))
                contents.put("refused", _text(address), reason)

    def note_machine(self, host: str, description: Mapping[str, Any]) -> None:
        """Store the description of a machine that solves."""
        with self._facts_written() as (db, contents):
            text = json.dumps(dict(description))
            db.execute("INSERT OR REPLACE INTO machines VALUES (?, ?)", (host, text))
            contents.put("machines", host, text)

    def note_features(self, features: Mapping[str, Mapping[str, Any]]) -> None:
        """Note the features of problems by fingerprint, in place of what was noted of them."""
        with self._facts_written() as (db, contents):
            for fingerprint, facts in features.items():
                text = json.dumps(dict(facts))
                db.execute("INSERT OR REPLACE INTO problems VALUES (?, ?)", (fingerprint, text))
                contents.put("problems", fingerprint, text)

    def add_reference(self, pairs: int, seconds: float, loadavg: float | None = None) -> None:
        """Add a reference solve of this moment: pairs run before, its time [s] (NaN if it failed), and the load of the
        machine."""
        at = time.strftime("%Y-%m-%dT%H:%M:%S")
        self.add_references([{"at": at, "pairs": pairs, "seconds": seconds, "loadavg": loadavg}])

    def add_references(self, solves: Iterable[Mapping[str, Any]]) -> None:
        """Add reference solves as `references` returns them."""
        with self._facts_written() as (db, contents):
            for solve in solves:
                values = [solve[name] for name in ("at", "pairs", "seconds", "loadavg")]
                db.execute("INSERT INTO reference VALUES (?, ?, ?, ?)", values)
                contents.put("reference", *values)

    def add(self, rows: Iterable[Row]) -> None:
        """Add rows as `rows` yields them, in one transaction."""
        with self._rows_written() as db:
            for row in rows:
                self._add(db, "INSERT", _row_values(row), (None, None, None, None))

    def _add(self, db: sqlite3.Connection, how: str, values: Sequence[Any], kept: Sequence[Any]) -> None:
        """Add a whole row and seal it with what is kept of it."""
        values = [_text(value) for value in values]
        db.execute(f"{how} INTO rows {_WHOLE}", values)
        state = self._writing
        planned, measured = values[: len(PLANNED)], values[len(PLANNED) :]
        digests = seals.planned_digest(planned, state.key), seals.measured_digest(measured, state.key)
        self._seal(db, values[0], *digests, seals.kept_digest(kept, state.key))
        state.count(values[0], measured[_ATTEMPTS])

    def put(self, row: Planned, outcome: Outcome) -> None:
        """Put a whole row with its answer in place of the one of its key."""
        answer = outcome.answer
        if answer is not None and self._kept + len(answer) > KEEP_LIMIT:
            answer = None
        with self._rows_written() as db:
            for table in KEPT:
                db.execute(f"DELETE FROM {table} WHERE key = ?", (row.key,))
            values = (*_planned_values(row), *_measured_values(outcome))
            self._add(db, "INSERT OR REPLACE", values, (answer, None, None, None))
            if answer is not None:
                db.execute("INSERT INTO answers VALUES (?, ?, ?)", (row.key, len(answer), answer))
                self._kept += len(answer)

    def add_kept(self, kept: Iterable[tuple[str, bytes | None, bytes | None, str | None, bytes | None]]) -> None:
        """Add what is kept of existing rows, as `kept` yields it."""
        state = self._writing
        with self._rows_written() as db:
            for key, answer, history, kind, proof in kept:
                if answer is not None:
                    db.execute("INSERT INTO answers VALUES (?, ?, ?)", (key, len(answer), answer))
                if history is not None:
                    db.execute("INSERT INTO histories VALUES (?, ?)", (key, history))
                if proof is not None:
                    db.execute("INSERT INTO certificates VALUES (?, ?, ?)", (key, kind, proof))
                planned, measured, _ = seals.digests_of(state.written.seals[key])
                digest = seals.kept_digest((answer, history, kind, proof), state.key)
                self._seal(db, key, planned, measured, digest)

    def plan(self, pairs: Iterable[Pair]) -> None:
        """Add the rows of a plan as `not_run`; those that are there already stay as they are.

        Raises StoreError, before anything is written, when rows of the same set, or of the same key, were made with
        other limits.
        """
        pairs = list(pairs)
        rows = [Planned.of(pair) for pair in pairs]
        there = self._writing.written.seals
        new = {row.key: row for row in rows if row.key not in there}
        self._require_same_limits(rows)
        if new:
            with self._rows_written() as db:
                for row in new.values():
                    self._add(db, "INSERT", (*_planned_values(row), *_UNMEASURED), (None, None, None, None))

    def _require_same_limits(self, rows: Sequence[Planned]) -> None:
        columns = ", ".join(LIMITS)
        known: dict[str, set[tuple[Any, ...]]] = {}
        ours = "coalesce(origin, '') = ''"  # the limits of imported answers are unknown
        for name, *limits in self._database.read(f'SELECT DISTINCT "set", {columns} FROM rows WHERE {ours}'):
            known.setdefault(name, set()).add(tuple(limits))
        resumed = bool(known)
        for row in rows:
            asked = limits_of(row)
            there = self._database.read(f"SELECT {columns} FROM rows WHERE key = ?", (row.key,)) if resumed else []
            before = set(there) or known.setdefault(row.set, {asked})
            if not any(agree(old, asked) for old in before):
                raise StoreError(f"{self.path}: {difference(row.set, next(iter(before)), asked)}")

    def finish(self, key: str, outcome: Outcome) -> None:
        """Fill a planned row, with its answer, its history and the proof of its status, in one transaction; `attempts`
        goes up by one unless the outcome tells it."""
        answer = outcome.answer if self._wants(outcome.status) else None
        if answer is not None and self._kept + len(answer) > KEEP_LIMIT:
            message = f"{outcome.message or ''} (answer not kept: over {KEEP_LIMIT} bytes)".strip()
            outcome, answer = replace(outcome, message=message), None
        state = self._writing
        attempts = state.attempts.get(key, 0) + 1 if outcome.attempts is None else outcome.attempts
        measured = [_text(value) for value in _measured_values(outcome)]
        measured[_ATTEMPTS] = attempts
        kind = outcome.status if outcome.proof is not None else None
        with self._rows_written() as db:
            if db.execute(_FINISH, (*measured, key)).rowcount != 1:
                raise StoreError(f"{self.path}: no row {key} was planned")
            for table in KEPT:
                db.execute(f"DELETE FROM {table} WHERE key = ?", (key,))
            if answer is not None:
                db.execute("INSERT INTO answers VALUES (?, ?, ?)", (key, len(answer), answer))
            if outcome.history is not None:
                db.execute("INSERT INTO histories VALUES (?, ?)", (key, outcome.history))
            if outcome.proof is not None:
                db.execute("INSERT INTO certificates VALUES (?, ?, ?)", (key, kind, outcome.proof))
            planned, *_ = seals.digests_of(state.written.seals[key])
            kept = seals.kept_digest((answer, outcome.history, kind, outcome.proof), state.key)
            self._seal(db, key, planned, seals.measured_digest(measured, state.key), kept)
            state.count(key, attempts)
        if answer is not None:
            self._kept += len(answer)

    def note_certificate(
        self, key: str, certainty: str, distance: float | None, words: str, proof: bytes | None = None
    ) -> None:
        """Put down how certain the answer of a row is, with the proof; a proof that there is no solution stays.

        Raises SealError where the row is not as this process knows it.
        """
        state = self._writing
        with self._rows_written() as db:
            row = db.execute(f"{seals.READ} WHERE rows.key = ?", (key,)).fetchone()
            if row is None:
                raise StoreError(f"{self.path}: no row {key}")
            if why := seals.unfit(row, state.key, state.written.seals):
                raise SealError(f"{self.path}: row {key} {why}: by another program")
            measured, (answer, history, kind, old) = list(row[len(PLANNED) : -5]), row[-5:-1]
            for name, value in (("certainty", certainty), ("distance", distance), ("certificate", _text(words))):
                measured[PLACE[name]] = value
            if kind in (None, OF_AN_ANSWER):
                kind, old = (None, None) if proof is None else (OF_AN_ANSWER, proof)
            db.execute(_FINISH, (*measured, key))
            db.execute("DELETE FROM certificates WHERE key = ?", (key,))
            if kind is not None:
                db.execute("INSERT INTO certificates VALUES (?, ?, ?)", (key, kind, old))
            kept = seals.kept_digest((answer, history, kind, old), state.key)
            planned, *_ = seals.digests_of(state.written.seals[key])
            self._seal(db, key, planned, seals.measured_digest(measured, state.key), kept)

    def note_proved_problems(self, data: Iterable[tuple[str, bytes]]) -> None:
        """Keep the data of problems by fingerprint, for a check of the proofs of answers."""
        with self._database.transaction() as db:
            db.executemany("INSERT OR IGNORE INTO proved_problems VALUES (?, ?)", data)

    def _wants(self, status: str) -> bool:
        if self._keep == "wrong":
            return status in (*FALSE_CLAIMS, *CHARGED_TO_ROUTE, str(Status.UNRESOLVABLE))
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
        with self._rows_written() as db:
            db.execute("CREATE TEMP TABLE asked (key TEXT PRIMARY KEY)")
            db.execute("CREATE TEMP TABLE chosen (key TEXT PRIMARY KEY)")
            db.executemany("INSERT OR IGNORE INTO temp.asked VALUES (?)", [(key,) for key in keys or ()])
            db.execute(f"INSERT INTO temp.chosen SELECT key FROM rows WHERE {' AND '.join(chosen)}", given)
            among = "key IN (SELECT key FROM temp.chosen)"
            again = [key for (key,) in db.execute("SELECT key FROM temp.chosen")]
            count = db.execute(f"UPDATE rows SET {cleared}, status = 'not_run' WHERE {among}").rowcount
            freed = db.execute(f"SELECT coalesce(sum(bytes), 0) FROM answers WHERE {among}").fetchone()[0]
            for table in KEPT:
                db.execute(f"DELETE FROM {table} WHERE {among}")
            self._seal_as_planned(db, again)
            db.execute("DROP TABLE temp.asked")
            db.execute("DROP TABLE temp.chosen")
        self._kept -= freed
        return count

    def _seal_as_planned(self, db: sqlite3.Connection, keys: Iterable[str]) -> None:
        """Seal rows that wait to be run again."""
        state = self._writing
        kept = seals.kept_digest((None, None, None, None), state.key)
        for key in keys:
            measured = list(_UNMEASURED)
            measured[_ATTEMPTS] = state.attempts.get(key)
            if key in state.written.seals:
                planned, *_ = seals.digests_of(state.written.seals[key])
                self._seal(db, key, planned, seals.measured_digest(measured, state.key), kept)

    def withdraw(self, keys: Iterable[str]) -> None:
        """Take rows out of the results, with all that is kept of them."""
        gone = [(key,) for key in keys]
        if not gone:
            return
        with self._rows_written() as db:
            for table in (*KEPT, "seals", "rows"):
                db.executemany(f"DELETE FROM {table} WHERE key = ?", gone)
        for (key,) in gone:
            self._writing.written.seals.pop(key, None)


def _into(names: Sequence[str]) -> str:
    """Return the columns and the places of values in a statement."""
    return f"({', '.join(f'{chr(34)}{name}{chr(34)}' for name in names)}) VALUES ({', '.join('?' * len(names))})"


OF_AN_ANSWER = "answer"
"""Kind of a certificate that is about an answer."""
_WHOLE = _into((*PLANNED, *MEASURED))
_FINISH = f"UPDATE rows SET {', '.join(f'{chr(34)}{name}{chr(34)} = ?' for name in MEASURED)} WHERE key = ?"
_planned_values, _measured_values = attrgetter(*PLANNED), attrgetter(*MEASURED)
_row_values = attrgetter(*PLANNED, *MEASURED)
_ATTEMPTS = PLACE["attempts"]
_UNMEASURED = _measured_values(Measured())


def read_results(path: str | Path) -> pd.DataFrame:
    """Return the rows of a results file as a table, for scripts and notebooks; raises StoreError."""
    with Store(path) as store:
        return store.table()


def _text(value: Any) -> Any:
    """Return `value` as SQLite can store it: text with halves of characters, as broken file names have them, is
    escaped."""
    return stored(value, "TEXT") if isinstance(value, str) else value
