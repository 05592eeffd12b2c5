"""Columns of numbers and a header as one text that may stand in HTML: base64 of gzip of

    length of the header (uint32, little endian), header (JSON, UTF-8, blanks up to a multiple of 8 bytes), columns

A column is a typed array of the browser; the header says of each its type, where it begins and how long it is. The
alphabet of base64 has no `<`, so that no text of a results file can end the element that holds it.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

Column = np.ndarray[tuple[int], np.dtype[Any]]

TYPES = {"u8": np.uint8, "u16": np.uint16, "u32": np.uint32, "f32": np.float32, "f64": np.float64}
ALIGNED = 8
LEVEL = 5
"""Of compression: 6 takes twice as long and saves one byte of thirty."""


def packed(columns: Mapping[str, Column], facts: Mapping[str, Any]) -> str:
    """Pack columns and facts into a text; integers take the smallest type that holds them.

    >>> columns, facts = unpacked(packed({"x": np.array([1.5]), "k": np.array([7, 300])}, {"title": "</script>"}))
    >>> columns["x"].tolist(), columns["k"].tolist(), columns["k"].dtype.name, facts["title"]
    ([1.5], [7, 300], 'uint16', '</script>')
    """
    parts: dict[str, tuple[str, Column]] = {name: _typed(values) for name, values in columns.items()}
    head = _header(parts, facts, 0)
    while len(longer := _header(parts, facts, len(head))) != len(head):  # places have digits, digits take place
        head = longer
    body = b"".join(values.tobytes().ljust(_round(values.nbytes), b"\0") for _, values in parts.values())
    return base64.b64encode(gzip.compress(longer + body, compresslevel=LEVEL, mtime=0)).decode("ascii")


def unpacked(text: str) -> tuple[dict[str, Column], Any]:
    """Unpack columns and facts from a text, as the page reads them."""
    data = gzip.decompress(base64.b64decode(text))
    head = json.loads(data[4 : 4 + int.from_bytes(data[:4], "little")])
    columns = {
        name: np.frombuffer(data, TYPES[of["type"]], of["count"], of["at"]) for name, of in head["columns"].items()
    }
    return columns, head["facts"]


def _typed(values: Column) -> tuple[str, Column]:
    if values.dtype.kind == "f":
        name = "f32" if values.dtype == np.float32 else "f64"
    else:
        most = int(values.max(initial=0))
        name = "u8" if most < 2**8 else "u16" if most < 2**16 else "u32"
    return name, np.ascontiguousarray(values, dtype=np.dtype(TYPES[name]).newbyteorder("<"))


def _header(parts: Mapping[str, tuple[str, Column]], facts: Mapping[str, Any], begin: int) -> bytes:
    """Return the length and header, for columns that begin at `begin`."""
    places: dict[str, dict[str, Any]] = {}
    for name, (kind, values) in parts.items():
        places[name] = {"type": kind, "at": begin, "count": len(values)}
        begin += _round(values.nbytes)
    header = json.dumps({"columns": places, "facts": facts}, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    text = header.encode("utf-8", errors="replace")
    text = text.ljust(_round(len(text) + 4) - 4, b" ")
    return len(text).to_bytes(4, "little") + text


def _round(size: int) -> int:
    return -(-size // ALIGNED) * ALIGNED
