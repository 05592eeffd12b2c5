"""The problems of the quick suite: few of each formulation of the core, where methods matter and not the call."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from pathlib import Path

from cpbench.formulations import formulations
from cpbench.generators.base import SMALL
from cpbench.generators.collection import ListedProblem, catalogue

FEW = 10
"""How many problems of a formulation the suite has: from so many on, a ranking is more than a hint."""
SMALLEST, MIDDLE, LARGEST = 30, 100, 300
"""Unknowns of the problems that it takes first, those nearest to MIDDLE (as ratios): solves take milliseconds there."""
NONE = ("infeasible", "unbounded")
"""How it is known that a problem has no solution; the suite has none of these."""


def quick_problems(folder: Path) -> list[str]:
    """Return the addresses of the problems of the suite, at most FEW of each formulation of the core.

    Families take turns. Of each family, the problem nearest to MIDDLE comes first of those that have between SMALLEST
    and LARGEST unknowns; where there are fewer than FEW of these, smaller ones follow, the largest first.
    """
    by_node: dict[str, list[ListedProblem]] = {}
    for entry in catalogue(folder):
        if (
            formulations.get(entry.node).core
            and entry.tier == SMALL
            and entry.known not in NONE
            and entry.unknowns <= LARGEST
        ):
            by_node.setdefault(entry.node, []).append(entry)
    chosen: list[str] = []
    for entries in by_node.values():
        large = [entry for entry in entries if entry.unknowns >= SMALLEST]
        small = [entry for entry in entries if entry.unknowns < SMALLEST]
        chosen += [entry.address for entry in (*_by_turns(large), *_by_turns(small))][:FEW]
    return chosen


def _by_turns(entries: Sequence[ListedProblem]) -> Iterator[ListedProblem]:
    """Yield the first of each family, then the second of each, and so on, those nearest to MIDDLE first."""

    def distance(entry: ListedProblem) -> tuple[float, str]:
        return max(entry.unknowns / MIDDLE, MIDDLE / entry.unknowns), entry.name

    families: dict[str, list[ListedProblem]] = {}
    for entry in sorted(entries, key=distance):
        families.setdefault(entry.family, []).append(entry)
    for turn in zip_longest(*(families[name] for name in sorted(families))):
        yield from (entry for entry in turn if entry is not None)
