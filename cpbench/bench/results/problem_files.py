"""Digests of the files that problems were read from, by which later commands name those that changed since the run.

They are in the facts of a results file, under `files`: the path of each file as the run read it, and `BYTES:DIGEST`.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path

from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench.foundation.text import on_one_line, some_of
from cpbench.storage.base import split_address

SIZE = 16
"""Bytes of a digest."""
NAMED = 5
"""Most files that a line names."""


def digests(read: Mapping[str, str | None]) -> dict[str, str]:
    """Return the digests of the files of problems.

    read : the addresses of the problems, with the formats by which they were read.
    """
    result: dict[str, str] = {}
    for address, format in read.items():
        for file in _files(address, format):
            if str(file) not in result and (digest := _digest(file)):
                result[str(file)] = digest
    return result


def changed(store: Store) -> list[str]:
    """Return in one line the files that are not as the run read them, in a list that is empty without any.

    Relative paths are looked for from here and from the folder of the results. A file that is not there is passed over.
    """
    known: Mapping[str, str] = store.meta().get("files") or {}
    names = [file for file, digest in known.items() if _differs(file, digest, store.path.parent)]
    if not names:
        return []
    listed = some_of([on_one_line(name) for name in names], NAMED)
    return [
        f"problem files that changed after the run read them: {listed}; the rows are of what they were, and another "
        "results file (cpbench run -o) gets rows of what they are"
    ]


def _files(address: str, format: str | None) -> list[Path]:
    """Return the files of a problem; that of the address where it cannot be read any more."""
    try:
        found = storage.files(address, format)
    except CpbenchError:
        found = [split_address(address)[0]]
    return [file for file in found if file.is_file()]


def _differs(file: str, digest: str, folder: Path) -> bool:
    """Return whether there is such a file, and none with these bytes."""
    there = [place for place in (Path(file), folder / file) if place.is_file()]
    return bool(there) and not any(_is(place, digest) for place in there)


def _is(place: Path, digest: str) -> bool:
    """Return whether a file has this digest; the number of bytes decides first."""
    try:
        size = os.stat(place).st_size
    except OSError:
        return False
    return digest.startswith(f"{size}:") and _digest(place) == digest


def _digest(file: Path) -> str:
    """Return the digest of a file, '' where it cannot be read."""
    try:
        with open(file, "rb") as opened:
            mixed = hashlib.file_digest(opened, lambda: hashlib.blake2b(digest_size=SIZE))
            return f"{opened.tell()}:{mixed.hexdigest()}"
    except OSError:
        return ""
