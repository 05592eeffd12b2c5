"""Kept answers: the numbers of a point as a compressed .npy file, which `numpy.load` reads too; the problem knows how
they split into parts."""

from __future__ import annotations

import io
import zlib
from functools import lru_cache
from typing import Any

import numpy as np


def pack(point: Any) -> bytes:
    """Return the answer as one compressed .npy, parts one after the other (`Problem.point_from_vector` splits them)."""
    vector = point.vector
    return zlib.compress(_header(vector.size) + vector.tobytes(), 1)


def unpack(blob: bytes) -> Any:
    """Return the vector in a kept answer."""
    return np.load(io.BytesIO(zlib.decompress(blob)), allow_pickle=False)


@lru_cache(maxsize=2**10)
def _header(size: int) -> bytes:
    """Return the header of a .npy file with one vector of float64."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {"descr": np.dtype(np.float64).str, "fortran_order": False, "shape": (size,)}
    )
    return buffer.getvalue()
