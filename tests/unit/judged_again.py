"""The lines of a results file whose kept answers are judged again."""

from __future__ import annotations

from pathlib import Path

from cpbench.bench.results.rejudge import rejudge_file


def judged_again(path: Path, measure: str | None = None, tolerance: float | None = None) -> tuple[bool, list[str]]:
    """Whether every row follows from its answer, and what is said, without the digest of the file in the last line."""
    lines: list[str] = []
    follows = rejudge_file(path, measure, tolerance, lines.append)
    assert lines.pop().startswith("SHA-256 of the file: ")
    return follows, lines
