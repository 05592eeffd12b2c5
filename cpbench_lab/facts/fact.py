"""The record of a measured fact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum


class How(StrEnum):
    """Evidence for a fact."""

    EXACT = "exact"
    """By its definition, or by a witness that anyone can check; rounding of single operations apart."""
    FACTORIZATION = "factorization"
    """By eigenvalues, singular values or pivots, whose rounding error the tolerance covers."""
    UNDECIDED = "not decided"
    """The test would cost too much, or rounding decides; `evidence` says which."""


@dataclass(frozen=True)
class Fact:
    """One property of one matrix (or of the whole problem, `matrix` empty).

    Attributes
    ----------
    value : True or False, a count, or a word ("indefinite"); None where it is not decided.
    number : the measured number behind it, which `evidence` names. tolerance : what the number was held against.
    """

    name: str
    matrix: str
    value: bool | int | float | str | None
    how: How
    number: float | None = None
    tolerance: float | None = None
    evidence: str = ""

    @property
    def subject(self) -> str:
        """`rank of A`, or the name alone for the whole problem."""
        return f"{self.name} of {self.matrix}" if self.matrix else self.name

    @property
    def words(self) -> str:
        """The value in words."""
        return {None: "not decided", True: "yes", False: "no"}[self.value] if _is_truth(self.value) else f"{self.value}"

    def __str__(self) -> str:
        """Format as `P-matrix of M: yes (exact, least ratio of minors 0.2)`."""
        measured = f"{self.evidence} {self.number:.3g}".strip() if self.number is not None else self.evidence
        if self.tolerance is not None:
            measured += f", tolerance {self.tolerance:.1e}"
        how = [] if self.how is How.UNDECIDED else [str(self.how)]
        remark = ", ".join([*how, *([measured] if measured else [])])
        return f"{self.subject}: {self.words}" + (f" ({remark})" if remark else "")


def decided(fact: Fact) -> Fact:
    """Return the fact, or that it is not decided where the number behind it is NaN, with which no comparison holds."""
    if fact.number is None or not math.isnan(fact.number):
        return fact
    return undecided(fact.name, fact.matrix, "the numbers of the matrix overflow or underflow in the test")


def _is_truth(value: object) -> bool:
    return value is None or isinstance(value, bool)


def undecided(name: str, matrix: str, why: str, number: float | None = None) -> Fact:
    """State that something was not decided, and why."""
    return Fact(name, matrix, None, How.UNDECIDED, number, evidence=why)
