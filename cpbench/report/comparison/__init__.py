"""Results of a comparison, written for a terminal, a CI summary and programs."""

from __future__ import annotations

from pathlib import Path

from cpbench.analysis.comparison import Comparison
from cpbench.errors import FormatError
from cpbench.report.comparison import json_file, markdown

_WRITERS = {".md": markdown.document, ".json": json_file.document}


def write(comparison: Comparison, path: Path) -> None:
    """Write a comparison in the form of the suffix; raises FormatError."""
    if path.suffix not in _WRITERS:
        raise FormatError(path, "", f"unknown suffix '{path.suffix}'; use {', '.join(_WRITERS)}")
    try:
        path.write_text(_WRITERS[path.suffix](comparison), encoding="utf-8")
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None
