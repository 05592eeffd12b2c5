"""Results in one SQLite file: a transaction a row, the answer and the history in the same transaction.

`kill -9` of the runner loses at most the pair in flight: planned rows are there from the start as `not_run`,
and a row is filled together with its answer or not at all. One process writes, any number read (`database`).
"""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.database import Database
from cpbench.bench.results.planned import LIMITS, agree, difference, limits_of, planned
from cpbench.bench.results.schema import MEASURED, PLANNED
from cpbench.bench.results.whole import whole_table
from cpbench.errors import StoreError

if TYPE_CHECKING:
    import pandas as pd

KEEP = ("none", "wrong", "all")
KEEP_LIMIT = 10**9
"""Bytes of answers after which `--keep all` stops keeping; rows without their answer say so."""


class Store:
    """A results file, opened for running (`create=True`) or for reading.

    For running, this process alone may write it, and an older file is migrated; for reading, the file is left as it
    is, whoever writes it meanwhile. May be used from several threads.

    Raises StoreError when the file is no results file, is of a newer version, is being written by another process or
    cannot be written; from every method, when SQLite fails.
    """

    def __init__(self, path: str | Path, *, create: bool = False, keep: str = "all") -> None:
        self.path = Path(path)
        self._keep = keep
        self._database = Database(self.path, create=create)
        try:
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
        """Bring all that is written into the one file; raises StoreError when that fails, where `close` would leave
        it in the log beside the file."""
        self._database.settle()

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
        """What a machine that solves is; told once a run."""
        with self._database.transaction() as db:
            db.execute("INSERT OR REPLACE INTO machines VALUES (?, ?)", (host, json.dumps(dict(description))))

    def note_features(self, features: Mapping[str, Mapping[str, Any]]) -> None:
        """Note the features of problems by fingerprint, in place of what was noted of them."""
        noted = [(fingerprint, json.dumps(dict(facts))) for fingerprint, facts in features.items()]
        with self._database.transaction() as db:
            db.executemany("INSERT OR REPLACE INTO problems VALUES (?, ?)", noted)

    def add_reference(self, pairs: int, seconds: float, loadavg: float | None = None) -> None:
        """A solve of the reference just now, after so many pairs: what it took [s], NaN if it failed, and the load of
        the machine."""
        at = time.strftime("%Y-%m-%dT%H:%M:%S")
        self.add_references([{"at": at, "pairs": pairs, "seconds": seconds, "loadavg": loadavg}])

    def add_references(self, solves: Iterable[Mapping[str, Any]]) -> None:
        """Solves as `references` gives them."""
        with self._database.transaction() as db:
            db.executemany("INSERT INTO reference VALUES (:at, :pairs, :seconds, :loadavg)", map(dict, solves))

    def add(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Whole rows, as `rows` gives them, in one transaction."""
        names = (*PLANNED, *MEASURED)
        marks = ", ".join("?" * len(names))
        with self._database.transaction() as db:
            db.executemany(f"INSERT INTO rows ({_ALL}) VALUES ({marks})", ([row[n] for n in names] for row in rows))

    def put(self, row: Mapping[str, Any], answer: bytes | None) -> None:
        """A whole row with its answer, in place of the one of its key."""
        names = (*PLANNED, *MEASURED)
        marks = ", ".join("?" * len(names))
        keep = answer is not None and self._kept + len(answer) <= KEEP_LIMIT
        with self._database.transaction() as db:
            for table in ("answers", "histories"):
                db.execute(f"DELETE FROM {table} WHERE key = ?", (row["key"],))
            db.execute(f"INSERT OR REPLACE INTO rows ({_ALL}) VALUES ({marks})", [_text(row[n]) for n in names])
            if answer is not None and keep:
                db.execute("INSERT INTO answers VALUES (?, ?, ?)", (row["key"], len(answer), answer))
                self._kept += len(answer)

    def add_kept(self, answers: Iterable[tuple[str, bytes]], histories: Iterable[tuple[str, bytes]]) -> None:
        """Answers and histories of rows that are there, as `answers` and `histories` give them."""
        with self._database.transaction() as db:
            db.executemany("INSERT INTO answers VALUES (?, ?, ?)", ((key, len(blob), blob) for key, blob in answers))
            db.executemany("INSERT INTO histories VALUES (?, ?)", histories)

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
        with self._database.transaction() as db:
            self._require_same_limits(pairs, keys)
            db.executemany(f"INSERT OR IGNORE INTO rows ({names}) VALUES ({marks})", rows)

    def _require_same_limits(self, pairs: list[Pair], keys: list[str]) -> None:
        columns = ", ".join(LIMITS)
        known: dict[str, set[tuple[Any, ...]]] = {}
        ours = "coalesce(origin, '') = ''"  # under which limits others solved is not known
        for name, *limits in self._database.read(f'SELECT DISTINCT "set", {columns} FROM rows WHERE {ours}'):
            known.setdefault(name, set()).add(tuple(limits))
        resumed = bool(known)
        for pair, key in zip(pairs, keys, strict=True):
            asked = limits_of(pair)
            there = self._database.read(f"SELECT {columns} FROM rows WHERE key = ?", (key,)) if resumed else []
            before = set(there) or known.setdefault(pair.set, {asked})
            if not any(agree(old, asked) for old in before):
                raise StoreError(f"{self.path}: {difference(pair.set, next(iter(before)), asked)}")

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
        with self._database.transaction() as db:
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
        with self._database.transaction() as db:
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
        values = {name: json.loads(value) for name, value in self._database.read("SELECT name, value FROM meta")}
        values["refused"] = self._database.read("SELECT address, reason FROM refused ORDER BY address")
        values["references"] = self.references()
        return values

    def machines(self) -> dict[str, dict[str, Any]]:
        """What the machines are that solved, by host."""
        return {host: json.loads(told) for host, told in self._database.read("SELECT * FROM machines ORDER BY host")}

    def features(self) -> dict[str, dict[str, Any]]:
        """The features of the problems by fingerprint, as `bench.planning.features` found them; those of rows that
        were planned before results kept them are not among them."""
        found = self._database.read("SELECT fingerprint, features FROM problems ORDER BY fingerprint")
        return {fingerprint: json.loads(told) for fingerprint, told in found}

    def references(self) -> list[dict[str, Any]]:
        """The solves of the reference, in order: at, pairs, seconds (None where it failed), loadavg."""
        names = ("at", "pairs", "seconds", "loadavg")
        found = self._database.read("SELECT at, pairs, seconds, loadavg FROM reference ORDER BY rowid")
        return [dict(zip(names, values, strict=True)) for values in found]

    def pending(self) -> set[str]:
        """Keys of planned rows that have not been run."""
        return {key for (key,) in self._database.read("SELECT key FROM rows WHERE status = 'not_run'")}

    def counts(self) -> dict[str, int]:
        """Rows by status."""
        return dict(self._database.read("SELECT status, count(*) FROM rows GROUP BY status"))

    def row(self, key: str) -> dict[str, Any]:
        """One row as a dictionary."""
        found = self._database.read(f"SELECT {_ALL} FROM rows WHERE key = ?", (key,))
        if not found:
            raise StoreError(f"{self.path}: no row {key}")
        return dict(zip((*PLANNED, *MEASURED), found[0], strict=True))

    def rows(self) -> Iterator[dict[str, Any]]:
        """Every row as a dictionary, in the order in which they were planned."""
        for values in self._database.stream(f"SELECT {_ALL} FROM rows ORDER BY rowid"):
            yield dict(zip((*PLANNED, *MEASURED), values, strict=True))

    def ending(self, key: str) -> tuple[str, bytes | None]:
        """How a row ended: its status, and its compressed answer where one is kept."""
        found = self._database.read(
            "SELECT status, answer FROM rows LEFT JOIN answers USING (key) WHERE key = ?", (key,)
        )
        if not found:
            raise StoreError(f"{self.path}: no row {key}")
        return found[0][0], found[0][1]

    def answers(self) -> Iterator[tuple[str, bytes]]:
        """(key, compressed answer) of every kept answer."""
        yield from self._database.stream("SELECT key, answer FROM answers ORDER BY key")

    def histories(self) -> Iterator[tuple[str, bytes]]:
        """(key, compressed history) of every kept history."""
        yield from self._database.stream("SELECT key, history FROM histories ORDER BY key")

    def table(self) -> pd.DataFrame:
        """All rows, in the order problem, label."""
        return whole_table(self._database)


_ALL = ", ".join(f'"{c}"' for c in (*PLANNED, *MEASURED))


def read_results(path: str | Path) -> pd.DataFrame:
    """The rows of a results file as a table, for scripts and notebooks; raises StoreError."""
    with Store(path) as store:
        return store.table()


def _text(value: Any) -> Any:
    """`value` as SQLite can store it: text with halves of characters, as broken file names have them, is escaped."""
    if isinstance(value, str) and not value.isascii():
        return value.encode("utf-8", "backslashreplace").decode()
    return value
