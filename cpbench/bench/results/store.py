"""Results in one SQLite file: a transaction a row, the answer and the history in the same transaction.

`kill -9` of the runner loses at most the pair in flight: planned rows are there from the start as `not_run`,
and a row is filled together with its answer or not at all. One process writes, any number read (`database`).
Whatever is written of a row is sealed in the same transaction (`seals`), and so is what the file says beside its rows
(`file_seal`): from the values in memory, never from what SQLite hands back.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Collection, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.bench.planning.plan import Pair
from cpbench.bench.results import file_seal, seal_key, seals
from cpbench.bench.results.database import Database
from cpbench.bench.results.limits import LIMITS, agree, difference, limits_of
from cpbench.bench.results.rows import Measured, Outcome, Planned, Row, stored
from cpbench.bench.results.schema import MEASURED, PLANNED, SCHEMA, SEALED_SINCE, WHOLE_SINCE
from cpbench.bench.results.seal_key import Key
from cpbench.bench.results.seals import Audit, WrittenSeals
from cpbench.bench.results.whole import whole_table
from cpbench.errors import SealError, StoreError
from cpbench.foundation.plurals import counted
from cpbench.solvers.renamed import current_label
from cpbench.verification import CHARGED_TO_ROUTE, FALSE_CLAIMS, Status

if TYPE_CHECKING:
    import pandas as pd

KEEP = ("none", "wrong", "all")
KEEP_LIMIT = 10**9
"""Bytes of answers after which `--keep all` stops keeping; rows without their answer say so."""


class Store:
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

    def __enter__(self) -> Store:
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

    def _whose_seals(self) -> str:
        """Return the name of the key of the seals, NONE where rows have none; '' where there is no row."""
        if self._database.found < SEALED_SINCE:
            return seals.NONE
        found = self._database.read("SELECT seal FROM seals WHERE seal <> ? LIMIT 1", (seals.BROKEN,))
        return str(found[0][0]).partition(".")[0] if found else ""

    def _take_over(self, key: Key, expel: bool) -> Audit:
        """Check what is there, note what cannot be believed, and seal the rest by this user's key."""
        with self._database.transaction() as db:
            result = seals.audit(self._database, str(self.path), key, None, self._database.found or SCHEMA)
            new = not self._database.found
            if not (expel or new):
                result.require()
            for table in (*_KEPT, "seals", "rows"):
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

    # ------------------------------------------------------------------------------------------- write

    def set_meta(self, **values: Any) -> None:
        with self._database.transaction() as db:
            self._put_meta(db, **values)
            file_seal.write(db, self._writing.file_seal())

    def _put_meta(self, db: sqlite3.Connection, **values: Any) -> None:
        for name, value in values.items():
            text = json.dumps(value)
            db.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (name, text))
            self._writing.written.contents.put("meta", name, text)

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
            for table in _KEPT:
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
        self._require_same_calls(pairs)
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

    def _require_same_calls(self, pairs: Sequence[Pair]) -> None:
        """Raise StoreError where a set was run with calls for many problems, and is not now, or the reverse."""
        own = "status <> 'not_run' AND coalesce(origin, '') = ''"
        for name, many in self._database.read(f'SELECT DISTINCT "set", batch IS NOT NULL FROM rows WHERE {own}'):
            if any(pair.set == name and pair.limits.throughput != bool(many) for pair in pairs):
                made = f"set '{name}' was made" if name else "was made"
                before, now = ("with", "without") if many else ("without", "with")
                raise StoreError(
                    f"{self.path}: {made} {before} throughput = true, now {now}; times of a call for many problems "
                    "and of one for each do not mix: use another file with -o"
                )

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
            for table in _KEPT:
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
                measured[_PLACE[name]] = value
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
        """Keep the data of problems by fingerprint, for whoever checks the proofs of answers."""
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
            for table in _KEPT:
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
            for table in (*_KEPT, "seals", "rows"):
                db.executemany(f"DELETE FROM {table} WHERE key = ?", gone)
        for (key,) in gone:
            self._writing.written.seals.pop(key, None)

    # -------------------------------------------------------------------------------------------- read

    def meta(self) -> dict[str, Any]:
        """Return facts of the run by name, with the refused files under `refused`, the solves that tell the machine's
        drift under `references`, and under `seals` what its readers have to know of its seals, if anything."""
        values = self._stored_meta()
        if values.get("seals") or self._notes:
            values["seals"] = [*values.get("seals", []), *self._notes]
        if "solvers" in values:
            values["solvers"] = {current_label(label): sheet for label, sheet in values["solvers"].items()}
        values["refused"] = self._database.read("SELECT address, reason FROM refused ORDER BY address")
        values["references"] = self.references()
        return values

    def _stored_meta(self) -> dict[str, Any]:
        return {name: json.loads(value) for name, value in self._database.read("SELECT name, value FROM meta")}

    def machines(self) -> dict[str, dict[str, Any]]:
        """Return what the machines are that solved, by host."""
        return {
            host: json.loads(description)
            for host, description in self._database.read("SELECT * FROM machines ORDER BY host")
        }

    def features(self) -> dict[str, dict[str, Any]]:
        """Return the features of the problems by fingerprint, as `bench.planning.features` found them; those of rows
        that were planned before results kept them are not among them."""
        rows = self._database.read("SELECT fingerprint, features FROM problems ORDER BY fingerprint")
        return {fingerprint: json.loads(facts) for fingerprint, facts in rows}

    def references(self) -> list[dict[str, Any]]:
        """Return the solves of the reference, in order: at, pairs, seconds (None where it failed), loadavg."""
        names = ("at", "pairs", "seconds", "loadavg")
        rows = self._database.read("SELECT at, pairs, seconds, loadavg FROM reference ORDER BY rowid")
        return [dict(zip(names, values, strict=True)) for values in rows]

    def pending(self) -> set[str]:
        """Return keys of planned rows that have not been run."""
        return {key for (key,) in self._database.read("SELECT key FROM rows WHERE status = 'not_run'")}

    def counts(self) -> dict[str, int]:
        """Return rows by status."""
        return dict(self._database.read("SELECT status, count(*) FROM rows GROUP BY status"))

    def row(self, key: str) -> Row:
        """Return one row; raises StoreError where there is none."""
        rows = self._database.read(f"SELECT {_ALL} FROM rows WHERE key = ?", (key,))
        if not rows:
            raise StoreError(f"{self.path}: no row {key}")
        return self._row(rows[0])

    def rows(self) -> Iterator[Row]:
        """Yield every row, in the order in which they were planned."""
        for values in self._database.stream(f"SELECT {_ALL} FROM rows ORDER BY rowid"):
            yield self._row(values)

    def ending(self, key: str) -> tuple[str, bytes | None]:
        """Return how a row ended: its status, and its compressed answer where one is kept."""
        rows = self._database.read(
            "SELECT status, answer FROM rows LEFT JOIN answers USING (key) WHERE key = ?", (key,)
        )
        if not rows:
            raise StoreError(f"{self.path}: no row {key}")
        return rows[0][0], rows[0][1]

    def _row(self, values: Sequence[Any]) -> Row:
        """Return the row of values that were read, under the name that its solver has now, with whose key sealed it."""
        row = Row(*values)
        solver, label = (name and current_label(name) for name in (row.solver, row.label))
        first = self._first_seal(row.sealed_by)
        same = (solver, label, first) == (row.solver, row.label, row.sealed_by)
        return row if same else replace(row, solver=solver, label=label, sealed_by=first)

    def _first_seal(self, sealed_by: str | None) -> str | None:
        """Return whose key sealed a row first: None for this user's."""
        return seals.origin(sealed_by, self._whose, "" if self._key is None else self._key.name)

    def kept(self) -> Iterator[tuple[str, bytes | None, bytes | None, str | None, bytes | None]]:
        """Yield (key, compressed answer, history, kind of proof, proof) of every row of which something is kept."""
        yield from self._database.stream(_READ_KEPT)  # type: ignore[misc]

    def answers(self) -> Iterator[tuple[str, bytes]]:
        """Yield (key, compressed answer) of every kept answer."""
        yield from self._database.stream("SELECT key, answer FROM answers ORDER BY key")

    def histories(self) -> Iterator[tuple[str, bytes]]:
        """Yield (key, compressed history) of every kept history."""
        yield from self._database.stream("SELECT key, history FROM histories ORDER BY key")

    def certificates(self) -> Iterator[tuple[str, str, bytes]]:
        """Yield (key, kind, proof) of every row that is proved to have no solution, or whose answer has a proof; none
        in a file of an older version."""
        if self._database.read("SELECT name FROM sqlite_master WHERE name = 'certificates'"):
            yield from self._database.stream("SELECT key, kind, proof FROM certificates ORDER BY key")

    def proved_problems(self) -> Iterator[tuple[str, bytes]]:
        """Yield (fingerprint, data) of every problem of which an answer has a proof; none in a file of an older
        version."""
        if self._database.read("SELECT name FROM sqlite_master WHERE name = 'proved_problems'"):
            yield from self._database.stream("SELECT fingerprint, data FROM proved_problems ORDER BY fingerprint")

    def table(self) -> pd.DataFrame:
        """Return all rows, in the order problem, label, with whose key sealed them as `seals.OWNERS`."""
        return whole_table(self._database, lambda sealed_by: seals.owner(self._first_seal(sealed_by)))


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


def _into(names: Sequence[str]) -> str:
    """Return the columns and the places of values in a statement."""
    return f"({', '.join(f'{chr(34)}{name}{chr(34)}' for name in names)}) VALUES ({', '.join('?' * len(names))})"


OF_AN_ANSWER = "answer"
"""Kind of a certificate that is about an answer."""
_KEPT = ("answers", "histories", "certificates")
"""Tables of what is kept of single rows."""
_ALL = ", ".join(f'"{c}"' for c in (*PLANNED, *MEASURED))
_WHOLE = _into((*PLANNED, *MEASURED))
_FINISH = f"UPDATE rows SET {', '.join(f'{chr(34)}{name}{chr(34)} = ?' for name in MEASURED)} WHERE key = ?"
_READ_KEPT = """
    SELECT key, answer, history, certificates.kind, proof FROM rows LEFT JOIN answers USING (key)
    LEFT JOIN histories USING (key) LEFT JOIN certificates USING (key)
    WHERE coalesce(answer, history, proof) IS NOT NULL ORDER BY key
"""
_planned_values, _measured_values = attrgetter(*PLANNED), attrgetter(*MEASURED)
_row_values = attrgetter(*PLANNED, *MEASURED)
_PLACE = {name: place for place, name in enumerate(MEASURED)}
_ATTEMPTS = _PLACE["attempts"]
_SEALED_BY = len(PLANNED) + _PLACE["sealed_by"]
_UNMEASURED = _measured_values(Measured())


def read_results(path: str | Path) -> pd.DataFrame:
    """Return the rows of a results file as a table, for scripts and notebooks; raises StoreError."""
    with Store(path) as store:
        return store.table()


def _text(value: Any) -> Any:
    """Return `value` as SQLite can store it: text with halves of characters, as broken file names have them, is
    escaped."""
    return stored(value, "TEXT") if isinstance(value, str) else value
