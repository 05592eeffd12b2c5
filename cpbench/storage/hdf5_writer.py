"""Writing HDF5 the way FCLIB's C reader takes it: packs and answers in memory (HDF5's core driver), put down at once.

`base.write_atomic` gives the finished bytes their name.
"""

from __future__ import annotations

import contextlib
from collections.abc import Generator
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

COMPRESS_ABOVE = 64 * 1024
"""Arrays above this many bytes are compressed (gzip and shuffle) where compression is asked for."""


@contextlib.contextmanager
def new_file() -> Generator[tuple[h5py.Group, list[bytes]]]:
    """Create a file in memory: yield its root group and a list that holds the finished bytes after the block."""
    image: list[bytes] = []
    with h5py.File(f"memory-{id(image)}", "w", driver="core", backing_store=False, track_order=False) as file:
        yield file, image
        file.flush()
        image.append(file.id.get_file_image())


def put_array(group: h5py.Group, name: str, value: NDArray[Any], *, compress: bool) -> None:
    """Write an array, compressed when it is large, with a checksum (Fletcher-32) for each of its blocks."""
    packed = compress and value.nbytes > COMPRESS_ABOVE
    how = {"compression": "gzip", "shuffle": True, "fletcher32": True} if packed else {}
    group.create_dataset(name, data=value, **how)


def put_integer(group: h5py.Group, name: str, value: int) -> None:
    """Write a whole number the way FCLIB does: an int32 data set of shape (1,), int64 when it must be."""
    group.create_dataset(name, data=np.array([value], np.int32 if abs(value) < 2**31 else np.int64))


def fixed_string(text: str) -> NDArray[Any]:
    """Return a UTF-8 string of fixed length, NUL terminated: what a C reader can take."""
    raw = text.encode("utf-8", "surrogateescape")
    return np.array(raw, dtype=h5py.string_dtype("utf-8", len(raw) + 1))


def put_text(group: h5py.Group, name: str, text: str) -> None:
    group.create_dataset(name, data=fixed_string(text), dtype=fixed_string(text).dtype)


def put_attribute(group: h5py.Group, name: str, value: Any) -> None:
    """Write an attribute: strings as fixed UTF-8, numbers as they are."""
    if isinstance(value, str):
        raw = fixed_string(value)
        group.attrs.create(name, raw, dtype=raw.dtype)
    else:
        group.attrs[name] = value
