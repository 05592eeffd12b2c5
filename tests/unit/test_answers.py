"""Kept answers are .npy files, compressed: what NumPy would have written, byte for byte."""

from __future__ import annotations

import io
import zlib

import numpy as np

from cpbench.bench.results.rows import pack_answer, unpack_answer
from cpbench.formulations import MLCPPoint


def test_an_answer_is_a_npy_file() -> None:
    point = MLCPPoint(u=np.array([1.5, -0.0]), v=np.array([np.nan, np.inf, 3.0]))
    blob = pack_answer(point)
    expected = io.BytesIO()
    np.save(expected, np.concatenate([point.u, point.v]), allow_pickle=False)
    assert zlib.decompress(blob) == expected.getvalue()
    assert unpack_answer(blob).tobytes() == np.concatenate([point.u, point.v]).tobytes()
