"""What the scripts of races share: one thread on one core for both sides, and a race as data.

Sides take turns, and each is in a process of its own: on a shared machine two cores differ by half for minutes, and a
race between processes that stay on theirs measures the cores. Children inherit both settings.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_ALL = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set[int]()


def hold() -> None:
    """Before any library of linear algebra is loaded, and before the other side is started."""
    os.environ.update(dict.fromkeys(VARIABLES, "1"))
    if _ALL:
        os.sched_setaffinity(0, {max(_ALL)})


@contextlib.contextmanager
def let_go() -> Iterator[None]:
    """All cores for threads that are started within."""
    held = os.sched_getaffinity(0) if _ALL else _ALL
    if _ALL:
        os.sched_setaffinity(0, _ALL)
    try:
        yield
    finally:
        if _ALL:
            os.sched_setaffinity(0, held)


@dataclass(frozen=True)
class Race:
    """`ratio` : their time over ours, None where one of the two has none. `lost` : slower, or not solved where they
    solved. `size` : unknowns or contacts. `tolerance` : 0 where there is none. `theirs`, `ours` : who."""

    race: str
    problem: str
    size: int
    tolerance: float
    ratio: float | None
    lost: bool
    theirs: str
    ours: str


def race(
    name: str,
    problem: str,
    size: int,
    ratio: float,
    theirs: str,
    ours: str,
    *,
    tolerance: float = 0.0,
    par: float = 1.0,
) -> Race:
    """One in which both are at the goal; lost below `par`."""
    known = math.isfinite(ratio)
    return Race(name, problem, size, tolerance, ratio if known else None, ratio < par, theirs, ours)


def write(path: Path | None, races: Iterable[Race]) -> None:
    """As a list in JSON; nothing where nobody asked for it."""
    if path is not None:
        path.write_text(json.dumps([asdict(one) for one in races]), "utf-8")


def read(path: Path) -> list[Race]:
    return [Race(**row) for row in json.loads(path.read_text("utf-8"))]
