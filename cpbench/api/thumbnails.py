"""Pictures of the problems of a run for its page: what is at hand is read again, in a process beside this one.

A results file may come from anywhere, and so may the files that it names. They are read by a process that has a limit
of time and memory, and may die of one. What is not at hand, is no longer the problem that was run, or takes too long,
has no picture but words that say why.
"""

from __future__ import annotations

import json
import math
import os
import threading
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.analysis import table as rows_of
from cpbench.api import thumbnail_process
from cpbench.api.thumbnail_process import MEMORY, UNREADABLE, Sitter
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.errors import FormatError
from cpbench.formulations.base import formulations
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation import frames
from cpbench.storage.base import split_address

if TYPE_CHECKING:
    import pandas as pd

    from cpbench.analysis.thumbnails import Thumbnail
    from cpbench.bench.results.store import Store

SECONDS = 5.0
"""Seconds that reading all of them may take, from the first on."""
PATIENCE = 1.0
"""Seconds that one may take."""
STARTUP = 20.0
"""Seconds within which the process is there; they pass while the rest of the report is made."""
BYTES = 400_000
"""Bytes that the pictures of a page may take, compressed."""
COLUMNS = ("address", "family", "tolerance", "node", "status", "error")
"""Columns that are read of the rows, beside their identity."""
MOST = 4000
"""Problems that are asked for."""

SLOW = f"Reading its file, or making it, took more than {PATIENCE:g} s."
SPENT = (
    f"The pictures of a page may take {SECONDS:g} s and {BYTES // 1000} kB, problems in small files first: "
    "the others took them."
)
ALONE = "No process could be started here to read it in."


class Thumbnails:
    """Thumbnails by fingerprint, in the making from the moment on that this is made; a call waits for them.

    The answers are those of `store`, the rows `table` is about; addresses that are relative are looked for from here
    and from the folder of the results.
    """

    def __init__(self, store: Store, table: pd.DataFrame) -> None:
        self._found: dict[str, Thumbnail] = {}
        self._sitters = sitters(store, rows_of.normalised(table, COLUMNS))
        self._thread = threading.Thread(target=self._paint, daemon=True)
        self._thread.start()

    def __call__(self) -> Mapping[str, Thumbnail]:
        self._thread.join()
        return self._found

    def _paint(self) -> None:
        self._found |= paint(self._sitters)


def sitters(store: Store, rows: pd.DataFrame) -> list[Sitter]:
    """Return the problems of the rows, those in small files first, each contact problem with its best verified
    answer."""
    formats: Mapping[str, str] = store.meta().get("formats") or {}
    first = rows.drop_duplicates("fingerprint")
    answers = _answers(store, rows)
    chosen: list[Sitter] = []
    for row in first[["fingerprint", "address", "family", "tolerance"]].to_dict("records"):
        address, fingerprint = str(row["address"]), str(row["fingerprint"])
        place, size = _place(address, store.path.parent)
        answer = answers.get(fingerprint, (b"", "", 0.0))
        chosen.append(
            Sitter(fingerprint, place, formats.get(address), row["family"], size, float(row["tolerance"]), *answer)
        )
    return sorted(chosen, key=lambda one: (not one.place, one.size, one.place))


def _place(address: str, folder: Path) -> tuple[str, int]:
    """Return where the file of an address is, and its bytes; ('', 0) where there is no ordinary file and no folder."""
    for base in (Path.cwd(), folder) if address else ():
        place = os.path.abspath(base / address)
        try:
            file, _ = split_address(place)
            if file.is_file():
                return place, file.stat().st_size
            if file.is_dir():
                return place, 0
        except (OSError, ValueError, FormatError):
            continue
    return "", 0


def _answers(store: Store, rows: pd.DataFrame) -> dict[str, tuple[bytes, str, float]]:
    """Return the kept answer of least error of each contact problem that somebody solved, its label and error."""
    contact = [name for name in formulations.names() if issubclass(formulations.get(name), ContactProblem)]
    solved = rows.loc[
        rows["node"].isin(contact) & rows_of.met(rows), ["fingerprint", "key", "label", "error"]
    ].sort_values("error", kind="stable")
    answers: dict[str, tuple[bytes, str, float]] = {}
    for row in solved.drop_duplicates("fingerprint").to_dict("records"):
        _, kept = store.ending(str(row["key"]))
        if kept is not None:
            answers[str(row["fingerprint"])] = kept, str(row["label"]), float(row["error"])
    return answers


def paint(sitters: Sequence[Sitter]) -> dict[str, Thumbnail]:
    """Draw the thumbnails and return them by fingerprint, or {"why": words}."""
    pictures: dict[str, Thumbnail] = {one.fingerprint: {"why": SPENT} for one in sitters}
    spent = 0
    for one, picture in _read(sitters[:MOST]):
        spent += len(zlib.compress(json.dumps(picture).encode()))
        if spent > BYTES:
            break
        pictures[one.fingerprint] = picture
    return pictures


def _read(sitters: Sequence[Sitter]) -> Iterator[tuple[Sitter, Thumbnail]]:
    """Yield each as it comes, until the time is over; after one that takes its process down, by another process."""
    left, end = list(sitters), math.inf
    while left and time.monotonic() < end:
        try:
            child = Child(context(1), thumbnail_process.main, ([astuple(one) for one in left],), memory=MEMORY)
        except Died:
            yield from ((one, {"why": ALONE}) for one in left)
            return
        fatal, last = "", left[0]
        try:
            child.receive(STARTUP)
            end = min(end, time.monotonic() + SECONDS)
            while left and not fatal and time.monotonic() < end:
                picture, fatal = _next(child)
                last = left.pop(0)
                yield last, picture
        except (Died, TimedOut):
            yield from ((one, {"why": ALONE}) for one in left)
            return
        finally:
            child.kill()
        if fatal:  # it speaks for the others of its file: none of them is worth another process
            yield from ((one, {"why": fatal}) for one in left if _source(one) == _source(last))
            left = [one for one in left if _source(one) != _source(last)]


def _next(child: Child) -> tuple[Thumbnail, str]:
    """Return the next thumbnail, or why there is none; the words again where the process cannot go on."""
    try:
        header, _ = frames.unpack(child.receive(PATIENCE))
        return header["thumbnail"], ""
    except TimedOut:
        why = SLOW
    except Died as death:
        why = f"Reading its file ended the process that did: {death.cause}."
    except (frames.FrameError, KeyError):
        why = UNREADABLE
    return {"why": why}, why


def _source(one: Sitter) -> tuple[str, str]:
    return ("", one.family) if not one.place else (str(split_address(one.place)[0]), "")
