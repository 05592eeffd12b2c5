"""Every decision says whether it holds, and one that a later one revises names it."""

from __future__ import annotations

import re
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "decisions"
FILES = {path.name[:4]: path for path in sorted(FOLDER.glob("[0-9]*.md"))}
NUMBER = re.compile(r"\b(\d{4})\b")


def status(number: str) -> str:
    found = re.findall(r"^Status: (.+)$", FILES[number].read_text("utf-8"), re.MULTILINE)
    assert len(found) == 1, FILES[number].name
    return found[0]


def test_a_decision_has_one_status_that_names_later_decisions() -> None:
    for number in FILES:
        named = NUMBER.findall(status(number))
        assert bool(named) == (status(number) != "accepted"), number
        assert all(number < later and later in FILES for later in named), number


def test_what_a_decision_revises_names_it() -> None:
    for number, path in FILES.items():
        for old, other in re.findall(r"[Rr]evises (\d{4})(?: and (\d{4}))?", path.read_text("utf-8")):
            assert number in status(old), number
            assert not other or number in status(other), number
