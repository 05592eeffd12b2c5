"""A problem on which a solver fails, made as small and as simple as the failure lets it be.

Parts are left out (`parts`), then numbers made simple (`numbers`), and again, until nothing changes. Every candidate is
a file that the program reads, and the failure is looked for in a solve of it, in a separate process (`trials`). What
the problem was stays: positive semidefinite where it was, and solved by another solver where it was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from cpbench.errors import CpbenchError
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.graph import arrive, nodes_of_maps
from cpbench.solvers.base import solvers
from cpbench_lab.reduction import numbers
from cpbench_lab.reduction.parts import RemovablePart, condensed, kinds, without
from cpbench_lab.reduction.trials import CandidateOutcome, Trials

LARGE = 400
"""Numbers of a problem up to which they are made simple one by one: beyond, a pass takes longer than a minute."""


@dataclass(frozen=True, eq=False)
class ReducedFailure:
    """A reduced failure.

    Attributes
    ----------
    problem : what is left. first, last : trials of the whole problem, and of what is left. tried : candidates solved.
    complete : whether no single step makes it smaller; else the time was over.
    """

    problem: Problem
    source: Problem
    first: CandidateOutcome
    last: CandidateOutcome
    tried: int
    complete: bool


Progress = Callable[[Problem, int], None]
"""Is called with the smallest problem so far and the number of candidates."""


class NoFailure(CpbenchError):
    """A solver that does not fail on the problem as it was given."""


def reduce(problem: Problem, trials: Trials, progress: Progress = lambda problem, tried: None) -> ReducedFailure:
    """Reduce a problem while the failure holds that `trials` look for. Raises NoFailure, NoRoute."""
    first = trials.begin(problem)
    if not first.holds:
        outcome, other = first.outcome, first.other
        solved = "" if other is None else f", {first.name} {other.status}"
        raise NoFailure(
            f"{trials.asked.predicate}: {trials.asked.solver} does not do that here: its status is "
            f"{outcome.status}{solved}"
        )
    steps = _Steps(trials, problem, progress)
    steps.nearer()
    before = ""
    while steps.best.fingerprint != before and not trials.over:
        before = steps.best.fingerprint
        steps.fewer_parts()
        steps.simpler_numbers()
    last = trials.again(steps.best)
    return ReducedFailure(steps.best, problem, first, last, trials.tried, not trials.over)


def data_size(problem: Problem) -> int:
    """Return how many numbers the data have, zeros of matrices left out."""
    stored = (matrices.nnz(v) if v.ndim == 2 else v.size for v in problem.data().values())
    return sum(map(int, stored)) + sum(F.operations + F.constants.size for F in problem.maps().values())


def unknowns(problem: Problem) -> int:
    """Return the number of unknowns."""
    return sum(problem.point_sizes.values())


class _Steps:
    """The smallest problem so far, and the steps that make it smaller."""

    def __init__(self, trials: Trials, problem: Problem, progress: Progress) -> None:
        self.trials, self.best, self._progress = trials, problem, progress
        self._definite = {name for name in numbers.OPERATORS if semidefinite(problem, name)}

    def _accepts(self, make: Callable[[], Problem]) -> bool:
        """Return whether a candidate is a problem that the failure holds for; it is the best then."""
        try:
            candidate = make()
        except CpbenchError:  # it is not a problem of its formulation any more
            return False
        if not unknowns(candidate) or candidate.fingerprint == self.best.fingerprint:
            return False
        if any(not semidefinite(candidate, name) for name in self._definite if hasattr(candidate, name)):
            return False
        if not self.trials.holds(candidate):
            return False
        self.best = candidate
        self._progress(candidate, self.trials.tried)
        return True

    def nearer(self) -> None:
        """Take the solver's own problem in place of the one that is converted to it, where it has fewer numbers."""
        node = solvers.get(self.trials.asked.solver.partition("[")[0]).spec.node
        if node == self.best.node or node in nodes_of_maps() or self.trials.asked.via:
            return
        try:
            there = arrive(self.best, node).problem
        except CpbenchError:
            return
        if data_size(there) <= data_size(self.best):
            self._accepts(lambda: without(there, []))

    def fewer_parts(self) -> None:
        """Leave out parts, of every kind in turn: held at a solution, held at 0, eliminated."""
        for kind in list(kinds(self.best)):
            whole = self.best
            values = self.trials.solution(whole) if not self.trials.over else None
            if values is not None:
                self._minimize(kind, partial(without, values=values))
            self._minimize(kind, without)
            self._minimize(kind, condensed)

    def _minimize(self, kind: str, leave_out: Callable[[Problem, Sequence[RemovablePart]], Problem]) -> None:
        whole, parts = self.best, kinds(self.best).get(kind, [])

        def holds(kept: Sequence[RemovablePart]) -> bool:
            chosen = set(map(id, kept))
            return self._accepts(lambda: leave_out(whole, [part for part in parts if id(part) not in chosen]))

        minimized(parts, holds)

    def _essential(self, entry: numbers.NumberPlaces) -> bool:
        """Return whether an entry is on the diagonal of a semidefinite matrix: 0 there would make a massless body."""
        return entry.field in self._definite and entry.places[0][0] == entry.places[0][-1]

    def simpler_numbers(self) -> None:
        """Round the data together, then set entries to 0, then make the others simple one by one."""
        if numbers.digits(self.best) > max(numbers.DIGITS) and (values := self.trials.solution(self.best)) is not None:
            for count in numbers.DIGITS:
                self._accepts(partial(_not_longer, self.best, partial(numbers.replanted, solution=values, count=count)))
        for change in numbers.wholesale(self.best):
            self._accepts(partial(_not_longer, self.best, change))
        if data_size(self.best) > LARGE:
            return
        whole = self.best
        given = [entry for entry in numbers.entries(whole) if not self._essential(entry)]
        minimized(given, lambda kept: self._accepts(lambda: _zeroed(whole, given, kept)))
        for bound in [e for e in numbers.entries(self.best) if e.field in ("lb", "ub") and math.isfinite(e.value)]:
            self._accepts(partial(_changed, self.best, bound, -np.inf if bound.field == "lb" else np.inf))
        for entry in numbers.entries(self.best):
            for value in numbers.simpler(entry.value):
                if self._accepts(partial(_changed, self.best, entry, value)):
                    break


def _not_longer(problem: Problem, change: Callable[[Problem], Problem]) -> Problem:
    """Return the changed problem, the given one where its numbers would have more digits or be more."""
    changed = change(problem)
    before, after = ((numbers.digits(p), data_size(p)) for p in (problem, changed))
    return problem if after > before else changed


def _zeroed(whole: Problem, given: Sequence[numbers.NumberPlaces], kept: Sequence[numbers.NumberPlaces]) -> Problem:
    left = set(map(id, kept))
    return numbers.changed(whole, {entry: 0.0 for entry in given if id(entry) not in left})


def _changed(problem: Problem, entry: numbers.NumberPlaces, value: float) -> Problem:
    return numbers.changed(problem, {entry: value})


def semidefinite(problem: Problem, name: str) -> bool:
    """Return whether a matrix of the data is positive semidefinite, its symmetric part where it is not symmetric."""
    M: Any = problem.data().get(name)
    if M is None or M.shape[0] != M.shape[1]:
        return False
    return matrices.is_psd(M if matrices.is_symmetric(M) else (M + M.T) / 2)


# ------------------------------------------------------------------------------------------------------- shortest lists

T = TypeVar("T")

FEW = 12
"""Chunks of a size that are tried by themselves, at most."""


def minimized(items: Sequence[T], holds: Callable[[Sequence[T]], bool]) -> list[T]:
    """Return a part of the items for which the predicate holds and fails without any single one of them.

    Short chunks are tried by themselves first, for what is short is solved fast: of one item, of two, of four, a few
    over the whole list. Then chunks are left out, of half of the items at first, of one each at last, until nothing can
    be left out any more. The predicate is not asked about the whole list, for which it has to hold.

    >>> minimized(range(100), lambda some: {17, 42} <= set(some))
    [17, 42]
    """
    kept = _short(list(items), holds)
    size = len(kept)
    while size:
        size = min((size + 1) // 2, len(kept))
        start, shorter = 0, False
        while start < len(kept):
            rest = kept[:start] + kept[start + size :]
            if holds(rest):
                kept, shorter = rest, True
            else:
                start += size
        if size == 1 and not shorter:
            break
    return kept


def _short(items: list[T], holds: Callable[[Sequence[T]], bool]) -> list[T]:
    """Return the first short chunk for which the predicate holds, all items where there is none."""
    size = 1
    while size <= len(items) // 4:
        stride = max(-(-len(items) // FEW), size)
        for start in range(0, len(items), stride):
            chunk = items[start : start + size]
            if holds(chunk):
                return chunk
        size *= 2
    return items
