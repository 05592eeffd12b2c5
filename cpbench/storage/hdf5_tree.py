"""HDF5 groups: read so that each error names the file and the field and no size is believed unless it is stored, and
written the way FCLIB's C reader takes them: packs and answers in memory (HDF5's core driver), put down at once.

Reading goes through h5py's low-level interface, which reads a small file in half the time of the high-level one.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Generator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5f, h5g, h5o, h5p, h5s  # pyright: ignore[reportAttributeAccessIssue]
from numpy.typing import NDArray

from cpbench.errors import FormatError

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_EXPANSION = 1100
"""Deflate cannot expand by more than 1032; a data set that claims more than this is not believed."""
_LARGEST_UNWRITTEN = 1 << 24
"""Data sets that were created and never written hold HDF5's fill value, 0: FCLIB files have such solutions."""
_LARGEST_ATTRIBUTE = 1 << 20
COMPRESS_ABOVE = 64 * 1024
"""Arrays above this many bytes are compressed (gzip and shuffle) where compression is asked for."""


class Tree:
    """One group of an open file, and where it stands in it."""

    __slots__ = ("gid", "path", "where")

    def __init__(self, path: Path, gid: Any, where: str = "") -> None:
        self.path, self.gid, self.where = path, gid, where

    def error(self, name: str, cause: str) -> FormatError:
        location = "/".join(part for part in (self.where, name) if part)
        return FormatError(self.path, location, cause)

    @contextlib.contextmanager
    def _reading(self, name: str = "") -> Generator[None]:
        """Turn what h5py raises on a damaged file, which may be anything, into a FormatError that names the place."""
        try:
            yield
        except FormatError:
            raise
        except Exception as cause:
            raise self.error(name, f"is damaged: HDF5 cannot read it ({_first_line(cause)})") from cause

    def names(self) -> list[str]:
        with self._reading():
            return sorted(name.decode("utf-8", "replace") for name in self.gid)

    def require_known(self, known: Collection[str]) -> None:
        """Raise FormatError where the group holds more than is read from it: the problem could be another one."""
        for name in self.names():
            if name not in known:
                raise self.error(name, f"is none of {', '.join(sorted(known))}, which are read: rename or remove it")

    def __contains__(self, name: str) -> bool:
        with self._reading(name):
            return bool(self.gid.links.exists(name.encode()))

    def _open(self, name: str, kind: type, expected: str) -> Any:
        if name not in self:
            raise self.error(name, f"is missing, expected {expected}")
        with self._reading(name):
            result = h5o.open(self.gid, name.encode())
        if not isinstance(result, kind):
            what = "group" if isinstance(result, h5g.GroupID) else "data set"
            raise self.error(name, f"is a {what}, expected {expected}")
        return result

    def child(self, name: str) -> Tree:
        """Return the group `name`; raises FormatError when it is missing or a data set."""
        return Tree(self.path, self._open(name, h5g.GroupID, "a group"), f"{self.where}/{name}" if self.where else name)

    def is_group(self, name: str) -> bool:
        """Return whether `name` is a group."""
        with self._reading(name):
            return self.gid.links.exists(name.encode()) and isinstance(h5o.open(self.gid, name.encode()), h5g.GroupID)

    def array(self, name: str, dtype: Any = np.float64, ndim: int | None = 1) -> NDArray[Any]:
        """Read a numeric data set as `dtype`; raises FormatError before allocating what is not there.

        `dtype` None: as stored; np.integer: whole numbers, int32 where that is stored, else int64.
        """
        data = self._open(name, h5d.DatasetID, "a data set")
        with self._reading(name):
            shape, stored = data.shape, data.dtype
            whole = dtype in (np.int64, np.integer)
            if stored.kind not in ("biu" if whole else "biuf"):
                wanted = "whole numbers" if whole else "numbers"
                raise self.error(name, f"holds {_type_name(stored)}, expected {wanted}")
            if ndim is not None and len(shape) != ndim:
                raise self.error(name, f"has shape {shape}, expected {ndim} dimension{'s' * (ndim != 1)}")
            self._require_stored(name, data)
            if dtype == np.integer:
                dtype = np.int32 if stored.kind == "i" and stored.itemsize == 4 else np.int64
            out = np.empty(shape, stored.newbyteorder("=") if dtype is None else dtype)
            if out.size:
                data.read(h5s.ALL, h5s.ALL, out)
            return out

    def _require_stored(self, name: str, data: Any) -> None:
        """Refuse data that are fewer than declared before memory is asked for: a few bytes can declare terabytes."""
        declared = int(np.prod(data.shape, dtype=object)) * data.dtype.itemsize
        stored = data.get_storage_size()
        expansion = _EXPANSION if data.get_create_plist().get_nfilters() else 1
        unwritten = stored == 0 and declared <= _LARGEST_UNWRITTEN
        if declared > stored * expansion and not unwritten:
            raise self.error(name, f"declares {declared} bytes, the file holds {stored} of them")

    def integer(self, name: str) -> int:
        """Read a whole number: a data set of shape (1,), or a scalar one."""
        value = self.array(name, np.int64, None)
        if value.size != 1:
            raise self.error(name, f"has shape {value.shape}, expected one whole number")
        return int(value.reshape(-1)[0])

    def text(self, name: str) -> str:
        """Read a string data set, "" when there is none; bytes that are not UTF-8 come back as U+FFFD."""
        if name not in self:
            return ""
        data = self._open(name, h5d.DatasetID, "a string")
        with self._reading(name):
            if data.dtype.kind not in "SO" or data.shape not in ((), (1,)):
                raise self.error(name, f"holds {_type_name(data.dtype)} of shape {data.shape}, expected one string")
            self._require_stored(name, data)
            out = np.empty(data.shape, data.dtype)
            data.read(h5s.ALL, h5s.ALL, out)
            return _string(out.reshape(-1)[0])

    def attributes(self, name: str = "") -> dict[str, Any]:
        """Return attributes of the group, or of the data set `name` in it: strings as str, numbers as NumPy scalars or
        arrays."""
        owner = self._open(name, h5d.DatasetID, "a data set") if name else self.gid
        with self._reading(name):
            return _attributes(owner)

    def flagged(self, name: str) -> bool:
        """Return whether the attribute `name` is there and 1 (a tenth of the time of `attributes`)."""
        with self._reading():
            return bool(h5a.exists(self.gid, name.encode())) and self.attributes().get(name, 0) == 1


@contextlib.contextmanager
def open_tree(path: Path) -> Generator[Tree]:
    """Yield the root group of a file, open for reading; raises FormatError when there is none."""
    access = h5p.create(h5p.FILE_ACCESS)
    # else the file stays open as long as any group or data set of it is referred to
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    try:
        file = h5f.open(str(path).encode(), h5f.ACC_RDONLY, access)
    except Exception as cause:
        raise FormatError(path, "", _unopened(path, cause)) from cause
    try:
        try:
            root = h5g.open(file, b"/")
        except Exception as cause:
            raise FormatError(path, "", _unopened(path, cause)) from cause
        yield Tree(path, root)
    finally:
        file.close()


def _attributes(owner: Any) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for i in range(h5a.get_num_attrs(owner)):
        attribute = h5a.open(owner, index=i)
        name = attribute.name.decode("utf-8", "replace")
        count = int(np.prod(attribute.shape, dtype=object)) if attribute.shape else 1
        if attribute.dtype.kind not in "biufSO" or count * attribute.dtype.itemsize > _LARGEST_ATTRIBUTE:
            continue  # nothing of ours
        value = np.empty(attribute.shape or (), attribute.dtype)
        if count:
            attribute.read(value)
        result[name] = _string(value[()]) if value.dtype.kind in "SO" and not value.shape else value[()]
    return result


def _string(value: Any) -> str:
    if isinstance(value, bytes):
        return value.split(b"\0")[0].decode("utf-8", "replace")
    return str(value).split("\0")[0]


def _type_name(dtype: np.dtype[Any]) -> str:
    return {"S": "strings", "O": "strings or references", "V": "compound data"}.get(dtype.kind, str(dtype))


def _first_line(cause: BaseException) -> str:
    return str(cause.args[0] if cause.args else cause).split("\n")[0].strip("'\" ")


def _unopened(path: Path, cause: BaseException) -> str:
    with open(path, "rb") as file:
        # HDF5 says the same of a text file and of a damaged one
        signed = file.read(8) == SIGNATURE
    if not signed:
        return "is not an HDF5 file (its first bytes are not the HDF5 signature)"
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        return "has a name that is not UTF-8, which h5py cannot open; rename the file"
    text = _first_line(cause)
    if "close degree" in text:
        return "is open in this process already, by h5py; close that file first"
    return f"is a truncated HDF5 file ({text})" if "truncated" in text else f"is a damaged HDF5 file ({text})"


# ----------------------------------------------------------------------------------------------- writing


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
