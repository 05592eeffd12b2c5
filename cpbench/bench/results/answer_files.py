"""Answers made elsewhere: which file of a folder answers which problem, and what is reported with them.

An entry of the folder is a file of an answer or a folder of arrays, named after its problem or its fingerprint
(8 digits of it at least). HDF5 answers that carry a fingerprint are known by that. `cpbench results export --answers`
writes all answers to one HDF5 file: a group a problem, which has its fingerprint, with a data set for every solver.

Reported values: a table with the columns problem, seconds[, iterations, claim], and `claim.json`: in the folder an
object problem -> claim, in the folder of one answer an object with claim, seconds, iterations.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, cast

from cpbench import storage
from cpbench.errors import CpbenchError, FormatError, PointError
from cpbench.formulations.base import Problem
from cpbench.formulations.exchange import exchanges
from cpbench.formulations.primal import Primal, primal_alone, primal_of, primal_part
from cpbench.solvers.base import Claim
from cpbench.storage.hdf5_tree import SIGNATURE, open_tree

CLAIMS = "claim.json"
ENDINGS = ("timeout", "memout", "crash", "unsupported")
"""How a solve may have ended without a claim."""
_SUFFIXES = (".h5", ".hdf5", ".npz", ".npy", ".csv", ".txt", ".sol")
_COLUMNS = ("problem", "seconds", "iterations", "claim")
_SHORTEST = 8
"""Fewest digits of a fingerprint that name a problem."""

Read: TypeAlias = Callable[[Problem], Any]
"""The answer to a problem, a point or a `Primal`; raises FormatError."""


@dataclass(frozen=True)
class Reported:
    """Reported facts of a solve; None and "" where they are not reported."""

    claim: str = ""
    seconds: float | None = None
    iterations: int | None = None

    def over(self, other: Reported) -> Reported:
        """Return these facts, completed from `other`."""
        return Reported(
            self.claim or other.claim,
            other.seconds if self.seconds is None else self.seconds,
            other.iterations if self.iterations is None else self.iterations,
        )


@dataclass(frozen=True)
class ForeignAnswer:
    """An answer that is not read yet: its place, its reader, what its own folder reports."""

    place: str
    read: Read
    reported: Reported = Reported()


class Names:
    """Names and fingerprints of the problems, to find the one that somebody else's name means."""

    def __init__(self, problems: Iterable[tuple[str, str]]) -> None:
        self._fingerprints: set[str] = set()
        self._named: dict[str, set[str]] = {}
        for name, fingerprint in problems:
            self._fingerprints.add(fingerprint)
            self._named.setdefault(name, set()).add(fingerprint)

    def find(self, word: str) -> str:
        """Return the fingerprint of the problem with this name, "" for none; raises CpbenchError for several."""
        found = self._named.get(word, set())
        if not found and len(word) >= _SHORTEST:
            found = {f for f in self._fingerprints if f.startswith(word.lower())}
        if len(found) > 1:
            listed = ", ".join(sorted(f[:_SHORTEST] for f in found)[:4])
            raise CpbenchError(f"'{word}' is the name of {len(found)} problems ({listed}): use the fingerprint")
        return next(iter(found), "")


def find(source: Path, names: Names, solver: str, tolerance: float) -> tuple[dict[str, ForeignAnswer], list[str]]:
    """Return the answers by fingerprint, and a line for each that answers none of the problems.

    Raises CpbenchError when a problem has two answers, FormatError when `source` holds none.
    """
    if not source.exists():
        raise FormatError(source, "", "no such file or folder")
    found: dict[str, ForeignAnswer] = {}
    stray: list[str] = []
    listed = _in_folder(source) if source.is_dir() else _in_export(source, solver, tolerance)
    for words, answer in listed:
        fingerprint = next(filter(None, map(names.find, words)), "")
        if not fingerprint:
            stray.append(f"{answer.place}: no problem is called {words[-2 if len(words) > 1 else 0]}")
            continue
        if fingerprint in found:
            raise CpbenchError(f"{found[fingerprint].place} and {answer.place} answer one problem: leave one of them")
        found[fingerprint] = answer
    if not found and not stray:
        raise FormatError(source, "", "holds no answer")
    return found, stray


def reported(source: Path, times: Path | None, names: Names) -> tuple[dict[str, Reported], list[str]]:
    """Return what the table of times and the folder's claims report, by fingerprint, and a line for each unknown
    problem."""
    found: dict[str, Reported] = {}
    stray: list[str] = []
    entries = _claims(source / CLAIMS) if source.is_dir() else []
    entries += _times(times) if times is not None else []
    for place, word, entry in entries:
        fingerprint = names.find(word)
        if fingerprint:
            found[fingerprint] = entry.over(found.get(fingerprint, Reported()))
        else:
            stray.append(f"{place}: no problem is called {word}")
    return found, stray


# ------------------------------------------------------------------------------------------------ answers


def _in_folder(folder: Path) -> list[tuple[list[str], ForeignAnswer]]:
    """Return the possible names of each entry of a folder, with its answer."""
    listed: list[tuple[list[str], ForeignAnswer]] = []
    for entry in sorted(folder.iterdir()):
        if entry.name.startswith(".") or entry.name == CLAIMS:
            continue
        if entry.is_file() and entry.suffix.lower() == ".csv" and _is_table(entry):
            continue
        words = [entry.name, *(entry.name[: -len(s)] for s in _SUFFIXES if entry.name.lower().endswith(s))]
        own = entry / CLAIMS
        reported = _facts(own, _object(own)) if entry.is_dir() and own.is_file() else Reported()
        listed.append(([*_fingerprint(entry), *words[::-1]], ForeignAnswer(str(entry), _reader(entry), reported)))
    return listed


def _reader(entry: Path) -> Read:
    """Return the reader of a file or of a folder of arrays."""
    if entry.is_dir():
        return lambda problem: _of_folder(entry, problem)
    for exchange in exchanges:
        if exchange.answer_name and exchange.answer_name.endswith(entry.suffix):
            return partial(exchange.read_answer, entry)
    return lambda problem: storage.load_answer(entry, problem, primal=True)


def _of_folder(folder: Path, problem: Problem) -> Any:
    """Return the answer in a folder of arrays, of which the unknowns will do."""
    files = {file.stem: file for file in folder.iterdir()}
    if primal_alone(problem, files):
        return _unknowns(files[problem.primal], problem, storage.read_vector(files[problem.primal]))
    return exchanges.get("npy-dir").read_answer(folder, problem)


def _unknowns(file: Path, problem: Problem, values: Any) -> Primal:
    try:
        return primal_part(problem, values)
    except PointError as cause:
        raise FormatError(file, "", str(cause)) from None


def _fingerprint(entry: Path) -> list[str]:
    """Return the fingerprint of its problem in an HDF5 answer, as a list that is empty where there is none."""
    if not entry.is_file() or entry.suffix.lower() not in (".h5", ".hdf5"):
        return []
    try:
        with open_tree(entry) as root:
            fingerprint = root.child("solution").attributes().get("fingerprint") if "solution" in root else None
    except FormatError:
        return []  # reading it as an answer gives the reason
    return [fingerprint] if isinstance(fingerprint, str) else []


def _in_export(path: Path, solver: str, tolerance: float) -> list[tuple[list[str], ForeignAnswer]]:
    """Return the answers by `solver` in a file of `results export --answers`, or the only one of each problem."""
    with path.open("rb") as file:
        if file.read(8) != SIGNATURE:
            raise FormatError(
                path, "", "is not a folder of answers, and no HDF5 file of cpbench results export --answers"
            )
    listed: list[tuple[list[str], ForeignAnswer]] = []
    with open_tree(path) as root:
        for name in root.names():
            group = root.child(name) if root.is_group(name) else None
            fingerprint = group.attributes().get("fingerprint") if group is not None else None
            if group is None or not isinstance(fingerprint, str):
                raise root.error(name, "is no group with a fingerprint, as cpbench results export --answers writes it")
            labels = [label for label in group.names() if not group.is_group(label)]
            mine = [label for label in labels if label.partition(" tol=")[0] == solver]
            exact = [label for label in mine if label == f"{solver} tol={tolerance:g}"]
            chosen = next((some for some in (exact, mine, labels) if len(some) == 1), [])
            if not chosen:
                raise group.error("", f"holds {', '.join(labels[:4])}: --solver names none of them, or several")
            vector, claimed = group.array(chosen[0]), group.attributes(chosen[0]).get("claim", "")
            claim = str(claimed) if claimed in list(Claim) else ""
            listed.append(
                (
                    [fingerprint, name],
                    ForeignAnswer(f"{path}::{name}", lambda p, x=vector: _point(path, p, x), Reported(claim)),
                )
            )
    return listed


def _point(path: Path, problem: Problem, vector: Any) -> Any:
    try:
        return primal_of(problem, vector) or problem.point_from_vector(vector)
    except PointError as cause:
        raise FormatError(path, "", str(cause)) from None


# ----------------------------------------------------------------------------------------------- reported


def _claims(path: Path) -> list[tuple[str, str, Reported]]:
    if not path.is_file():
        return []
    entries = _object(path)
    return [
        (str(path), word, _facts(path, cast("dict[str, Any]", facts) if isinstance(facts, dict) else {"claim": facts}))
        for word, facts in entries.items()
    ]


def _object(path: Path) -> dict[str, Any]:
    try:
        found: Any = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as cause:
        raise FormatError(path, "", f"is not readable JSON ({cause})") from None
    if not isinstance(found, dict):
        raise FormatError(path, "", "holds no JSON object")
    return cast("dict[str, Any]", found)


def _is_table(path: Path) -> bool:
    """Return whether a CSV is a table of times rather than an answer."""
    with path.open(encoding="utf-8", errors="replace") as file:
        head = file.readline(4096)
    return [word.strip().lower() for word in head.split(",")][:2] == list(_COLUMNS[:2])


def _times(path: Path) -> list[tuple[str, str, Reported]]:
    """Return (place, problem, reported facts) of every line; raises FormatError."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as cause:
        raise FormatError(path, "", f"is not a readable table ({cause})") from None
    head = [word.strip().lower() for word in lines[0]] if lines else []
    if head[:1] != ["problem"] or "seconds" not in head or not set(head) <= set(_COLUMNS):
        raise FormatError(path, "line 1", f"is {','.join(head)[:80]!r}, expected problem,seconds[,iterations,claim]")
    result: list[tuple[str, str, Reported]] = []
    for number, line in enumerate(lines[1:], 2):
        if not any(cell.strip() for cell in line):
            continue
        place = f"line {number}"
        if len(line) != len(head):
            raise FormatError(path, place, f"has {len(line)} cells, expected {len(head)}")
        cells = dict(zip(head, (cell.strip() for cell in line), strict=True))
        result.append((f"{path}: {place}", cells["problem"], _facts(path, cells, place)))
    return result


def _facts(path: Path, table: Mapping[str, Any], place: str = "") -> Reported:
    """Return the reported facts, checked; raises FormatError."""

    def number(name: str) -> float | None:
        given = table.get(name)
        if given is None or given == "":
            return None
        try:
            value = float(given)
        except (TypeError, ValueError, OverflowError):
            value = math.nan
        if not 0 <= value < math.inf or isinstance(given, bool):
            raise FormatError(path, place or name, f"has {name} {str(given)[:40]!r}, expected a number of at least 0")
        return value

    claim = table.get("claim") or ""
    known: Sequence[str] = (*map(str, Claim), *ENDINGS)
    if claim and claim not in known:
        raise FormatError(path, place or "claim", f"has claim {str(claim)[:40]!r}, expected one of {', '.join(known)}")
    iterations = number("iterations")
    return Reported(str(claim), number("seconds"), None if iterations is None else int(iterations))
