"""Answers as plain vectors, for the commands that write them."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from cpbench.formulations import Point
from cpbench.storage.base import write_atomic


def write_plain(point: Point, output: Path, *, force: bool) -> bool:
    """Write the parts of `point` one after the other when `output` is .npy, .csv or .txt; False otherwise.

    Raises FormatError when the file exists, unless `force`, or cannot be written.
    """
    if output.suffix not in (".npy", ".csv", ".txt"):
        return False
    vector = np.concatenate(list(point.arrays().values()))

    def put(file: BinaryIO) -> None:
        if output.suffix == ".npy":
            np.save(file, vector, allow_pickle=False)
        else:
            np.savetxt(file, vector, fmt="%.17g")

    write_atomic(output, put, force=force)
    return True
