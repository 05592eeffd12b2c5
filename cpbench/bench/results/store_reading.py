"""Reading of a results file, whoever writes it meanwhile: rows, with whose key sealed them, and facts of the run."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.bench.results import seals
from cpbench.bench.results.database import Database
from cpbench.bench.results.rows import Row
from cpbench.bench.results.schema import MEASURED, PLANNED, SEALED_SINCE
from cpbench.bench.results.seal_key import Key
from cpbench.bench.results.whole import whole_table
from cpbench.errors import StoreError
from cpbench.solvers.renamed import current_label

if TYPE_CHECKING:
    import pandas as pd

_ALL = ", ".join(f'"{c}"' for c in (*PLANNED, *MEASURED))
_READ_KEPT = """
    SELECT key, answer, history, certificates.kind, proof FROM rows LEFT JOIN answers USING (key)
    LEFT JOIN histories USING (key) LEFT JOIN certificates USING (key)
    WHERE coalesce(answer, history, proof) IS NOT NULL ORDER BY key
"""


class StoreReader:
    """The readers of an open results file. Raises StoreError from every method, when SQLite fails."""

    path: Path
    _database: Database
    _key: Key | None
    _whose: str
    """Name of the key of the seals, for reading."""
    _notes: Sequence[str]
    """What could not be checked of the seals."""

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

    def _whose_seals(self) -> str:
        """Return the name of the key of the seals, NONE where rows have none; '' where there is no row."""
        if self._database.found < SEALED_SINCE:
            return seals.NONE
        found = self._database.read("SELECT seal FROM seals WHERE seal <> ? LIMIT 1", (seals.BROKEN,))
        return str(found[0][0]).partition(".")[0] if found else ""
