"""Markdown that the generated pages share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown; bars and line breaks inside cells are escaped."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(map(_cell, row)) + " |" for row in rows)])


def verbatim(text: str, language: str = "text") -> str:
    """Return a block of text as it stands."""
    return f"```{language}\n{text.strip()}\n```"


def contents(*entries: str) -> str:
    """Return a hidden table of contents: the pages that come below a page, by their paths or by a pattern."""
    return "\n".join(["```{toctree}", ":hidden:", ":glob:", "", *entries, "```", ""])


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
