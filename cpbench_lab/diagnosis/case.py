"""A failure, and what detectors of causes ask of it: computed once, and only when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from cpbench.formulations.base import Problem
from cpbench.solvers.base import Solver, automatic_solver
from cpbench_lab.diagnosis.attempts import SolverTrial, TrialOutcome
from cpbench_lab.facts import Fact, of_problem

TIGHT = 1e-2
"""A known solution is sought to this share of the tolerance, but to no more digits than doubles have."""
FINEST = 1e-10


@dataclass(frozen=True, eq=False)
class FailedTrial:
    """A trial that failed. `attempt` : solves, here or in another process."""

    trial: SolverTrial
    failed: TrialOutcome
    attempt: Callable[[SolverTrial], TrialOutcome]

    @property
    def problem(self) -> Problem:
        """The problem that was asked."""
        return self.trial.problem

    @cached_property
    def solver(self) -> Solver:
        """The solver that failed."""
        return self.trial.named[0]

    @cached_property
    def source_facts(self) -> tuple[Fact, ...]:
        """Facts of the problem that was asked."""
        return of_problem(self.problem)

    @cached_property
    def known(self) -> Any:
        """A verified answer to the problem that was asked, by the automatic choice; None without one."""
        name = automatic_solver(self.problem.node)
        if name is None:
            return None
        for tolerance in (max(TIGHT * self.trial.tolerance, FINEST), self.trial.tolerance):
            trial = SolverTrial(problem=self.problem, solver=name, tolerance=tolerance, seconds=self.trial.seconds)
            found = self.attempt(trial)
            if found.solved and found.answer is not None:
                return found.answer
        return None


@dataclass(frozen=True, eq=False, kw_only=True)
class Remedy:
    """Trial of what may be done about a cause. `back` : carries its answer to the problem that was asked."""

    text: str
    trial: SolverTrial
    back: Callable[[Any], Any] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Cause:
    """A cause of a failure.

    Attributes
    ----------
    kind : its name. evidence : a sentence with the numbers. numbers : these, by name.
    proved : the evidence alone decides. without : the nearest trial that does not have the cause, which the same
    solver should solve; `change` says what differs. remedies : what to do about it, the best first.
    """

    kind: str
    evidence: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    proved: bool = False
    without: SolverTrial | None = None
    change: str = ""
    remedies: tuple[Remedy, ...] = ()
