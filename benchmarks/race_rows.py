"""One race as data: what the scripts of races write, and the table of all of them reads."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path


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
