"""Candidates put to the test: each a file, solved in the processes of a run and judged, and none of them twice."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Any, Self

from cpbench import storage
from cpbench.bench.planning import plan
from cpbench.bench.planning.plan import nearest_automatic
from cpbench.bench.results.rows import Outcome, unpack_answer
from cpbench.bench.slot import Slot
from cpbench.bench.worker_pool import Setting
from cpbench.errors import NoRoute, PointError
from cpbench.formulations.base import Problem
from cpbench.foundation.locks import RUN, TemporaryHome
from cpbench.verification import MET_TOLERANCE
from cpbench_lab.reduction.predicate import Predicate

OTHERS = 4
"""Solvers that are asked, at most, whether a problem has a solution."""


@dataclass(frozen=True)
class Asked:
    """The failure that is looked at: by which solver, how it is reached, what its answers are asked for.

    Attributes
    ----------
    solver : a name with options. predicate : the failure. tolerance : of the verdict. limits : of a solve.
    via : conversions that are pinned.
    """

    solver: str
    predicate: Predicate
    tolerance: float = 1e-6
    limits: plan.Limits = field(default_factory=lambda: plan.Limits(seconds=2.0, repeats=1))
    via: tuple[str, ...] = ()


@dataclass(frozen=True)
class CandidateOutcome:
    """The outcome of a candidate.

    Attributes
    ----------
    holds : whether the solver fails. outcome : of the solver. other : of the solver beside it, None where none was
    asked. name : of that solver.
    """

    holds: bool
    outcome: Outcome
    other: Outcome | None = None
    name: str = ""


class Trials:
    """Solves of candidates on one slot, until a time is over. Use as a context manager.

    Parameters
    ----------
    asked : the failure. end : on the clock of `time.monotonic`.
    """

    def __init__(self, asked: Asked, end: float) -> None:
        self.asked, self.end = asked, end
        self.tried = 0
        self.solvable = asked.predicate.needs_other
        self._known: dict[str, bool] = {}
        self._beside_by_node: dict[str, str] = {}
        self._pairs: dict[tuple[str, str], plan.Pair] = {}
        self._scratch = TemporaryHome(RUN)
        self._slot = Slot(Setting(asked.limits.threads, asked.limits.memory))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        self._slot.close()
        self._scratch.remove()

    @property
    def over(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() > self.end

    def begin(self, problem: Problem) -> CandidateOutcome:
        """Try the problem as it was given: whether the solver fails, and whether another one solves it, which every
        candidate has to allow from then on. Raises NoRoute."""
        trial = self._tried(problem, ask_other=True)
        self.solvable = self.solvable or (trial.other is not None and trial.other.status in MET_TOLERANCE)
        if trial.holds:
            self._known[problem.fingerprint] = True
        return trial

    def holds(self, problem: Problem) -> bool:
        """Return whether the failure is there on a candidate; False once the time is over."""
        known = self._known.get(problem.fingerprint)
        if known is not None:
            return known
        if self.over:
            return False
        result = self._known[problem.fingerprint] = self._tried(problem).holds
        return result

    def solution(self, problem: Problem) -> Any:
        """Return the other solver's verified answer to the problem, None where there is none."""
        if not self.solvable:
            return None
        _, outcome = self._beside(problem)
        return point_of(problem, outcome) if outcome is not None and outcome.status in MET_TOLERANCE else None

    def again(self, problem: Problem) -> CandidateOutcome:
        """Try a problem once more, whatever is remembered of it."""
        return self._tried(problem, ask_other=True)

    def _tried(self, problem: Problem, ask_other: bool = False) -> CandidateOutcome:
        self.tried += 1
        predicate, outcome = self.asked.predicate, self.solve(problem, self.asked.solver)
        fails = predicate.fails(outcome)
        if not (ask_other or (fails and self.solvable)):
            return CandidateOutcome(fails, outcome)
        name, other = self._beside(problem)
        if self.solvable:
            fails = other is not None and predicate.holds(outcome, other)
        return CandidateOutcome(fails, outcome, other, name)

    def _beside(self, problem: Problem) -> tuple[str, Outcome | None]:
        """Solve a problem by the solver that was named, or by the first of ours that solves it: the nearest automatic
        choices, then others of the formulation. What solved a problem is asked for all others of its formulation."""
        named = self.asked.predicate.other
        if named:
            return named, self.solve(problem, named)
        failing, result = plan.parse_entry(self.asked.solver).solver, ("", None)
        known = self._beside_by_node.get(problem.node)
        for name in [known] if known else [n for n in nearest_automatic(problem.node) if n != failing][:OTHERS]:
            try:
                result = name, self.solve(problem, name)
            except NoRoute:
                continue
            if result[1].status in MET_TOLERANCE:
                self._beside_by_node[problem.node] = name
                break
        return result

    def solve(self, problem: Problem, solver: str) -> Outcome:
        """Solve a problem by a solver with its options; raises NoRoute where this formulation does not reach it."""
        path = self._scratch.folder / f"candidate-{problem.fingerprint}.h5"
        if not path.exists():
            for old in self._scratch.folder.glob("candidate-*.h5"):
                old.unlink()
            storage.save(problem, path)
        pair = self._pair(problem, solver, str(path))
        return self._slot.run(pair, self._slot.prepare(pair))

    def _pair(self, problem: Problem, solver: str, address: str) -> plan.Pair:
        known = self._pairs.get((problem.node, solver))
        if known is None:
            known = self._pairs[problem.node, solver] = self._planned(solver, address)
        return replace(known, address=address, fingerprint=problem.fingerprint, sizes=problem.sizes())

    def _planned(self, solver: str, address: str) -> plan.Pair:
        asked, entry = self.asked, plan.parse_entry(solver)
        failing = solver == asked.solver
        requests = [plan.pinned(asked.via) if asked.via and failing else plan.exact()]
        survey = self._slot.survey(address, requests)
        found = plan.pairs([survey], [entry], requests, asked.tolerance, asked.limits, relaxations=failing)
        if not found:
            raise NoRoute(f"no route from {survey.node} to {solver}; see: cpbench graph FILE --explain")
        return found[0]


def point_of(problem: Problem, outcome: Outcome) -> Any:
    """Return the answer of an outcome as a point of the problem; None where there is none."""
    try:
        return None if outcome.answer is None else problem.point_from_vector(unpack_answer(outcome.answer))
    except PointError:
        return None
