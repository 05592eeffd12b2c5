"""Files packed by gzip, unpacked piece by piece up to a size."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path

from cpbench.errors import FormatError

_TEXT_EXPANSION = 300
"""Text of numbers is packed to a tenth; a file that grows more is a bomb, or hardly a problem."""
_SMALL = 1 << 25
"""Bytes that any file may unpack to."""


def is_compressed(path: Path) -> bool:
    """Return whether the name says that the file is compressed by gzip."""
    return path.suffix.lower() == ".gz"


def plain(path: Path) -> Path:
    """Return the path without .gz."""
    return path.with_suffix("") if is_compressed(path) else path


def unpacked(path: Path, first: int | None) -> Iterator[bytes]:
    """Yield a compressed file piece by piece, or its `first` bytes; raises FormatError."""
    largest = max(_SMALL, _TEXT_EXPANSION * path.stat().st_size)
    done = 0
    try:
        with gzip.open(path) as file:
            while piece := file.read(1 << 20 if first is None else first):
                done += len(piece)
                if done > largest:
                    raise FormatError(path, "", f"unpacks to more than {largest / 1e6:.0f} MB, which no text does")
                yield piece
                if first is not None:
                    return
    except (OSError, EOFError, zlib.error) as cause:
        raise FormatError(path, "", f"is no whole gzip file ({cause})") from None
