"""Bimatrix games as Gambit's strategic form, `.nfg` (its manual, "The strategic game (.nfg) file format").

`NFG 1 R "title" { "player" "player" } { 2 3 }` is followed by the payoffs of both players, or by outcomes
`{ { "name" 3, 2 } ... }` and the number of one for each pair of choices, 0 for none; the choice of the first player
changes fastest. Choices may be named: `{ { "up" "down" } { "a" "b" "c" } }`.
"""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.errors import FormatError, ProblemError
from cpbench.formulations.base import Problem
from cpbench.storage.base import Format, formats, no_member, read_text, stem
from cpbench_problems.applications import game_problem

_TOKEN = re.compile(r'"(?:\\.|[^"\\])*"|[{}]|[^\s{},"]+')
_HEAD = re.compile(rb"\s*NFG\s+1\s+[RD]\b")
_LARGEST = 10**7


class Nfg(Format):
    """Two players and their payoffs."""

    name = "nfg"
    summary = "bimatrix game in Gambit's strategic form"
    suffixes = (".nfg",)

    def recognises(self, path: Path, head: bytes) -> bool:
        return _HEAD.match(head) is not None

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        items = _items(path, _TOKEN.findall(read_text(path)))
        parts = items[3:]  # NFG 1 R
        if len(parts) < 4 or not (isinstance(parts[1], list) and isinstance(parts[2], list)):
            raise FormatError(path, "", "is no strategic form: expected a title, { players } { choices } and payoffs")
        _, players, choices, *rest = parts
        if rest and isinstance(rest[0], str) and rest[0].startswith('"'):
            rest = rest[1:]  # a comment
        if len(players) != 2 or len(choices) != 2:
            raise FormatError(path, "players", f"are {len(players)}, expected 2: a game of more has no formulation")
        m, n = (len(part) if isinstance(part, list) else int(_number(path, part)) for part in choices)
        if not (0 < m * n <= _LARGEST):
            raise FormatError(path, "choices", f"are {m} and {n}, expected some for each player")
        if rest and isinstance(rest[0], list):
            outcomes = [[0.0, 0.0], *([_number(path, v) for v in one if not str(v).startswith('"')] for one in rest[0])]
            numbers = [int(_number(path, word)) for word in rest[1:]]
            if any(not 0 <= k < len(outcomes) for k in numbers) or any(len(pair) != 2 for pair in outcomes):
                raise FormatError(path, "outcomes", f"are {len(outcomes) - 1} of 2 payoffs each, expected others")
            flat = [payoff for k in numbers for payoff in outcomes[k]]
        else:
            flat = [_number(path, word) for word in rest]
        if len(flat) != 2 * m * n:
            raise FormatError(path, "payoffs", f"are {len(flat)}, expected {2 * m * n}, 2 for each pair of choices")
        payoffs = np.array(flat).reshape(n, m, 2)
        try:
            return game_problem(payoffs[:, :, 0].T, payoffs[:, :, 1].T, stem(path))
        except ProblemError as cause:
            raise FormatError(path, "payoffs", cause.cause) from None


def _items(path: Path, tokens: list[str]) -> list[Any]:
    """Return the words of a file, lists in braces as lists; raises FormatError."""
    result: list[Any] = []
    within: list[list[Any]] = [result]
    for token in tokens:
        if token == "{":
            within.append([])
        elif token == "}" and len(within) > 1:
            done = within.pop()
            within[-1].append(done)
        elif token == "}":
            raise FormatError(path, "", "has a } without its {")
        else:
            within[-1].append(token)
    if len(within) > 1:
        raise FormatError(path, "", "has a { without its }")
    return result


def _number(path: Path, word: Any) -> float:
    """Return a decimal number, or a fraction as 2/3; raises FormatError."""
    try:
        return float(Fraction(word))
    except (ValueError, TypeError, ZeroDivisionError, OverflowError):
        raise FormatError(path, "", f"has {str(word)[:40]!r}, expected a number") from None


formats.add("nfg", Nfg())
