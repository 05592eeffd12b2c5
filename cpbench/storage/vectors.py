"""Answers as bare vectors in files."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from cpbench.formulations.base import Point
from cpbench.foundation.matrices import Vector
from cpbench.storage.base import write_atomic


def save_vector(point: Point, path: Path, *, force: bool, own: Vector | None = None) -> bool:
    """Write the parts of `point` one after the other, or its `own` unknowns in place of them, when `path` is .npy, .csv
    or .txt; return whether it is.

    Raises FormatError when the file exists, unless `force`, or cannot be written.
    """
    if path.suffix not in (".npy", ".csv", ".txt"):
        return False
    vector = point.vector if own is None else own

    def put(file: BinaryIO) -> None:
        if path.suffix == ".npy":
            np.save(file, vector, allow_pickle=False)
        else:
            np.savetxt(file, vector, fmt="%.17g")

    write_atomic(path, put, force=force)
    return True
