"""The rows of a results file with what is computed of all of them: each once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from cpbench.analysis import cautions, contradictions
from cpbench.analysis import table as rows_of
from cpbench.analysis.ranking import Ranking, rankings
from cpbench.foundation.text import counted

if TYPE_CHECKING:
    import pandas as pd

    from cpbench.analysis.contradictions import Contradiction

META = "collection"
"""Name of the quotation of the collection among the facts of a run."""
DIGITS = 16
"""Digits of the hash that a quotation shows."""


@dataclass(frozen=True, eq=False)
class RunTable:
    """All rows of a run.

    Attributes
    ----------
    stored : the rows as the file has them. rows : the same, `analysis.table.normalised`. meta : facts of the run.
    """

    stored: pd.DataFrame
    rows: pd.DataFrame
    meta: Mapping[str, Any]

    @classmethod
    def of(cls, stored: pd.DataFrame, meta: Mapping[str, Any]) -> RunTable:
        """Return the rows of a file with their normalised form."""
        return cls(stored, rows_of.normalised(stored), meta)

    @cached_property
    def rankings(self) -> list[Ranking]:
        """A ranking of each formulation, with a sentence that says what to use."""
        return rankings(self.rows, self.meta.get("solvers") or {})

    @cached_property
    def contradictions(self) -> list[Contradiction]:
        """Rows that cannot all be right: claims, answers and verdicts on one problem."""
        return contradictions.of_results(self.meta, self.rows)

    @cached_property
    def disturbance(self) -> str:
        """Return what may have disturbed the times of the run; '' where nothing is known of it."""
        return cautions.disturbance(self.rows, self.meta)

    @cached_property
    def noise(self) -> float:
        """Ratio up to which its times may differ by the machine alone."""
        return cautions.noise(self.rows, self.meta)


def quotation(meta: Mapping[str, Any]) -> str:
    """Return the line about the collection by the facts of a run, '' where they quote none.

    >>> quotation({"collection": {"name": "c 1", "problems": 9, "sha256": "ab" * 32, "here": 2}})
    '2 problems of c 1 (9 problems, sha256 abababababababab)'
    """
    quoted = meta.get(META)
    if not quoted:
        return ""
    whole = f"{counted(quoted['problems'], 'problem')}, sha256 {quoted['sha256'][:DIGITS]}"
    return f"{counted(quoted['here'], 'problem')} of {quoted['name']} ({whole})"
