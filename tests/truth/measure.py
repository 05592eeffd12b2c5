"""Judges the answers that `collect.py` has kept with `cpbench.verification.judge`, and lists what is false.

    python tests/truth/measure.py --cache FOLDER [--eps 1e-6 ...] [--lines 40] [NAME ...]

False solved: `solved` with the objective off by more than 10 ε of its terms at the reference, or a row or bound missed
by more than 10 ε of its terms (of the size of its unknowns by more than 1000 ε, where its terms are all 0). False
rejections: right to ε/100 by the numbers of the literature, and not solved.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kept_answers import kept
from qp_literature import Array, Literature, Reference, literature, misses, off, unknown_sizes

from cpbench.verification import judge

EPSILONS = (1e-4, 1e-6, 1e-8)
FALSE_FACTOR = 10.0
"""A solved answer may be off by this many ε."""
ZERO_FACTOR = 1000.0
"""So may a row or bound of zeros: what is its size is said by other rows, so that it is known less well."""
RIGHT_SHARE = 0.01
"""An answer whose numbers are all within this share of ε is right."""


@dataclass(frozen=True)
class Measured:
    """One answer under one ε: the judge's word, and what is true of it by other measures."""

    file: str
    label: str
    epsilon: float
    solved: bool
    error: float
    off: float
    rows: float
    zeros: float
    numbers: Literature

    @property
    def missed(self) -> dict[str, bool]:
        """Return which of objective, rows and bounds, and rows and bounds of zeros are off by too much."""
        return {
            "off": self.off > FALSE_FACTOR * self.epsilon,
            "rows": self.rows > FALSE_FACTOR * self.epsilon,
            "zeros": self.zeros > ZERO_FACTOR * self.epsilon,
        }

    @property
    def falsely_solved(self) -> bool:
        return self.solved and any(self.missed.values())

    def right(self, by_row: bool) -> bool:
        """Right to ε/100, each row over its own terms, or over the largest terms of its kind."""
        return max(self.numbers.worst(by_row), self.off) <= RIGHT_SHARE * self.epsilon

    def __str__(self) -> str:
        n = self.numbers
        return (
            f"{self.file:18} {self.label:22} eps {self.epsilon:.0e} {'solved' if self.solved else 'not':6} "
            f"error {self.error:.1e} | f off {self.off:.1e} row* {self.rows:.1e} zeros* {self.zeros:.1e} | "
            f"row {n.rows:.1e}/{n.rows_norm:.1e} bound {n.bounds:.1e} gradient {n.gradient:.1e}/{n.gradient_norm:.1e} "
            f"gap {n.gap:.1e}/{n.gap_terms:.1e}"
        )


def measured(
    name: str, problem: Any, label: str, point: Any, reference: Reference, sizes: Array, epsilons: Sequence[float]
) -> Iterator[Measured]:
    """Yield one answer measured at each ε. `sizes` : of the unknowns."""
    numbers = literature(problem, point)
    far, (rows, zeros) = off(problem, point.z, reference), misses(problem, point.z, reference, sizes)
    for epsilon in epsilons:
        verdict = judge(problem, point, epsilon)
        yield Measured(name, label, epsilon, verdict.solved, verdict.error, far, rows, zeros, numbers)


def cached(folder: Path, names: Sequence[str], epsilons: Sequence[float]) -> Iterator[Measured | str]:
    """Yield every kept answer measured, and the name of each problem that has no reference."""
    for name, problem, answers, reference in kept(folder, names):
        if reference is None:
            yield name
            continue
        sizes = unknown_sizes(problem, reference)
        for label, point in answers:
            yield from measured(name, problem, label, point, reference, sizes, epsilons)


def listed(title: str, rows: Iterable[Measured], lines: int) -> None:
    rows = list(rows)
    by_file = sorted({row.file for row in rows})
    print(f"\n{title}: {len(rows)} on {len(by_file)} files {' '.join(by_file)}")
    for row in rows[:lines]:
        print("  ", row)


def report(rows: list[Measured], lines: int) -> None:
    """Print counts and lists for each ε."""
    for epsilon in sorted({row.epsilon for row in rows}, reverse=True):
        here = [row for row in rows if row.epsilon == epsilon]
        files = {row.file for row in here}
        solved = sum(row.solved for row in here)
        print(f"\n=== eps {epsilon:.0e}: {len(here)} answers to {len(files)} problems, {solved} solved")
        for name, words in (("off", "objective off"), ("rows", "a row missed"), ("zeros", "a row of zeros missed")):
            false = [row for row in here if row.solved and row.missed[name]]
            false.sort(key=lambda row, name=name: -getattr(row, name))
            listed(f"(i) false solved, {words}", false, lines)
        for by_row, words in ((True, "row by row"), (False, "over the largest terms")):
            right = [row for row in here if row.right(by_row)]
            rejected = sorted((row for row in right if not row.solved), key=lambda row: -row.error)
            listed(f"(ii) false rejections, {words} (of {len(right)} right)", rejected, lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="problems; all where none is named")
    parser.add_argument("--cache", type=Path, required=True, help="the folder that collect.py has written")
    parser.add_argument("--eps", type=float, nargs="+", default=EPSILONS, help="tolerances")
    parser.add_argument("--lines", type=int, default=40, help="lines of each list")
    given = parser.parse_args()
    rows: list[Measured] = []
    without: list[str] = []
    for found in cached(given.cache, given.names, given.eps):
        if isinstance(found, str):
            without.append(found)
        else:
            rows.append(found)
    report(rows, given.lines)
    print(f"\nwithout reference, left out ({len(without)}): {' '.join(without)}")


if __name__ == "__main__":
    main()
