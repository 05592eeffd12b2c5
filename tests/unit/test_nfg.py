"""Gambit's strategic form, by the examples of its manual."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cpbench
from cpbench.errors import FormatError

SELTEN = """NFG 1 R "Selten (IJGT, 75), Figure 2, normal form" { "Player 1" "Player 2" } { 3 2 }

1 1 0 2 0 2
1 1 0 3 2 0
"""
OUTCOMES = """NFG 1 R "two choices" { "P1" "P2" }
{ { "up" "down" } { "a" "b" "c" } }
"a comment"
{ { "one" 3, 1/2 } { "" 0, -1 } }
1 0 2 1 1 2
"""


@pytest.mark.parametrize(
    ("text", "A", "B"),
    [
        (SELTEN, [[1, 1], [0, 0], [0, 2]], [[1, 1], [2, 3], [2, 0]]),
        (OUTCOMES, [[3, 0, 3], [0, 3, 0]], [[0.5, -1, 0.5], [0, 0.5, -1]]),
    ],
)
def test_payoffs_and_outcomes_are_the_game(
    text: str, A: list[list[float]], B: list[list[float]], tmp_path: Path
) -> None:
    (tmp_path / "game.nfg").write_text(text)
    assert (
        cpbench.load(tmp_path / "game.nfg").fingerprint
        == cpbench.from_game(np.array(A), np.array(B)).problem.fingerprint
    )


@pytest.mark.parametrize(
    ("old", "new", "cause"),
    [
        ('"Player 2" }', '"Player 2" "3" }', "players: are 3, expected 2"),
        ("{ 3 2 }", "{ 3 3 }", "payoffs: are 12, expected 18"),
        ("0 3 2 0", "0 x 2 0", "has 'x', expected a number"),
        ("{ 3 2 }", "{ 3 2 ", "without its }"),
        ("{ 3 2 }", "", "is no strategic form"),
    ],
)
def test_what_is_no_such_game_is_refused(old: str, new: str, cause: str, tmp_path: Path) -> None:
    (tmp_path / "game.nfg").write_text(SELTEN.replace(old, new))
    with pytest.raises(FormatError, match=cause):
        cpbench.load(tmp_path / "game.nfg")
