"""Columns of numbers and facts as one text that may stand in HTML: base64 of gzip of a frame (`frames`).

A column is a typed array of the browser. The alphabet of base64 has no `<`, so that no text of a results file can end
the element that holds it.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping
from typing import Any

import numpy as np

from cpbench.foundation import frames

Column = np.ndarray[tuple[int], np.dtype[Any]]

ALIGNED = 8
LEVEL = 5
"""Of compression: 6 takes twice as long and saves one byte of thirty."""


def packed(columns: Mapping[str, Column], facts: Mapping[str, Any]) -> str:
    """Pack columns and facts into a text; integers take the smallest type that holds them.

    >>> columns, facts = unpacked(packed({"x": np.array([1.5]), "k": np.array([7, 300])}, {"title": "</script>"}))
    >>> columns["x"].tolist(), columns["k"].tolist(), columns["k"].dtype.name, facts["title"]
    ([1.5], [7, 300], 'uint16', '</script>')
    """
    typed = {name: values.astype(_smallest_type(values)) for name, values in columns.items()}
    frame = b"".join(frames.parts({"facts": facts}, typed, ALIGNED, finite=True))
    return base64.b64encode(gzip.compress(frame, compresslevel=LEVEL, mtime=0)).decode("ascii")


def unpacked(text: str) -> tuple[dict[str, Column], Any]:
    """Unpack columns and facts from a text, as the page reads them."""
    data = gzip.decompress(base64.b64decode(text))
    header, columns = frames.unpack(data, types=frames.NUMBERS, aligned=ALIGNED)
    return columns, header["facts"]


def _smallest_type(values: Column) -> type[np.number[Any]]:
    if values.dtype.kind == "f":
        return np.float32 if values.dtype == np.float32 else np.float64
    most = int(values.max(initial=0))
    return np.uint8 if most < 2**8 else np.uint16 if most < 2**16 else np.uint32
