"""The seal over a whole results file: evidence of what is in it beside its rows, and of which rows it has.

It has the name of a key, a digest of every table in `TABLES`, one of the sorted seals of all rows (`OPEN` until a run
has ended), and a digest of these with the key. A writer of a file knows what it has written (`Contents`), and seals
that: never what SQLite hands back.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import sqlite3
from collections.abc import Iterable, Iterator
from typing import Any

from cpbench.bench.results.database import Database
from cpbench.bench.results.rows import stored
from cpbench.bench.results.seal_key import Key

OPEN = "open"
"""In place of the digest of the rows, while a run writes them."""
SIZE = 10
"""Bytes of a digest."""
TABLES = {
    "meta": ("its facts (command, plan, machine, seed)", ("TEXT", "TEXT")),
    "machines": ("its machines", ("TEXT", "TEXT")),
    "problems": ("the features of its problems", ("TEXT", "TEXT")),
    "refused": ("its list of refused files", ("TEXT", "TEXT")),
    "reference": ("its reference solves", ("TEXT", "INTEGER", "REAL", "REAL")),
}
"""The tables that are sealed, in words, with the types of their columns. Proved problems are not among them: their
fingerprints, which are in the rows, are digests of them."""
ROWS = "which rows it has, or their seals"


class Contents:
    """Contents of the tables beside the rows: a digest of every line, by table and key."""

    def __init__(self) -> None:
        self._lines: dict[str, dict[Any, bytes]] = {table: {} for table in TABLES}
        self._digests: dict[str, str] = {}

    def put(self, table: str, *values: Any) -> None:
        """Note a line in place of the one with its key, which is its first value; one of the reference comes last."""
        lines = self._lines[table]
        key = len(lines) if table == "reference" else values[0]
        kept = [stored(value, kind) for value, kind in zip(values, TABLES[table][1], strict=True)]
        lines[key] = hashlib.blake2b(json.dumps([key, *kept], default=bytes.hex).encode(), digest_size=SIZE).digest()
        self._digests.pop(table, None)

    def remove(self, table: str, key: Any) -> None:
        """Note that a line is gone, if it was there."""
        self._lines[table].pop(key, None)
        self._digests.pop(table, None)

    def digests(self) -> list[str]:
        """Return the digest of every table, in the order of TABLES."""
        for table in TABLES.keys() - self._digests.keys():
            lines = b"".join(sorted(self._lines[table].values()))
            self._digests[table] = hashlib.blake2b(lines, digest_size=SIZE).hexdigest()
        return [self._digests[table] for table in TABLES]


def contents(database: Database) -> Contents:
    """Return what is in a file."""
    result = Contents()
    for table in TABLES:
        for values in database.stream(f"SELECT * FROM {table} ORDER BY rowid"):
            result.put(table, *values)
    return result


def digest_of_rows(seals: Iterable[tuple[str, str]]) -> str:
    """Return the digest of the seals of all rows, given as (key of the row, seal) sorted by key."""
    mixed = hashlib.blake2b(digest_size=SIZE)
    for key, seal in seals:
        mixed.update(f"{key} {seal}\n".encode("utf-8", "backslashreplace"))
    return mixed.hexdigest()


def sealed(tables: Iterable[str], rows: str, key: Key) -> str:
    """Return the seal over a file with these digests."""
    digests = ".".join((*tables, rows))
    return f"{key.name}.{digests}.{_signed(digests, key)}"


def write(db: sqlite3.Connection, seal: str) -> None:
    """Put the seal into a file, within the caller's transaction."""
    db.execute("INSERT OR REPLACE INTO file_seal VALUES (1, ?)", (seal,))


def read(database: Database) -> str:
    """Return the seal over a file, '' where it has none, or more than one."""
    seals = [str(seal) for (seal,) in database.read("SELECT seal FROM file_seal")]
    return seals[0] if len(seals) == 1 else ""


def ended(database: Database) -> bool:
    """Return whether the run that wrote a file has ended."""
    return read(database).split(".")[-2:-1] != [OPEN]


def changed(database: Database, key: Key | None, whose: str, known: Contents | None = None) -> Iterator[str]:
    """Yield in words what of a file is not as its seal says, and of a file that this process writes, as it is known.

    whose : the name of the key of its rows, '' where it has none.
    """
    seal = read(database)
    name, *digests = seal.split(".")
    if len(digests) != len(TABLES) + 2 or (whose and name != whose):
        yield f"its seal over the whole file is {'not valid' if seal else 'missing'}"
        return
    signature = digests.pop()
    if key is not None and name == key.name and not hmac.compare_digest(signature, _signed(".".join(digests), key)):
        yield "its seal over the whole file was not made by the key that it names"
        return
    there = contents(database).digests()
    asked = known.digests() if known is not None else digests[:-1]
    for (words, _), digest, now in zip(TABLES.values(), asked, there, strict=True):
        if digest != now:
            yield f"{words} changed after it was sealed"
    by_key = "SELECT key, seal FROM seals ORDER BY key"
    if digests[-1] != OPEN and digests[-1] != digest_of_rows(database.stream(by_key)):  # type: ignore[arg-type]
        yield f"{ROWS} changed after the run ended"


def _signed(digests: str, key: Key) -> str:
    return hashlib.blake2b(digests.encode(), digest_size=16, key=key.secret, person=b"cpbench file").hexdigest()
