"""Descriptions of problems by family, in tables of the packages that make them: what the problem is, what makes it
hard, and how many solutions it has where that is known. Sizes and properties of each problem are filled in."""

from __future__ import annotations

import fnmatch
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

_folders: list[Path] = []
"""Folders of the tables."""


def include(folder: Path) -> None:
    """Add the tables (.toml) of a folder; the package of the families calls it when it is imported."""
    if folder not in _folders:
        _folders.append(folder)
        entries.cache_clear()


@dataclass(frozen=True)
class Description:
    """A description of a problem; empty where no table has an entry for it.

    Attributes
    ----------
    text : what it is. hard : what makes it hard. solutions : their number, or `infinite`.
    """

    text: str = ""
    hard: str = ""
    solutions: str = ""

    @property
    def sentences(self) -> str:
        """Return what it is, and what makes it hard."""
        return f"{self.text} Difficulty: {self.hard[:1].lower()}{self.hard[1:]}" if self.hard else self.text


@cache
def entries() -> dict[str, Description]:
    """Return the entries of all tables by their pattern, in the order of folders, files and lines."""
    by_pattern: dict[str, Description] = {}
    for path in (path for folder in _folders for path in sorted(folder.glob("*.toml"))):
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        by_pattern |= {pattern: Description(**entry) for pattern, entry in table.items()}
    return by_pattern


def pattern_of(collection: str, name: str) -> str:
    """Return the pattern of the first entry that fits a problem of a collection, '' for none."""
    return next((pattern for pattern in entries() if fnmatch.fnmatchcase(f"{collection}/{name}", pattern)), "")


def describe(collection: str, name: str, values: Mapping[str, Any]) -> Description:
    """Return the description of a problem with its `values`, sizes and properties, in place of their names.

    Raises KeyError where the entry names a value that the problem has not.
    """
    pattern = pattern_of(collection, name)
    if not pattern:
        return Description()
    entry, facts = entries()[pattern], {"name": name, **values}
    return Description(entry.text.format_map(facts), entry.hard.format_map(facts), entry.solutions.format_map(facts))
