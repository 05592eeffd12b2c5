"""Kept answers: the numbers of a point, compressed; the problem knows its parts."""

from __future__ import annotations

import io
import zlib
from typing import Any

import numpy as np


def pack(point: Any) -> bytes:
    """The answer as one compressed .npy, parts one after the other (`Problem.point_from_vector` splits them)."""
    buffer = io.BytesIO()
    np.save(buffer, np.concatenate(list(point.arrays().values())), allow_pickle=False)
    return zlib.compress(buffer.getvalue(), 1)


def unpack(blob: bytes) -> Any:
    """The vector in a kept answer."""
    return np.load(io.BytesIO(zlib.decompress(blob)), allow_pickle=False)
