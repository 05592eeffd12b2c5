"""Kept answers are .npy files, compressed: what NumPy would have written, byte for byte."""

from __future__ import annotations

import io
import zlib

import numpy as np

from cpbench.bench.results import answers
from cpbench.formulations import MLCPPoint


def test_an_answer_is_a_npy_file() -> None:
    point = MLCPPoint(u=np.array([1.5, -0.0]), v=np.array([np.nan, np.inf, 3.0]))
    blob = answers.pack(point)
    expected = io.BytesIO()
    np.save(expected, np.concatenate([point.u, point.v]), allow_pickle=False)
    assert zlib.decompress(blob) == expected.getvalue()
    assert answers.unpack(blob).tobytes() == np.concatenate([point.u, point.v]).tobytes()
