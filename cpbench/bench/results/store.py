"""Results in one SQLite file: a transaction a row, the answer and the history in the same transaction.

`kill -9` of the runner loses at most the pair in flight: planned rows are there from the start as `not_run`,
and a row is filled together with its answer or not at all. One process writes, any number read (`database`).
Whatever is written of a row is sealed in the same transaction (`seals`).
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.bench.planning.plan import Pair
from cpbench.bench.results import seal_key, seals
from cpbench.bench.results.database import Database
from cpbench.bench.results.limits import LIMITS, agree, difference, limits_of
from cpbench.bench.results.rows import Outcome, Planned, Row
from cpbench.bench.results.schema import MEASURED, PLANNED, SEALED_SINCE
from cpbench.bench.results.seal_key import Key
from cpbench.bench.results.seals import Audit
from cpbench.bench.results.whole import whole_table
from cpbench.errors import StoreError
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

    For running, the seals of the rows that are there are checked: those that do not fit are refused, or with `expel`
    removed, so that they are planned and run again; all others are sealed anew by this user's key, or by `key`.
    `opened` says what was found. For reading, `audit` checks them.

    Raises StoreError when the file is not a results file, is of a newer version, is being written by another process or
    cannot be written; SealError; from every method StoreError, when SQLite fails.
    """

    def __init__(
        self, path: str | Path, *, create: bool = False, keep: str = "all", expel: bool = False, key: Key | None = None
    ) -> None:
        self.path = Path(path)
        self._keep = keep
        self._written: dict[str, str] | None = None
        """Seals by key as this process knows them, None where it only reads."""
        self._database = Database(self.path, create=create)
        try:  # whatever fails from here on, the lock must not stay
            self._key = key or (seal_key.find_or_make() if create else seal_key.find())
            self.opened = self._take_over(expel) if create else Audit(str(self.path))
            self._kept = int(self._database.read("SELECT coalesce(sum(bytes), 0) FROM answers")[0][0])
        except BaseException:
            self._database.close()
            raise

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
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
        """Check the seals of all rows; of a file that this process writes also against what it has written."""
        unsealed = self._written is None and 0 < self._database.found < SEALED_SINCE
        return seals.audit(self._database, str(self.path), self._key, self._written, unsealed=unsealed)

    def require_unchanged(self) -> None:
        """Raise SealError when something else wrote into the file that this process writes; the rows concerned are
        marked, so that later commands find them."""
        result = self.audit()
        if not result.broken:
            return
        with self._database.transaction() as db:
            db.executemany(
                "INSERT OR REPLACE INTO seals VALUES (?, ?)", [(one.key, seals.BROKEN) for one in result.broken]
            )
        result.require()

    def _take_over(self, expel: bool) -> Audit:
        """Check the existing rows, and seal them by this user's key."""
        result = self.audit()
        if not expel:
            result.require()
        self._written = {}
        if result.broken or result.note:
            with self._database.transaction() as db:
                for table in ("answers", "histories", "certificates", "seals", "rows"):
                    db.executemany(f"DELETE FROM {table} WHERE key = ?", [(one.key,) for one in result.broken])
                if result.note:
                    self._seal(db, [key for (key,) in db.execute("SELECT key FROM rows")])
        self._written.update(self._database.read("SELECT key, seal FROM seals"))
        if self._key is not None and not self._key.kept:
            warning = (
                f"the key of the seals could not be kept in {seal_key.folder()}: later commands find flipped bits only"
            )
            return replace(result, note="; ".join(filter(None, (result.note, warning))))
        return result

    def _changed(self, db: sqlite3.Connection, keys: Iterable[str]) -> set[str]:
        """Return which of the rows are not as this process wrote them: what is written into them is never sealed
        again."""
        assert self._written is not None, "only the process that writes a file seals"
        rows = ((key, db.execute(_ONE, (key,)).fetchone()) for key in keys)
        return {key for key, row in rows if row and seals.unfit(row, self._key, self._written)}

    def _seal(self, db: sqlite3.Connection, keys: Iterable[str], changed: Collection[str] = ()) -> None:
        """Seal rows as SQLite has stored them, but those that somebody else had changed before, or whose plan is
        another than this process knows; part of the transaction that wrote them."""
        assert self._key is not None, "only the process that writes a file seals"
        assert self._written is not None, "only the process that writes a file seals"
        fresh = {key: seals.sealed(db.execute(_ONE, (key,)).fetchone(), self._key) for key in keys}
        for key, seal in fresh.items():
            if key in changed or not seals.same_plan(self._written.get(key, seal), seal):
                fresh[key] = seals.BROKEN
        db.executemany("INSERT OR REPLACE INTO seals VALUES (?, ?)", fresh.items())
        self._written |= fresh

    # ------------------------------------------------------------------------------------------- write

    def set_meta(self, **values: Any) -> None:
        with self._database.transaction() as db:
            db.executemany(
                "INSERT INTO meta VALUES (?, ?) ON CONFLICT(name) DO UPDATE SET value = excluded.value",
                [(name, json.dumps(value)) for name, value in values.items()],
            )

    def note_files(self, loaded: Iterable[str], refused: Iterable[tuple[str, str]]) -> None:
        """Note which files could not be read, and why; those that are read now are refused no longer."""
        with self._database.transaction() as db:
            db.executemany("DELETE FROM refused WHERE address = ?", [(_text(address),) for address in loaded])
            db.executemany("INSERT OR REPLACE INTO refused VALUES (?, ?)", [(_text(a), _text(r)) for a, r in refused])

    def note_machine(self, host: str, description: Mapping[str, Any]) -> None:
        """Store the description of a machine that solves."""
        with self._database.transaction() as db:
            db.execute("INSERT OR REPLACE INTO machines VALUES (?, ?)", (host, json.dumps(dict(description))))

    def note_features(self, features: Mapping[str, Mapping[str, Any]]) -> None:
        """Note the features of problems by fingerprint, in place of what was noted of them."""
        noted = [(fingerprint, json.dumps(dict(facts))) for fingerprint, facts in features.items()]
        with self._database.transaction() as db:
            db.executemany("INSERT OR REPLACE INTO problems VALUES (?, ?)", noted)

    def add_reference(self, pairs: int, seconds: float, loadavg: float | None = None) -> None:
        """Add a reference solve of this moment: pairs run before, its time [s] (NaN if it failed), and the load of the
        machine."""
        at = time.strftime("%Y-%m-%dT%H:%M:%S")
        self.add_references([{"at": at, "pairs": pairs, "seconds": seconds, "loadavg": loadavg}])

    def add_references(self, solves: Iterable[Mapping[str, Any]]) -> None:
        """Add reference solves as `references` returns them."""
        with self._database.transaction() as db:
            db.executemany("INSERT INTO reference VALUES (:at, :pairs, :seconds, :loadavg)", map(dict, solves))

    def add(self, rows: Iterable[Row]) -> None:
        """Add rows as `rows` yields them, in one transaction."""
        keys: list[str] = []

        def values(row: Row) -> tuple[Any, ...]:
            keys.append(row.key)
            return _row_values(row)

        with self._database.transaction() as db:
            db.executemany(f"INSERT INTO rows {_WHOLE}", map(values, rows))
            self._seal(db, keys)

    def put(self, row: Planned, outcome: Outcome) -> None:
        """Put a whole row with its answer in place of the one of its key."""
        answer = outcome.answer
        keep = answer is not None and self._kept + len(answer) <= KEEP_LIMIT
        with self._database.transaction() as db:
            for table in _KEPT:
                db.execute(f"DELETE FROM {table} WHERE key = ?", (row.key,))
            values = (*_planned_values(row), *_measured_values(outcome))
            db.execute(f"INSERT OR REPLACE INTO rows {_WHOLE}", [*map(_text, values)])
            if answer is not None and keep:
                db.execute("INSERT INTO answers VALUES (?, ?, ?)", (row.key, len(answer), answer))
                self._kept += len(answer)
            assert self._written is not None, "only the process that writes a file seals"
            self._written.pop(row.key, None)  # its plan may be another one
            self._seal(db, [row.key])

    def add_kept(
        self,
        answers: Iterable[tuple[str, bytes]],
        histories: Iterable[tuple[str, bytes]],
        certificates: Iterable[tuple[str, str, bytes]],
    ) -> None:
        """Add answers, histories and certificates of existing rows, as the methods of these names yield them."""
        keys: dict[str, None] = {}  # in their order: equal files have equal bytes

        def noted(items: Iterable[Any]) -> Iterator[Any]:
            for item in items:
                keys[item[0]] = None
                yield item

        with self._database.transaction() as db:
            kept = ((key, len(blob), blob) for key, blob in noted(answers))
            db.executemany("INSERT INTO answers VALUES (?, ?, ?)", kept)
            db.executemany("INSERT INTO histories VALUES (?, ?)", noted(histories))
            db.executemany("INSERT INTO certificates VALUES (?, ?, ?)", noted(certificates))
            self._seal(db, keys)

    def plan(self, pairs: Iterable[Pair]) -> None:
        """Add the rows of a plan as `not_run`; those that are there already stay as they are.

        Raises StoreError, before anything is written, when rows of the same set, or of the same key, were made with
        other limits.
        """
        pairs = list(pairs)
        rows = [Planned.of(pair) for pair in pairs]
        with self._database.transaction() as db:
            self._require_same_limits(rows)
            self._require_same_calls(pairs)
            values = ([*map(_text, _planned_values(row)), "not_run"] for row in rows)
            db.executemany(f"INSERT OR IGNORE INTO rows {_into((*PLANNED, 'status'))}", values)
            self._seal(db, [row.key for row in rows if row.key not in (self._written or {})])

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
        with self._database.transaction() as db:
            done = db.execute(_FINISH, (*map(_text, _finish_values(outcome)), key))
            if done.rowcount != 1:
                raise StoreError(f"{self.path}: no row {key} was planned")
            for table in _KEPT:
                db.execute(f"DELETE FROM {table} WHERE key = ?", (key,))
            if answer is not None:
                db.execute("INSERT OR REPLACE INTO answers VALUES (?, ?, ?)", (key, len(answer), answer))
            if outcome.history is not None:
                db.execute("INSERT OR REPLACE INTO histories VALUES (?, ?)", (key, outcome.history))
            if outcome.proof is not None:
                kept = (key, outcome.status, outcome.proof)
                db.execute("INSERT OR REPLACE INTO certificates VALUES (?, ?, ?)", kept)
            self._seal(db, [key])
        if answer is not None:
            self._kept += len(answer)

    def note_certificate(
        self, key: str, certainty: str, distance: float | None, words: str, proof: bytes | None = None
    ) -> None:
        """Put down how certain the answer of a row is, with the proof; a proof that there is no solution stays."""
        with self._database.transaction() as db:
            values = (certainty, distance, _text(words), key)
            done = db.execute("UPDATE rows SET certainty = ?, distance = ?, certificate = ? WHERE key = ?", values)
            if done.rowcount != 1:
                raise StoreError(f"{self.path}: no row {key}")
            db.execute("DELETE FROM certificates WHERE key = ? AND kind = ?", (key, OF_AN_ANSWER))
            if proof is not None:
                db.execute("INSERT OR IGNORE INTO certificates VALUES (?, ?, ?)", (key, OF_AN_ANSWER, proof))
            self._seal(db, [key])

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
        with self._database.transaction() as db:
            db.execute("CREATE TEMP TABLE asked (key TEXT PRIMARY KEY)")
            db.execute("CREATE TEMP TABLE chosen (key TEXT PRIMARY KEY)")
            db.executemany("INSERT OR IGNORE INTO temp.asked VALUES (?)", [(key,) for key in keys or ()])
            db.execute(f"INSERT INTO temp.chosen SELECT key FROM rows WHERE {' AND '.join(chosen)}", given)
            among = "key IN (SELECT key FROM temp.chosen)"
            again = [key for (key,) in db.execute("SELECT key FROM temp.chosen")]
            changed = self._changed(db, again)
            count = db.execute(f"UPDATE rows SET {cleared}, status = 'not_run' WHERE {among}").rowcount
            freed = db.execute(f"SELECT coalesce(sum(bytes), 0) FROM answers WHERE {among}").fetchone()[0]
            for table in _KEPT:
                db.execute(f"DELETE FROM {table} WHERE {among}")
            self._seal(db, again, changed)
            db.execute("DROP TABLE temp.asked")
            db.execute("DROP TABLE temp.chosen")
        self._kept -= freed
        return count

    def withdraw(self, keys: Iterable[str]) -> None:
        """Take rows out of the results, with all that is kept of them."""
        assert self._written is not None, "only the process that writes a file seals"
        gone = [(key,) for key in keys]
        with self._database.transaction() as db:
            for table in (*_KEPT, "seals", "rows"):
                db.executemany(f"DELETE FROM {table} WHERE key = ?", gone)
        for (key,) in gone:
            self._written.pop(key, None)

    # -------------------------------------------------------------------------------------------- read

    def meta(self) -> dict[str, Any]:
        """Return facts of the run by name, with the refused files under `refused`, the solves that tell the machine's
        drift under `references`."""
        values = {name: json.loads(value) for name, value in self._database.read("SELECT name, value FROM meta")}
        if "solvers" in values:
            values["solvers"] = {current_label(label): sheet for label, sheet in values["solvers"].items()}
        values["refused"] = self._database.read("SELECT address, reason FROM refused ORDER BY address")
        values["references"] = self.references()
        return values

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
        return _row(rows[0])

    def rows(self) -> Iterator[Row]:
        """Yield every row, in the order in which they were planned."""
        for values in self._database.stream(f"SELECT {_ALL} FROM rows ORDER BY rowid"):
            yield _row(values)

    def ending(self, key: str) -> tuple[str, bytes | None]:
        """Return how a row ended: its status, and its compressed answer where one is kept."""
        rows = self._database.read(
            "SELECT status, answer FROM rows LEFT JOIN answers USING (key) WHERE key = ?", (key,)
        )
        if not rows:
            raise StoreError(f"{self.path}: no row {key}")
        return rows[0][0], rows[0][1]

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
        """Return all rows, in the order problem, label."""
        return whole_table(self._database)


def _row(values: Sequence[Any]) -> Row:
    """Return the row of values that were read, under the name that its solver has now."""
    row = Row(*values)
    solver, label = (name and current_label(name) for name in (row.solver, row.label))
    return row if (solver, label) == (row.solver, row.label) else replace(row, solver=solver, label=label)


def _into(names: Sequence[str]) -> str:
    """Return the columns and the places of values in a statement."""
    return f"({', '.join(f'{chr(34)}{name}{chr(34)}' for name in names)}) VALUES ({', '.join('?' * len(names))})"


OF_AN_ANSWER = "answer"
"""Kind of a certificate that is about an answer."""
_KEPT = ("answers", "histories", "certificates")
"""Tables of what is kept of single rows."""
_ALL = ", ".join(f'"{c}"' for c in (*PLANNED, *MEASURED))
_WHOLE = _into((*PLANNED, *MEASURED))
_FILLED = [name for name in MEASURED if name != "attempts"]
_FINISH = (
    f"UPDATE rows SET {', '.join(f'{chr(34)}{name}{chr(34)} = ?' for name in _FILLED)},"
    " attempts = coalesce(?, coalesce(attempts, 0) + 1) WHERE key = ?"
)
_planned_values, _measured_values = attrgetter(*PLANNED), attrgetter(*MEASURED)
_row_values = attrgetter(*PLANNED, *MEASURED)
_finish_values = attrgetter(*_FILLED, "attempts")
_ONE = f"{seals.READ} WHERE rows.key = ?"


def read_results(path: str | Path) -> pd.DataFrame:
    """Return the rows of a results file as a table, for scripts and notebooks; raises StoreError."""
    with Store(path) as store:
        return store.table()


def _text(value: Any) -> Any:
    """Return `value` as SQLite can store it: text with halves of characters, as broken file names have them, is
    escaped."""
    if isinstance(value, str) and not value.isascii():
        return value.encode("utf-8", "backslashreplace").decode()
    return value
