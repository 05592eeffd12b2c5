"""What `cpbench.verification.judge` says of answers to QPs beside what is true of them.

False solved: `solved` with the objective off by more than 10 ε of its terms at the reference, or a row or bound missed
by more than 10 ε of its terms (of the size of its unknowns by more than 1000 ε, where its terms are all 0). False
rejections: right to ε/100 by the numbers of the literature, and not solved.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from qp_literature import Array, Literature, Reference, literature, misses, off

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
