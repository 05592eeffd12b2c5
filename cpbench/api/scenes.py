"""Scenes simulated by a solver of a user's choice, and their contact problems as one file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from cpbench import graph
from cpbench.api.solution import Solution
from cpbench.api.solving import solve_there, way_to
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Contacts
from cpbench.formulations.transfer import transfer
from cpbench.generators.scenes import stepper
from cpbench.solvers import warming
from cpbench.solvers.base import Trait

LOCAL = {"gfc": "fc", "grfc": "rfc"}
"""The formulation of the local twin of a problem in global form."""
SECONDS = 60.0
"""Time limit of one step [s]."""


@dataclass(frozen=True, eq=False)
class SolvedStep:
    """A step of a scene, and what its answer is worth; None where nothing touched."""

    step: stepper.Step
    solution: Solution | None


class NotSolved(CpbenchError):
    """A solver gave no answer to a step, so that the bodies cannot move on."""


@dataclass
class ContactSolver:
    """A solver with its answers so far: each step begins with the reactions of the step before."""

    name: str | None
    tolerance: float
    solutions: list[Solution] = field(default_factory=list)
    _last: tuple[Contacts, Any] | None = None
    _warm: bool = False

    def __call__(self, problem: stepper.ContactProblem) -> Any:
        """Return an answer in global form; raises NotSolved, NoRoute, UnknownName, NotApplicable, Unavailable."""
        way = way_to(problem, self.name)
        if not self._warm:
            warming.warm_up_quickly(way.solver)
            self._warm = True
        start = None
        if self._last is not None and Trait.WARM_START in way.solver.spec.traits:
            contacts, point = self._last
            before = graph.push(way.problem, point, way.steps) if False else point
            start = transfer(contacts, before, problem).point
            start = graph.push(way.problem, start, way.steps) if way.steps else start
        solution, _ = solve_there(problem, way, self.tolerance, SECONDS, start)
        if solution.point is None or not solution.point.finite:
            place = problem.sequence.step if problem.sequence else 0
            raise NotSolved(f"step {place}: {way.name} gave no answer ({solution.status}) {solution.message}".rstrip())
        self._last = problem.contacts, solution.point
        self.solutions.append(solution)
        return solution.point
