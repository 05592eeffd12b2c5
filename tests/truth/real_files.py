"""The real files of the checkout's neighbour `shared/data`: which there are, smallest first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from cpbench import storage
from cpbench.errors import CpbenchError

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
UNKNOWNS = 2000
"""QPs with more unknowns are left out."""


def files(*folders: str, data: Path = DATA) -> list[Path]:
    """Return the files of some folders of the data, the smallest first."""
    return sorted(
        (f for folder in folders for f in (data / folder).iterdir()), key=lambda f: (f.stat().st_size, f.name)
    )


def problems(*folders: str, data: Path = DATA) -> Iterator[tuple[str, Any]]:
    """Yield name and problem of each file that cpbench reads."""
    for file in files(*folders, data=data):
        try:
            yield file.name, storage.load(file)
        except CpbenchError:
            continue


def convex_qps(names: Sequence[str] = (), data: Path = DATA) -> Iterator[tuple[str, Any]]:
    """Yield the convex QPs of at most UNKNOWNS unknowns, all or those of the given names."""
    for name, problem in problems("qp", "box_qp", data=data):
        wanted = not names or name in names or name.split(".")[0] in names
        if wanted and problem.node == "qp" and problem.p.size <= UNKNOWNS and problem.convex:
            yield name, problem
