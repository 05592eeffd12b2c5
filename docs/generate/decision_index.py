"""The index of the decisions, read from their files."""

from __future__ import annotations

import re
from pathlib import Path

from page_parts import contents, table

FOLDER = Path(__file__).resolve().parents[1] / "decisions"


def page() -> str:
    """Return a table of all decisions, by part of the program and date."""
    rows = sorted((_header(path) for path in FOLDER.glob("[0-9]*.md")), key=lambda row: (row[1], row[0]))
    return "\n\n".join(
        [
            "# Decisions",
            "What binds now, why, and what was rejected. A decision that is revised gets a new file, and the status of "
            "the old one names it; the last line of a record names those that it merged, whose text is in the history.",
            table(["decision", "part", "date", "status"], rows),
            contents("0*"),
        ]
    )


def _header(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8")
    title = re.match(r"# (.+)\n", text)
    facts = re.search(r"^Date: (\S+) · Part: (.+)$", text, re.MULTILINE)
    status = re.search(r"^Status: (.+)$", text, re.MULTILINE)
    if title is None or facts is None or status is None:
        raise ValueError(f"{path.name}: lacks one of '# title', 'Date: … · Part: …' and 'Status: …'")
    return [f"[{title[1]}]({path.name})", facts[2], facts[1], status[1]]
