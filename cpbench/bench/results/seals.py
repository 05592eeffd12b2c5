"""Seals of rows: evidence that a row, with its answer, history and proof, is as a run of this user wrote it.

A seal has five parts: the name of the key, digests of what was planned, of what was measured and of what is kept
(answer, history, proof), and a digest of these with the key. Anybody can check the digests, which finds bits that were
flipped; whoever has the key can check the last part, which finds rows written by others. Columns without a value
are not in a digest: a later version may add some.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import compress
from typing import Any

from cpbench.bench.results import file_seal
from cpbench.bench.results.database import Database
from cpbench.bench.results.file_seal import Contents
from cpbench.bench.results.rows import stored
from cpbench.bench.results.schema import MEASURED, PLANNED, SCHEMA, SEALED_SINCE, WHOLE_SINCE
from cpbench.bench.results.seal_key import Key
from cpbench.errors import SealError

COLUMNS = (*PLANNED, *MEASURED)
PARTS = ("its plan", "its result", "its answer, history or proof")
SIZE, NAME = 10, 8
"""Bytes of a digest, characters of the name of a key."""
_COLUMNS = ", ".join(f'rows."{name}"' for name in COLUMNS)
READ = (
    f"SELECT {_COLUMNS}, answer, history, certificates.kind, proof, seal FROM rows"
    " LEFT JOIN answers USING (key) LEFT JOIN histories USING (key) LEFT JOIN certificates USING (key)"
    " LEFT JOIN seals USING (key)"
)
"""Query of all that is sealed, and the seal."""
NONE = "none"
"""In place of the name of a key, of a row without a seal."""
OWNERS = ("you", "key of another user", NONE)
"""Whose key sealed a row, for a reader."""
BROKEN = "broken"
"""In place of a seal where the run found that something else had written the row."""
NAMED = 20
"""Most rows that a message names."""
_encode = json.JSONEncoder(separators=(",", ":"), check_circular=False).encode
_FIRST, _LAST = len(PLANNED), len(COLUMNS)
_KINDS = tuple({**PLANNED, **MEASURED}.values())
_PLACE = {name: place for place, name in enumerate(COLUMNS)}


@dataclass(frozen=True)
class Broken:
    """A row that cannot be believed, and why."""

    key: str
    row: str
    why: str

    def __str__(self) -> str:
        return f"{self.row}: {self.why}"


@dataclass(frozen=True)
class Audit:
    """The result of checking all seals of a file: the rows that cannot be believed, what else was changed in it, and
    what could not be checked. `whose` : name of the key of its seals, NONE where rows have none, '' without rows."""

    path: str
    broken: Sequence[Broken] = ()
    changed: Sequence[str] = ()
    notes: Sequence[str] = ()
    whose: str = ""

    def require(self) -> None:
        """Raise SealError when there is something that cannot be believed."""
        if self.broken:
            listed = "; ".join(map(str, self.broken[:NAMED]))
            more = f"; and {len(self.broken) - NAMED} more" if len(self.broken) > NAMED else ""
            raise SealError(
                f"{self.path}: {len(self.broken)} of its rows cannot be believed: {listed}{more}. The same cpbench run "
                "removes them and runs their pairs again"
            )
        if self.changed:
            raise SealError(
                f"{self.path}: {'; '.join(self.changed)}: by another program. The same cpbench run goes on with it, "
                "and its reports keep this remark"
            )


def stored_part(values: Sequence[Any], part: slice) -> list[Any]:
    """Return the values of some columns, from those of the whole row, as SQLite hands them back."""
    return [stored(value, kind) for value, kind in zip(values, _KINDS[part], strict=True)]


def sealed(values: Sequence[Any], key: Key) -> str:
    """Return the seal of a row with the values that `READ` selects."""
    return assembled(_digests(values, key.name), key)


def assembled(digests: Iterable[str], key: Key) -> str:
    """Return the seal of a row with the digests of what was planned, measured and kept."""
    text = ".".join(digests)
    return f"{key.name}.{text}.{_signed(text, key)}"


def digests_of(seal: str) -> list[str]:
    """Return the digests of what was planned, measured and kept."""
    return seal.split(".")[1:-1]


def planned_digest(values: Sequence[Any], key: Key) -> str:
    """Return the digest of the planned columns, given in their order."""
    return _digest(0, stored_part(values, slice(0, _FIRST)), key.name.encode())


def measured_digest(values: Sequence[Any], key: Key) -> str:
    """Return the digest of the measured columns, given in their order."""
    return _digest(_FIRST, stored_part(values, slice(_FIRST, _LAST)), key.name.encode())


def kept_digest(parts: Sequence[Any], key: Key) -> str:
    """Return the digest of answer, history, kind of proof, and proof; None for each that is not kept."""
    kept = hashlib.blake2b(digest_size=SIZE, person=key.name.encode())
    _mix(kept, parts)
    return kept.hexdigest()


def origin(sealed_by: str | None, whose: str, own: str) -> str | None:
    """Return whose key sealed a row first, as a file that is sealed by the key `own` says it: None for that key.

    sealed_by : what the row says. whose : the key of the file that it is in.
    """
    if whose in ("", own) or sealed_by == NONE:
        return sealed_by
    return whose


def owner(first: str | None) -> str:
    """Return for a reader whose key sealed a row, from its `origin`."""
    return OWNERS[0] if first is None else NONE if first == NONE else OWNERS[1]


def _digests(values: Sequence[Any], name: str) -> tuple[str, str, str]:
    """Return the digests of what was planned, measured and kept; they depend on the key's name, so that it cannot be
    exchanged alone."""
    person = name.encode()
    kept = hashlib.blake2b(digest_size=SIZE, person=person)
    _mix(kept, values[_LAST:-1])
    return _digest(0, values[:_FIRST], person), _digest(_FIRST, values[_FIRST:_LAST], person), kept.hexdigest()


def _mix(digest: hashlib.blake2b, parts: Sequence[Any]) -> None:
    """Mix what is kept of a row into a digest."""
    for part in parts:
        if part is None:
            digest.update(b"-")
        else:
            raw = part if isinstance(part, bytes) else str(part).encode("utf-8", "backslashreplace")
            # with its length: else bytes could move from one part to the next
            digest.update(b"%d:" % len(raw))
            digest.update(raw)


def _digest(first: int, values: Sequence[Any], person: bytes) -> str:
    """Return the digest of some columns, '' where one has raw bytes, which no run writes."""
    present = tuple([value is not None for value in values])
    try:
        text = _names(first, present) + _encode(list(compress(values, present)))
    except TypeError:
        return ""
    return hashlib.blake2b(text.encode(), digest_size=SIZE, person=person).hexdigest()


@lru_cache(maxsize=2**10)
def _names(first: int, present: tuple[bool, ...]) -> str:
    """Return the columns that have a value, from the one at place `first`."""
    return ",".join(compress(COLUMNS[first:], present))


def _signed(digests: str, key: Key) -> str:
    return hashlib.blake2b(digests.encode(), digest_size=16, key=key.secret, person=b"cpbench row").hexdigest()


# ------------------------------------------------------------------------------------------------------- check


@dataclass(frozen=True)
class WrittenSeals:
    """Seals as the process that writes a file knows them: of each row by key, and the contents beside the rows."""

    seals: dict[str, str]
    contents: Contents


def audit(
    database: Database, path: str, key: Key | None, written: WrittenSeals | None = None, version: int = SCHEMA
) -> Audit:
    """Check a file against its seals, and against what the process that writes it knows.

    version : of the tables of the file; of one that is older than seals only contradictions within its rows are found.
    """
    database.require_whole()
    unsealed = version < SEALED_SINCE
    broken: list[Broken] = []
    names: Counter[str] = Counter()
    others: dict[str, list[Broken]] = {}
    seen = set[str]()
    for values in database.stream(READ):
        why = contradiction(values)
        if not (why or unsealed):
            why = unfit(values, key, None if written is None else written.seals)
            name = str(values[-1]).partition(".")[0]
            if not why:
                # rows of one file have one key; which one is only known when all were counted
                names[name] += 1
                if key is None or name != key.name:
                    others.setdefault(name, []).append(
                        _named(values, f"is sealed by the key {name}, the others are not")
                    )
        if why:
            broken.append(_named(values, why))
        seen.add(values[0])
    if not unsealed:
        broken += _lost(database, {} if written is None else written.seals, seen)
    whose = key.name if key is not None and names[key.name] else next((name for name, _ in names.most_common(1)), "")
    for name, rows in others.items():
        if name != whose:
            broken += rows
    changed: list[str] = []
    if version >= WHOLE_SINCE:
        changed = list(file_seal.changed(database, key, whose, None if written is None else written.contents))
    notes = _notes(path, version, key, whose, names[whose], written is not None or file_seal.ended(database))
    return Audit(path, broken, changed, notes, NONE if unsealed and seen else whose)


def _notes(path: str, version: int, key: Key | None, whose: str, count: int, ended: bool) -> list[str]:
    """Return what could not be checked."""
    notes: list[str] = []
    if version < SEALED_SINCE:
        notes.append(f"{path}: was made by an older cpbench, and its rows have no seals: changes cannot be found")
    elif version < WHOLE_SINCE:
        notes.append(
            f"{path}: was made by an older cpbench, and only its rows have seals: changes of its other facts, rows "
            "that were removed and older versions of rows cannot be found"
        )
    elif not ended:
        notes.append(
            f"{path}: the run that writes it did not end: rows that were removed and older versions of rows cannot be "
            "found"
        )
    if whose and (key is None or whose != key.name):
        notes.append(
            f"{path}: its {count} rows are sealed by the key {whose} of another user or machine: of changes only "
            "flipped bits can be found here"
        )
    return notes


def unfit(values: Sequence[Any], key: Key | None, written: Mapping[str, str] | None) -> str:
    """Return why a seal does not match its row, '' where it does."""
    seal = values[-1]
    if seal is None:
        return "has no seal"
    if seal == BROKEN:
        return "was changed by something else while it was run"
    name, *digests = str(seal).split(".")
    if len(digests) != len(PARTS) + 1 or len(name) != NAME or not name.isascii():
        return "its seal is not valid"
    signature = digests.pop()
    differ = [part for part, old, now in zip(PARTS, digests, _digests(values, name), strict=True) if old != now]
    if differ:
        return f"{' and '.join(differ)} changed after it was sealed"
    # others' keys are not here: of their rows the digests alone were compared
    if key is not None and name == key.name and not hmac.compare_digest(signature, _signed(".".join(digests), key)):
        return "its seal was not made by the key that it names"
    return "" if written is None or written.get(values[0]) == seal else "is not what this run wrote"


def _lost(database: Database, written: Mapping[str, str], seen: set[str]) -> Iterator[Broken]:
    """Yield rows that have disappeared."""
    orphans = {str(key) for (key,) in database.read("SELECT key FROM seals WHERE key NOT IN (SELECT key FROM rows)")}
    for key in sorted(orphans | (written.keys() - seen)):
        yield Broken(key, f"row {key}", "is missing")


def contradiction(values: Sequence[Any]) -> str:
    """Return how a row contradicts itself, '' where it does not."""
    status, error, tolerance = (values[_PLACE[name]] for name in ("status", "error", "tolerance"))
    if status == "not_run" and (error is not None or values[_PLACE["finished"]] is not None):
        return "is not_run and has results"
    if isinstance(error, float) and isinstance(tolerance, float):
        met = error <= tolerance
        if (status in ("solved", "stationary") and not met) or (status in ("wrong", "inaccurate") and met):
            return f"is {status} with error {error:.3g} at tolerance {tolerance:g}"
    return ""


def _named(values: Sequence[Any], why: str) -> Broken:
    label, problem = (values[_PLACE[name]] for name in ("label", "problem"))
    return Broken(str(values[0]), f"{label} on {problem}", why)
