"""Frames: arrays of all types, and types that a reader does not allow."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from cpbench.bench.results.rows import Outcome
from cpbench.foundation import frames
from cpbench.foundation.frames import FrameError


@pytest.mark.parametrize("aligned", [1, 8, 64])
def test_arrays_of_all_types_begin_where_they_should(aligned: int) -> None:
    arrays = {kind: np.arange(n, n + 3).astype(kind) for n, kind in enumerate(sorted(frames.NUMBERS))}
    data = b"".join(frames.parts({"k": 1}, {**arrays, "bytes": b"abc", "none": np.zeros(0)}, aligned))
    header, read = frames.unpack(data, types=frames.NUMBERS, aligned=aligned)
    assert header == {"k": 1}
    for kind, array in arrays.items():
        assert read[kind].dtype == array.dtype
        assert read[kind].tolist() == array.tolist()
        begin = read[kind].__array_interface__["data"][0] - np.frombuffer(data, np.uint8).__array_interface__["data"][0]
        assert begin % aligned == 0
    assert read["bytes"] == b"abc"
    assert read["none"].size == 0


@pytest.mark.parametrize("kind", ["<i8", "|O", "<U4", "nonsense", 7, ["<f8"]])
def test_types_that_are_not_allowed_are_refused(kind: object) -> None:
    head = json.dumps({"vectors": [["x", 8, kind]]}).encode()
    with pytest.raises(FrameError):
        frames.unpack(struct.pack("<I", len(head)) + head + bytes(8))


def test_a_reader_without_nan_gets_none() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        frames.parts({"x": float("nan")}, {}, finite=True)
    assert np.isnan(frames.unpack(frames.pack({"x": float("nan")}))[0]["x"])
    assert frames.unpack(frames.pack({"row": Outcome(status="\udcff")}))[0]["row"]["status"] == "\udcff"
