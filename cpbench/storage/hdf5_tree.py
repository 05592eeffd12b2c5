"""HDF5 groups read with suspicion: hard links only, nothing outside the file, no size believed unless it is stored.

Reading goes through h5py's low-level interface, which reads a small file in half the time of the
high-level one.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Collection, Generator
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
from h5py import h5a, h5d, h5f, h5g, h5l, h5o, h5p, h5s, h5z  # pyright: ignore[reportAttributeAccessIssue]
from numpy.typing import NDArray

from cpbench.errors import FormatError

P = ParamSpec("P")
R = TypeVar("R")

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_EXPANSION = 1100
"""Deflate cannot expand by more than 1032; a data set that claims more than this is not believed."""
_LARGEST_UNWRITTEN = 1 << 24
"""Data sets that were created and never written hold HDF5's fill value, 0: FCLIB files have such solutions."""
_LARGEST_ATTRIBUTE = 1 << 20
_DAMAGE = (OSError, RuntimeError, LookupError, TypeError, ValueError, ArithmeticError, MemoryError)
"""Exceptions of h5py on damaged files (found by overwriting bytes at random)."""


def _guarded(method: Callable[Concatenate[Tree, P], R]) -> Callable[Concatenate[Tree, P], R]:
    """Turn errors of HDF5 in a damaged file into a FormatError that names the place."""

    @functools.wraps(method)
    def guarded(self: Tree, *args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return method(self, *args, **kwargs)
        except _DAMAGE as cause:
            name = str(args[0]) if args else ""
            raise self.error(name, f"is damaged: HDF5 cannot read it ({_first_line(cause)})") from None

    return guarded


class Tree:
    """One group of an open file, and where it stands in it."""

    __slots__ = ("gid", "path", "where")

    def __init__(self, path: Path, gid: Any, where: str = "") -> None:
        self.path, self.gid, self.where = path, gid, where

    def error(self, name: str, cause: str) -> FormatError:
        place = "/".join(part for part in (self.where, name) if part)
        return FormatError(self.path, place, cause)

    @_guarded
    def names(self) -> list[str]:
        return sorted(name.decode("utf-8", "replace") for name in self.gid)

    def require_known(self, known: Collection[str]) -> None:
        """Raise FormatError where the group holds more than is read from it: the problem could be another one."""
        for name in self.names():
            if name not in known:
                raise self.error(name, f"is none of {', '.join(sorted(known))}, which are read: rename or remove it")

    @_guarded
    def __contains__(self, name: str) -> bool:
        return bool(self.gid.links.exists(name.encode()))

    @_guarded
    def _open(self, name: str, kind: type, expected: str) -> Any:
        raw = name.encode()
        if not self.gid.links.exists(raw):
            raise self.error(name, f"is missing, expected {expected}")
        # an external link could name any file of this one's reader
        if self.gid.links.get_info(raw).type != h5l.TYPE_HARD:
            raise self.error(name, "is a soft or external link: links are not followed, expected the data itself")
        result = h5o.open(self.gid, raw)
        if not isinstance(result, kind):
            what = "group" if isinstance(result, h5g.GroupID) else "data set"
            raise self.error(name, f"is a {what}, expected {expected}")
        return result

    def child(self, name: str) -> Tree:
        """Return the group `name`; raises FormatError when it is missing, a data set or a link."""
        return Tree(self.path, self._open(name, h5g.GroupID, "a group"), f"{self.where}/{name}" if self.where else name)

    @_guarded
    def is_group(self, name: str) -> bool:
        """Return whether `name` is a group; a link is not one."""
        raw = name.encode()
        return (
            self.gid.links.exists(raw)
            and self.gid.links.get_info(raw).type == h5l.TYPE_HARD
            and isinstance(h5o.open(self.gid, raw), h5g.GroupID)
        )

    @_guarded
    def array(self, name: str, dtype: Any = np.float64, ndim: int | None = 1) -> NDArray[Any]:
        """Read a numeric data set as `dtype`; raises FormatError before allocating what is not there.

        `dtype` None: as stored; np.integer: whole numbers, int32 where that is stored, else int64.
        """
        data = self._open(name, h5d.DatasetID, "a data set")
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
            self._fill(name, data, out)
        return out

    def _require_stored(self, name: str, data: Any) -> None:
        """Refuse data that are elsewhere, packed by an unknown filter, or fewer than declared."""
        plist = data.get_create_plist()
        # so could data in external files, and virtual data sets
        if plist.get_external_count() or plist.get_layout() not in (h5d.COMPACT, h5d.CONTIGUOUS, h5d.CHUNKED):
            raise self.error(name, "keeps its numbers in another file, expected them in this one")
        filters = plist.get_nfilters()
        for i in range(filters):
            code, _, _, label = plist.get_filter(i)
            if not h5z.filter_avail(code):
                known = label.decode("ascii", "replace") or f"number {code}"
                raise self.error(name, f"is packed with the HDF5 filter {known}, which is not built in: use gzip")
        # before memory is asked for: a few bytes can declare terabytes
        declared = int(np.prod(data.shape, dtype=object)) * data.dtype.itemsize
        stored = data.get_storage_size()
        unwritten = stored == 0 and declared <= _LARGEST_UNWRITTEN
        if declared > stored * (_EXPANSION if filters else 1) and not unwritten:
            raise self.error(name, f"declares {declared} bytes, the file holds {stored} of them")

    def _fill(self, name: str, data: Any, out: NDArray[Any]) -> None:
        try:
            data.read(h5s.ALL, h5s.ALL, out)
        except (OSError, TypeError, ValueError) as cause:
            raise self.error(name, f"cannot be read ({_first_line(cause)})") from None

    def integer(self, name: str) -> int:
        """Read a whole number: a data set of shape (1,), or a scalar one."""
        value = self.array(name, np.int64, None)
        if value.size != 1:
            raise self.error(name, f"has shape {value.shape}, expected one whole number")
        return int(value.reshape(-1)[0])

    @_guarded
    def text(self, name: str) -> str:
        """Read a string data set, "" when there is none; bytes that are not UTF-8 come back as U+FFFD."""
        if name not in self:
            return ""
        data = self._open(name, h5d.DatasetID, "a string")
        if data.dtype.kind not in "SO" or data.shape not in ((), (1,)):
            raise self.error(name, f"holds {_type_name(data.dtype)} of shape {data.shape}, expected one string")
        self._require_stored(name, data)
        out = np.empty(data.shape, data.dtype)
        self._fill(name, data, out)
        return _string(out.reshape(-1)[0])

    @_guarded
    def attributes(self) -> dict[str, Any]:
        """Return attributes by name: strings as str, numbers as NumPy scalars or arrays."""
        return _attributes(self.gid)

    @_guarded
    def flagged(self, name: str) -> bool:
        """Return whether the attribute `name` is there and 1 (a tenth of the time of `attributes`)."""
        return bool(h5a.exists(self.gid, name.encode())) and self.attributes().get(name, 0) == 1

    @_guarded
    def marks(self, name: str) -> dict[str, Any]:
        """Return the attributes of the data set `name`."""
        return _attributes(self._open(name, h5d.DatasetID, "a data set"))


@contextlib.contextmanager
def open_tree(path: Path) -> Generator[Tree]:
    """Yield the root group of a file, open for reading; raises FormatError when there is none."""
    access = h5p.create(h5p.FILE_ACCESS)
    # else the file stays open as long as any group or data set of it is referred to
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    try:
        file = h5f.open(str(path).encode(), h5f.ACC_RDONLY, access)
    except _DAMAGE as cause:
        raise FormatError(path, "", _unopened(path, cause)) from None
    try:
        try:
            root = h5g.open(file, b"/")
        except _DAMAGE as cause:
            raise FormatError(path, "", _unopened(path, cause)) from None
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
    return f"is a truncated HDF5 file ({text})" if "truncated" in text else f"is a damaged HDF5 file ({text})"
