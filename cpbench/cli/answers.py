"""Answers as plain vectors, for the commands that write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations import Point


def write_plain(point: Point, output: Path, *, force: bool) -> bool:
    """Write the parts of `point` one after the other when `output` is .npy, .csv or .txt; False otherwise.

    Raises FormatError when the file exists, unless `force`.
    """
    if output.suffix not in (".npy", ".csv", ".txt"):
        return False
    if output.exists() and not force:
        raise FormatError(output, "", "exists already; use --force to replace it")
    vector = np.concatenate(list(point.arrays().values()))
    if output.suffix == ".npy":
        with output.open("wb") as file:
            np.save(file, vector, allow_pickle=False)
    else:
        np.savetxt(output, vector, fmt="%.17g")
    return True
