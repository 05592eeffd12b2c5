"""Answers made elsewhere: which file of a folder answers which problem, and what a table reports of them.

An entry of the folder is a file of an answer or a folder of arrays, named after its problem or its fingerprint
(8 digits of it at least). HDF5 answers that carry a fingerprint are known by that. The table has the columns problem,
seconds[, iterations, claim].
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from cpbench import storage
from cpbench.errors import CpbenchError, FormatError, PointError
from cpbench.formulations.base import Problem
from cpbench.formulations.exchange import exchanges
from cpbench.formulations.primal import Primal, primal_alone, primal_part
from cpbench.solvers.base import Claim
from cpbench.storage.hdf5_tree import open_tree

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


@dataclass(frozen=True)
class ForeignAnswer:
    """An answer that is not read yet: its place, and its reader."""

    place: str
    read: Read


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


def find(source: Path, names: Names) -> tuple[dict[str, ForeignAnswer], list[str]]:
    """Return the answers by fingerprint, and a line for each that answers none of the problems.

    Raises CpbenchError when a problem has two answers, FormatError when `source` holds none.
    """
    if not source.is_dir():
        raise FormatError(source, "", "is no folder of answers")
    found: dict[str, ForeignAnswer] = {}
    stray: list[str] = []
    for words, answer in _in_folder(source):
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


def reported(times: Path | None, names: Names) -> tuple[dict[str, Reported], list[str]]:
    """Return what the table of times reports, by fingerprint, and a line for each unknown problem."""
    found: dict[str, Reported] = {}
    stray: list[str] = []
    for place, word, entry in _times(times) if times is not None else ():
        fingerprint = names.find(word)
        if fingerprint:
            found[fingerprint] = entry
        else:
            stray.append(f"{place}: no problem is called {word}")
    return found, stray


# ------------------------------------------------------------------------------------------------ answers


def _in_folder(folder: Path) -> list[tuple[list[str], ForeignAnswer]]:
    """Return the possible names of each entry of a folder, with its answer."""
    listed: list[tuple[list[str], ForeignAnswer]] = []
    for entry in sorted(folder.iterdir()):
        if entry.name.startswith("."):
            continue
        if entry.is_file() and entry.suffix.lower() == ".csv" and _is_table(entry):
            continue
        words = [entry.name, *(entry.name[: -len(s)] for s in _SUFFIXES if entry.name.lower().endswith(s))]
        listed.append(([*_fingerprint(entry), *words[::-1]], ForeignAnswer(str(entry), _reader(entry))))
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


# ----------------------------------------------------------------------------------------------- reported


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


def _facts(path: Path, table: Mapping[str, str], place: str) -> Reported:
    """Return the reported facts, checked; raises FormatError."""

    def number(name: str) -> float | None:
        given = table.get(name, "")
        if not given:
            return None
        try:
            value = float(given)
        except ValueError:
            value = math.nan
        if not 0 <= value < math.inf:
            raise FormatError(path, place, f"has {name} {given[:40]!r}, expected a number of at least 0")
        return value

    claim = table.get("claim", "")
    known: Sequence[str] = (*map(str, Claim), *ENDINGS)
    if claim and claim not in known:
        raise FormatError(path, place, f"has claim {claim[:40]!r}, expected one of {', '.join(known)}")
    iterations = number("iterations")
    return Reported(claim, number("seconds"), None if iterations is None else int(iterations))
