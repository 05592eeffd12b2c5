"""Answers to one problem with its reference, in a file that `collect.py` writes and the measurements read.

A problem has one file `NAME.npz`: the labels, the answers as rows of a matrix (z, λ, μ, ν one after the other) and the
reference (z, objective, terms, source), which is empty where no two methods agree.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import real_files
from qp_literature import Reference

Answers = list[tuple[str, Any]]


def packed(point: Any) -> np.ndarray:
    """Return the parts of a point one after the other."""
    return np.concatenate(list(point.arrays().values()))


def write(file: Path, answers: Answers, reference: Reference | None) -> None:
    ref = reference or Reference(np.zeros(0), np.nan, np.nan, "")
    part = file.with_suffix(".part")
    with part.open("wb") as out:
        np.savez(
            out,
            labels=np.array([label for label, _ in answers]),
            answers=np.array([packed(point) for _, point in answers]),
            z=ref.z,
            objective=ref.objective,
            terms=ref.terms,
            source=ref.source,
        )
    part.replace(file)


def read(file: Path, problem: Any) -> tuple[Answers, Reference | None]:
    """Return the answers and the reference that `write` has kept."""
    with np.load(file) as kept:
        points = [problem.point_from_vector(x) for x in kept["answers"]]
        answers = list(zip((str(label) for label in kept["labels"]), points, strict=True))
        source = str(kept["source"])
        if not source:
            return answers, None
        return answers, Reference(kept["z"], float(kept["objective"]), float(kept["terms"]), source)


def kept(folder: Path, names: Sequence[str] = ()) -> Iterator[tuple[str, Any, Answers, Reference | None]]:
    """Yield name, problem, answers and reference of every convex QP that has a file in the folder."""
    for name, problem in real_files.convex_qps(names):
        file = folder / f"{name}.npz"
        if file.exists():
            yield name, problem, *read(file, problem)
