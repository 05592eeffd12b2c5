"""One rule for what commands write: results of work are never replaced without --force, and asked for before the work;
pictures and reports are made anew from what is kept, so that they are replaced, with a note."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


def replaced(path: Path, before: Iterable[Path]) -> str:
    """Return the path as text, with a word where it was there before."""
    return f"{path} (replaced)" if path in before else str(path)
