"""Folders that reports are written to."""

from __future__ import annotations

from pathlib import Path

from cpbench.errors import FormatError


def require_folder(path: Path) -> None:
    """Make a folder; raises FormatError where it cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise FormatError(path, "", f"cannot be made a folder ({cause.strerror or cause})") from None
