"""Manifests of sets of problem files that others publish: `NAME.toml` beside this module, facts and hashes alone.

    title = "Convex quadratic programs of Maros and Mészáros"
    formulation = "qp"              # what its files become when they are read
    reader = "arrays"               # a name of `cpbench list formats`; "" where cpbench reads none of its files
    source = "https://github.com/..."
    commit = "0cae37f4..."          # "" where the set has none
    folder = "data"                 # of the files in the source
    licence = "Apache-2.0"          # an SPDX identifier; NONE: the source has no licence
    citation = "..."
    count = 138                     # files of the set in the source; left out where they were not counted
    names = ["*.nl"]                # patterns of the files that a user may bring, where no hashes are known
    [files]
    "AUG2D.mat" = { size = 391224, sha256 = "..." }
    "diphasic-Ma.txt" = { size = 164832, sha256 = "...", origin = "Ma.txt" }     # its name in the source

A file without a hash here is in no manifest: a hash comes from the file, or from its Git-LFS pointer.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any

from cpbench.errors import UnknownName
from cpbench.foundation.text import counted


@dataclass(frozen=True)
class ListedFile:
    """A file of a set: its size [bytes], its SHA-256 and its path in the folder of the source."""

    size: int
    sha256: str
    origin: str


@dataclass(frozen=True)
class Manifest:
    """A set of problem files that others publish.

    Attributes
    ----------
    name : of the set. title : one line. formulation : nodes, between commas. reader : name of the format, or "".
    source : address. commit : of the source, or "". folder : of the files in the source. licence : SPDX identifier.
    citation : what to cite. count : files that the set has in the source, None where unknown. names : patterns of
    files without a known hash. files : by their path in the set.
    """

    name: str
    title: str
    formulation: str
    reader: str
    source: str
    licence: str
    citation: str
    commit: str = ""
    folder: str = ""
    count: int | None = None
    names: tuple[str, ...] = ()
    files: Mapping[str, ListedFile] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Size of the listed files [bytes]."""
        return sum(file.size for file in self.files.values())

    @property
    def extent(self) -> str:
        """How many files are listed: `12 files`, `partial: 97 of 138 files listed`, or that the user brings them."""
        if self.names:
            return f"files of the user ({', '.join(self.names)})"
        if self.count == len(self.files):
            return counted(len(self.files), "file")
        return f"partial: {len(self.files)} of {self.count or 'an unknown number of'} files listed"


def manifest(name: str) -> Manifest:
    """Return the manifest of the set called `name`; raises UnknownName."""
    if name not in names():
        raise UnknownName("collection", name, names())
    return _read(Path(__file__).with_name(f"{name}.toml"))


@cache
def names() -> tuple[str, ...]:
    """Return the names of all sets that have a manifest, sorted."""
    return tuple(sorted(path.stem for path in Path(__file__).parent.glob("*.toml")))


@cache
def _read(path: Path) -> Manifest:
    table: dict[str, Any] = tomllib.loads(path.read_text("utf-8"))
    files = {name: _listed(name, entry) for name, entry in table.pop("files", {}).items()}
    patterns = tuple(table.pop("names", ()))
    return Manifest(name=path.stem, names=patterns, files=files, **table)


def _listed(name: str, entry: Mapping[str, Any]) -> ListedFile:
    return ListedFile(entry["size"], entry["sha256"], str(PurePosixPath(entry.get("origin", name))))
