"""Contract of the file formats, and what all of them share: addresses, first look at a file, atomic writing.

A file is data: a format reads it without running anything in it, checks every declared size against what the
file holds before it allocates, and answers bad input with one :class:`~cpbench.errors.FormatError`.
"""

from __future__ import annotations

import contextlib
import math
import os
import secrets
import stat
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, BinaryIO, ClassVar

from cpbench.errors import FormatError, ProblemError
from cpbench.formulations.base import Info, Point, Problem
from cpbench.registry import Registry

SEPARATOR = "::"
"""Between a file and the name of a problem in it: ``pack.h5::murty-8``."""
OFFSET, SENSE, UNKNOWNS, NOTE = "objective_offset", "objective_sense", "unknowns", "note"
"""Names of the properties: the constant of ½zᵀQz + pᵀz, `max` where that with its constant is the opposite of the
objective of the file, and the names of the unknowns in the order of the parts of a point, first parts alone where the
others are multipliers."""
_HEAD_BYTES = 512


class Format(ABC):
    """One way to write problems to a file.

    Attributes
    ----------
    name : what ``--format`` takes. summary : one line for tables.
    suffixes : of files that may be in this format, lower case. writes : nodes it can write.
    by_suffix : whether a file is written in this format because its name ends in one of `suffixes`.
    keeps_provenance : whether an answer to a written file can be lifted. keeps_guesses : whether it has
    starting points.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]
    writes: ClassVar[frozenset[str]] = frozenset()
    by_suffix: ClassVar[bool] = True
    keeps_provenance: ClassVar[bool] = False
    keeps_guesses: ClassVar[bool] = False

    @abstractmethod
    def recognises(self, path: Path, head: bytes) -> bool:
        """Return whether a file with these first bytes may be in this format (cheap, may be wrong)."""

    def why_not(self, node: str) -> str:
        """Return why the format cannot hold problems of a formulation, "" where there is no more to say."""
        return ""

    def holds(self, problem: Problem) -> bool:
        """Return whether a file of this format may hold the problem, as far as formulation and dimension say."""
        return problem.node in self.writes

    def in_folder(self, path: Path, head: bytes) -> bool:
        """Return whether a file met while a folder is searched should be listed."""
        return self.recognises(path, head)

    @abstractmethod
    def load(self, path: Path, member: str) -> Problem:
        """Load the problem `member` of the file ("" where the file is one problem); raises FormatError."""

    def members(self, path: Path) -> list[str]:
        """Return the names of the problems in the file; [""] when the file is one problem."""
        return [""]

    def encode(self, problem: Problem, *, compress: bool) -> bytes:
        """Return the bytes of a file that holds `problem`; raises FormatError where the format cannot hold it."""
        raise FormatError(
            problem.name or problem.node, "", f"cannot be written as {self.name}: that format is read only"
        )

    def write(self, problem: Problem, file: BinaryIO, *, compress: bool, guesses: Sequence[Point] = ()) -> None:
        """Put `problem` into an empty file, open for reading too; a format of large files need not build it first.

        A format that `keeps_guesses` writes these starting points too. Raises FormatError, as `encode`.
        """
        file.write(self.encode(problem, compress=compress))

    def load_any(self, others: Sequence[Format], path: Path, member: str) -> Problem:
        """Load the problem of a file that `self` and `others` recognise; a family of formats decides by content.

        Raises FormatError where there are others: the reader has to name the format.
        """
        if others:
            names = ", ".join(sorted(f.name for f in (self, *others)))
            raise FormatError(path, "", f"may be any of {names}: say which with --format")
        return self.load(path, member)


formats: Registry[Format] = Registry("format", "cpbench.storage")


def no_member(path: Path, member: str) -> None:
    """Raise FormatError when a member of a file without members is asked for."""
    if member:
        raise FormatError(path, "", f"is one problem, it has no member '{member}'")


def split_address(address: str | Path) -> tuple[Path, str]:
    """Return file and member of ``file::member``; the member is "" where none is named, or a file has that whole name.

    >>> split_address("pack.h5::murty-8")[1]
    'murty-8'
    """
    text = str(address)
    if SEPARATOR in text and not os.path.exists(text):
        file, _, member = text.rpartition(SEPARATOR)
        return Path(file), member
    return Path(text), ""


def stem(path: Path) -> str:
    """Return the name of a problem whose file gives none: the file's without suffixes (Siconos has ``x.hdf5.dat``)."""
    return path.stem.removesuffix(".hdf5")


def read_head(path: Path) -> bytes:
    """Read the first bytes of a file; raises FormatError when it is missing, a folder, empty or a Git-LFS pointer."""
    try:
        mode = os.stat(path).st_mode
        if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):  # a pipe may never end, a device neither
            raise FormatError(path, "", "is not a regular file (a pipe or a device), expected a file")
        with open(path, "rb", buffering=0) as file:
            head = file.read(_HEAD_BYTES) or b""
    except FileNotFoundError:
        raise FormatError(path, "", "no such file") from None
    except IsADirectoryError:
        raise FormatError(path, "", "is a folder, expected a file") from None
    except OSError as cause:
        raise FormatError(path, "", f"cannot be opened ({cause.strerror or cause})") from None
    if not head:
        raise FormatError(path, "", "is empty (0 bytes)")
    if head.startswith(b"version https://git-lfs"):
        raise FormatError(path, "", "is a Git-LFS pointer, not the data: run 'git lfs pull' where it came from")
    return head


def read_bytes(path: Path) -> bytes:
    """Read a file; raises FormatError where there is none."""
    read_head(path)
    return path.read_bytes()


def read_text(path: Path) -> str:
    """Read the file as text, UTF-8 or else Latin-1, so that any comment is readable; raises FormatError when it is
    binary."""
    data = read_bytes(path)
    if b"\0" in data:
        raise FormatError(path, "", f"is not a text file (byte 0 at {data.index(0)})")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def build(path: Path, cls: type[Problem], where: str, **parts: Any) -> Problem:
    """Return `cls(**parts)`; raises FormatError, which names the file and where in it, if that is not a problem."""
    try:
        return cls(**parts)
    except ProblemError as cause:
        field = cause.field.rpartition(".")[2]
        shapes = {f.name: f.metadata["shape"] for f in cls._data_fields()}
        inside = "vectors/" if where and len(shapes.get(field, ())) == 1 else ""
        raise FormatError(path, f"{where}/{inside}{field}" if where else field, cause.cause) from None


def require_new(path: Path, force: bool) -> None:
    """Raise FormatError when nothing can be written at `path`: commands ask before they begin to work."""
    if path.is_dir():
        raise FormatError(path, "", "is a folder, cannot be written as a file")
    if not force and path.exists():
        raise FormatError(path, "", "exists already: --force replaces it")
    if not path.parent.is_dir():
        raise FormatError(path, "", f"cannot be written: there is no folder {path.parent}")


def require_folder(path: Path) -> None:
    """Make a folder; raises FormatError where it cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise FormatError(path, "", f"cannot be made a folder ({cause.strerror or cause})") from None


def write_atomic(path: Path, data: bytes | Callable[[BinaryIO], object], *, force: bool) -> None:
    """Put `data`, or what it writes, at `path` in one step: complete or not at all, even if the process is killed.

    The bytes go to a hidden file beside the target, which then gets the target's name. Raises FormatError when the
    target exists (unless `force`) or cannot be written.
    """
    require_new(path, force)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")
    try:
        with open(temporary, "x+b") as file:
            if callable(data):
                data(file)
            else:
                file.write(data)
        os.replace(temporary, path)
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None
    finally:
        with contextlib.suppress(OSError):
            os.unlink(temporary)


def offset(info: Info) -> float:
    """Return the constant of the objective; 0 where there is none, or no finite number."""
    value = info.properties.get(OFFSET, 0.0)
    try:
        constant = float(value) if isinstance(value, int | float) else 0.0
    except OverflowError:  # whole numbers of a JSON file have no end
        return 0.0
    return constant if math.isfinite(constant) else 0.0


def unknowns(info: Info) -> list[str]:
    """Return the names of the unknowns; empty where the file has none."""
    names = info.properties.get(UNKNOWNS)
    return [str(name) for name in names] if isinstance(names, list | tuple) else []
