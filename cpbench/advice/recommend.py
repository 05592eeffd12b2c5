"""Solvers that suit a problem, ranked by what was measured on problems like it."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.errors import CpbenchError
from cpbench.formulations.base import Problem
from cpbench.plurals import counted

if TYPE_CHECKING:
    from cpbench.advice.candidates import Candidate
    from cpbench.advice.recommendation import Recommendation
    from cpbench.analysis.training_cases import TrainingCases


@dataclass(frozen=True, repr=False)
class Recommended:
    """The solvers that suit a problem, best first.

    Attributes
    ----------
    taken : solvers that take it, with their routes and what they came to on problems like it. passed : better ranked
    ones that do not, each with its obstacle. found : what was measured on problems like it. source : where.
    remarks : what a reader should know.
    """

    taken: tuple[Candidate, ...]
    passed: tuple[Candidate, ...]
    found: Recommendation
    source: str
    remarks: tuple[str, ...] = ()

    @property
    def solvers(self) -> list[str]:
        """The labels, best first, as results have them (`SOLVER[option=value]@ROUTE`)."""
        return [one.advice.label for one in self.taken]

    @property
    def best(self) -> str:
        """The label of the first."""
        return self.solvers[0]

    def __repr__(self) -> str:
        return "\n".join([*(f"{label}: {text}" for label, text in self._lines()), f"by {self.source}", *self.remarks])

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(label)}</td><td>{html.escape(text)}</td></tr>" for label, text in self._lines()
        )
        notes = "".join(f"<p>{html.escape(text)}</p>" for text in (f"by {self.source}", *self.remarks))
        return f"<table>{rows}</table>{notes}"

    def _lines(self) -> list[tuple[str, str]]:
        return [(one.advice.label, f"{one.route}, {one.summary}") for one in self.taken]


def recommend(
    problem: Problem, *, results: Sequence[str | Path] = (), top: int = 3, tolerance: float | None = None
) -> Recommended:
    """Name the solvers that suit a problem, by what they came to on problems like it.

    Parameters
    ----------
    results : results files to go by; none for the built-in problems, as measured where this version was made.
    top : how many. tolerance : of the rows to go by, with `results` only.

    Raises CpbenchError where nothing was measured, or nothing takes the problem here.

    >>> import cpbench
    >>> cpbench.recommend(cpbench.LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-5.0, -6.0]), top=2).solvers  # doctest: +ELLIPSIS
    ['...', '...']
    """
    from cpbench.advice import evidence

    known, source, remarks = evidence.gather([Path(path) for path in results], False, False, tolerance)
    return recommended(problem, known, source, remarks, top=top)


def recommended(
    problem: Problem,
    known: TrainingCases,
    source: str,
    remarks: Sequence[str],
    *,
    warm: bool = False,
    top: int = 3,
    missing: bool = False,
) -> Recommended:
    """Rank what is known for a problem and ask the first of them whether they take it; raises CpbenchError.

    Parameters
    ----------
    known : what was measured, `source` : where, `remarks` : on that. warm : only solvers that take a starting point.
    missing : solvers, too, that cannot run here.
    """
    from cpbench.advice import candidates, recommendation
    from cpbench.bench.planning.features import features

    notes = list(remarks)
    if any(case.fingerprint == problem.fingerprint for case in known.cases):
        notes.append("this very problem is among those that were measured")
    labels = [*known.labels, *candidates.unmeasured(known.labels, known.requests)]
    may = candidates.applicable(problem, labels, known.requests, warm)
    found = recommendation.recommend(known, features(problem), may)
    candidates.require_some(found.advice, problem.node)
    taken: list[Candidate] = []
    passed: list[Candidate] = []
    for one in candidates.examine(problem, found.advice, known.requests, missing=missing):
        (passed if one.obstacle else taken).append(one)
        if len(taken) == top:
            break
    if not taken:
        raise CpbenchError(
            f"{source}: none of {counted(len(passed), 'solver')} takes this problem here; the first, "
            f"{passed[0].advice.label}: {passed[0].obstacle}"
        )
    return Recommended(tuple(taken), tuple(passed), found, source, tuple(notes))
