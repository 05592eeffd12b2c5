"""The last look at an anonymous bundle: what must not be told is searched in every byte, packed or not."""

from __future__ import annotations

import base64
import gzip
import io
import re
import sqlite3
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from cpbench.errors import CpbenchError

LONG = 6
"""Bytes from which on a word is looked for in numbers too; shorter ones stand there by chance."""
DRAWN = (".html", ".svg")
"""Files that are full of short words of a program's own."""
_EMBEDDED = re.compile(rb"H4sI[A-Za-z0-9+/]+=*")
"""gzip in base64, as the data of a page are."""
_SQLITE, _HDF5 = b"SQLite format 3\0", b"\x89HDF\r\n\x1a\n"


def require_none(folder: Path, words: Mapping[str, str]) -> None:
    """Raise CpbenchError where a file below `folder` holds one of the words, or is called by it."""
    patterns = [(word, kind, _pattern(word)) for word, kind in sorted(words.items())]
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        name = path.relative_to(folder).as_posix()
        for where, content in [("its name", name.encode()), *_contents(path)]:
            text = b"\0" not in content and path.suffix not in DRAWN
            for word, kind, pattern in patterns:
                if (text or len(word.encode()) >= LONG) and (found := pattern.search(content)):
                    text = found[0].decode("utf-8", "replace")
                    raise CpbenchError(
                        f"{name}: {where} still tells {kind}, '{text}': nothing was written; give it another name with "
                        f"--rename '{text}=NAME', or take it out of the file"
                    )


def _pattern(word: str) -> re.Pattern[bytes]:
    """Return a pattern of the word as such: not as a part of another."""
    raw = re.escape(word.encode("utf-8", "surrogateescape"))
    return re.compile(rb"(?<![A-Za-z0-9])" + raw + rb"(?![A-Za-z0-9])", re.IGNORECASE)


def _contents(path: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the bytes of a file, and what is packed in them."""
    raw = path.read_bytes()
    yield "its content", raw
    yield from unpacked(raw, path)
    if path.suffix == ".html":
        for found in _EMBEDDED.finditer(raw):
            yield from unpacked(base64.b64decode(found[0]))


def unpacked(raw: bytes, path: Path | None = None) -> Iterator[tuple[str, bytes]]:
    """Yield what is packed in bytes: the values of a database, texts and arrays of an HDF5 file, zlib, gzip and zip."""
    if raw.startswith(_SQLITE) and path is not None:
        yield from _of_database(path)
    elif raw.startswith(_HDF5):
        yield from _of_hdf5(raw)
    elif raw[:1] == b"\x78":
        try:
            yield "what is packed in it", zlib.decompress(raw)
        except zlib.error:
            return
    elif raw[:2] == b"\x1f\x8b":
        yield "what is packed in it", gzip.decompress(raw)
    elif raw[:4] == b"PK\x03\x04":
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            for name in archive.namelist():
                yield f"its part {name}", archive.read(name)


def _of_database(path: Path) -> Iterator[tuple[str, bytes]]:
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)) as db:
        for (table,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
            for values in db.execute(f'SELECT * FROM "{table}"'):
                for value in values:
                    raw = value.encode() if isinstance(value, str) else value if isinstance(value, bytes) else b""
                    if raw:
                        yield f"its table {table}", raw
                        yield from unpacked(raw)


def _of_hdf5(raw: bytes) -> Iterator[tuple[str, bytes]]:
    import h5py

    found: list[tuple[str, bytes]] = []

    def visit(name: str, item: Any) -> None:
        for key, value in item.attrs.items():
            found.append((f"its attribute {name}@{key}", f"{key}={value}".encode("utf-8", "replace")))
        if isinstance(item, h5py.Dataset):
            content: Any = item[()]
            found.append((f"its data {name}", content if isinstance(content, bytes) else content.tobytes()))

    with h5py.File(io.BytesIO(raw), "r") as file:
        visit("", file)
        file.visititems(visit)
    yield from found
