"""Seals of rows: evidence that a row, with its answer, history and proof, is as a run of this user wrote it.

A seal has five parts: the name of the key, digests of what was planned, of what was measured and of what is kept
(answer, history, proof), and a digest of these with the key. Anybody can check the digests, which finds bits that were
flipped; whoever has the key can check the last part, which finds rows that somebody else wrote. Columns without a value
are not in a digest: a later version may add some.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import compress
from typing import Any

from cpbench.bench.results.database import Database
from cpbench.bench.results.schema import MEASURED, PLANNED
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
BROKEN = "broken"
"""In place of a seal where the run found that something else had written the row."""
NAMED = 20
"""Most rows that a message names."""
_encode = json.JSONEncoder(separators=(",", ":"), check_circular=False).encode
_FIRST, _LAST = len(PLANNED), len(COLUMNS)
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
    """The result of checking all seals of a file: the rows that cannot be believed, and what could not be checked."""

    path: str
    broken: Sequence[Broken] = ()
    note: str = ""

    def require(self) -> None:
        """Raise SealError when there is a row that cannot be believed."""
        if not self.broken:
            return
        listed = "; ".join(map(str, self.broken[:NAMED]))
        more = f"; and {len(self.broken) - NAMED} more" if len(self.broken) > NAMED else ""
        raise SealError(
            f"{self.path}: {len(self.broken)} of its rows cannot be believed: {listed}{more}. The same cpbench run "
            "removes them and runs their pairs again"
        )


def sealed(values: Sequence[Any], key: Key) -> str:
    """Return the seal of a row with the values that `READ` selects."""
    digests = ".".join(_digests(values, key.name))
    return f"{key.name}.{digests}.{_signed(digests, key)}"


def same_plan(one: str, other: str) -> bool:
    """Return whether two seals are of rows with the same planned columns."""
    return one.split(".")[1:2] == other.split(".")[1:2]


def _digests(values: Sequence[Any], name: str) -> tuple[str, str, str]:
    """Return the digests of what was planned, measured and kept; they depend on the key's name, so that it cannot be
    exchanged alone."""
    person = name.encode()
    kept = hashlib.blake2b(digest_size=SIZE, person=person)
    for part in values[_LAST:-1]:
        if part is None:
            kept.update(b"-")
        else:
            raw = part if isinstance(part, bytes) else str(part).encode("utf-8", "backslashreplace")
            # with its length: else bytes could move from one part to the next
            kept.update(b"%d:" % len(raw))
            kept.update(raw)
    return _digest(0, values[:_FIRST], person), _digest(_FIRST, values[_FIRST:_LAST], person), kept.hexdigest()


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


def audit(
    database: Database, path: str, key: Key | None, written: Mapping[str, str] | None = None, *, unsealed: bool = False
) -> Audit:
    """Check every row of a file against its seal, and against what `written` remembers of this run by key.

    unsealed : the file is older than seals; only contradictions within its rows are found.
    """
    database.require_whole()
    broken: list[Broken] = []
    names: Counter[str] = Counter()
    others: dict[str, list[Broken]] = {}
    seen = set[str]()
    for values in database.stream(READ):
        why = contradiction(values)
        if not (why or unsealed):
            why = unfit(values, key, written)
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
        broken += _lost(database, written or {}, seen)
    whose = key.name if key is not None and names[key.name] else next((name for name, _ in names.most_common(1)), "")
    for name, rows in others.items():
        if name != whose:
            broken += rows
    return Audit(path, broken, _note(path, unsealed, key, whose, names[whose]))


def _note(path: str, unsealed: bool, key: Key | None, whose: str, count: int) -> str:
    if unsealed:
        return f"{path}: was made by an older cpbench, and its rows have no seals: changes cannot be found"
    if whose and (key is None or whose != key.name):
        return (
            f"{path}: its {count} rows are sealed by the key {whose} of another user or machine: of changes only "
            "flipped bits can be found here"
        )
    return ""


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
