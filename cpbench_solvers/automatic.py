"""Automatic choice: solvers of one node asked in an order that facts of the problem decide, until one solves it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, ClassVar, NamedTuple

from cpbench.formulations.base import Problem
from cpbench.solvers.base import (
    Budget,
    Claim,
    NoOptions,
    Record,
    Solver,
    SolverOutput,
    SolverSpec,
    Trait,
    solved,
    solvers,
)
from cpbench_solvers.traits import ITERATIVE

WORTH = 1.0
"""A scaled error is about 1 at zero: an answer beyond that is not a start for the next solver."""


@dataclass(frozen=True)
class SolverPhase:
    """One phase of the automatic choice. `solver` : a registered one of the node. `iterations` : the most that it
    may make, None for its own limit. `options` : those that differ from its own."""

    solver: str
    iterations: int | None = None
    options: Mapping[str, Any] = field(default_factory=dict)


class Plan(NamedTuple):
    """Prepared problem of the automatic choice. `first` : what the first solver's own `setup` has made of the
    problem, None where it does not take it; it has its `options`. `solver` : the first one, where it may go on to its
    own limit before anything else is prepared."""

    problem: Problem
    phases: tuple[SolverPhase, ...]
    first: Any | None = None
    options: Any = None
    solver: Solver | None = None


class AutomaticChoice(Solver):
    """Base of a choice that ends with the first solver that solves the problem, or certifies that nothing does; the
    message tells of all.

    A start that is a solution already is the answer. The next solver starts from the best answer so far, where it
    takes a start and the answer is better than nothing.
    """

    members: ClassVar[tuple[str, ...]]
    """Every solver that `phases` may name."""

    def error(self, problem: Any, point: Any, tolerance: float) -> float:
        """Return the error of an answer of which no member of our own says that it is solved."""
        return problem.residuals(point, tolerance).error

    def phases(self, problem: Any) -> Sequence[SolverPhase]:
        """Return the solvers to try, in this order, from facts that cost less than solving; pure. Here: all members."""
        return [SolverPhase(name) for name in self.members]

    def setup(self, problem: Any, budget: Budget, options: Any) -> Plan:
        phases = tuple(self.phases(problem))
        solver = solvers.get(phases[0].solver)
        if not any(problem.point_sizes.values()) or solver.obstacle(problem) is not None:
            return Plan(problem, phases)
        given = phases[0].options
        own = solver.spec.options(**given) if given else _default(solver.spec.options)
        first = solver.setup(solver.hand_over(problem), budget, own)
        return Plan(problem, phases, first, own, solver if phases[0].iterations is None else None)

    def solve(
        self, prepared: Plan, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        deadline, phases, solver = budget.deadline(), prepared.phases, prepared.solver
        # most problems end with the first solver, many in less time than it takes to prepare for more
        if solver is not None and start is None and record is None and budget.seconds > 0 and budget.iterations != 0:
            output = solver.collect(solver.solve(prepared.first, budget, prepared.options))
            if output.claim is Claim.SOLVED and output.point is not None:
                counters = output.counters
                counters = {"iterations": 0, **counters, "solvers": counters.get("solvers", 0) + 1}
                return solved(output.point, counters, f"{phases[0].solver}: solved")
            run = _Run(prepared, self.error, budget, start, record, deadline)
            run.take(phases[0], solver, output)
            phases = phases[1:]
        else:
            run = _Run(prepared, self.error, budget, start, record, deadline)
        for phase in phases:
            if run.over:
                break
            run.ask(phase)
        return run.concluded()


@cache
def _default(options: type) -> Any:
    return options()


def automatic_spec(node: str, name: str, summary: str) -> SolverSpec:
    """Return the spec of a node's automatic choice."""
    return SolverSpec(
        name=name, node=node, summary=summary, method="automatic choice", traits=ITERATIVE, options=NoOptions
    )


class LastNumber:
    """A record that knows the number of the last iterate, -1 before the first."""

    def __init__(self, record: Record) -> None:
        self._record, self.number = record, -1

    def __call__(self, number: int, error: float, point: Callable[[], Any]) -> None:
        self._record(number, error, point)
        self.number = number


class _Run:
    """State of the phases."""

    def __init__(
        self,
        plan: Plan,
        error: Callable[[Any, Any, float], float],
        budget: Budget,
        start: Any | None,
        record: Record | None,
        deadline: float,
    ) -> None:
        problem, self._error_of = plan.problem, error
        self._plan, self._problem, self._budget, self._record = plan, problem, budget, record
        if start is None and not any(problem.point_sizes.values()):
            start = problem.zero_point()  # nothing is to be found, which some solvers do not take
        self._deadline = deadline
        self._best, self._error = start, math.inf if start is None else self._measured(start)
        self._iterations, self._recorded = 0, -1
        self._messages: list[str] = []
        self._counters: dict[str, int] = {"iterations": 0, "solvers": 0}
        self._ended: SolverOutput | None = None
        self._last = Claim.FAILED
        if self._error <= budget.tolerance:
            if record is not None:
                record(0, self._error, lambda: start)
            self._ended = SolverOutput(claim=Claim.SOLVED, point=start, message="the start is a solution")

    @property
    def over(self) -> bool:
        """Whether there is nothing left to find, or to find it with."""
        budget = self._budget
        spent = budget.iterations is not None and self._iterations >= budget.iterations
        return self._ended is not None or spent or time.perf_counter() > self._deadline

    def ask(self, phase: SolverPhase) -> None:
        """Run one solver, as far as its phase and the budget allow."""
        # `setup` has warmed up the first
        solver = solvers.get(phase.solver)
        share = self._share(phase)
        takes = self._error < WORTH and Trait.WARM_START in solver.spec.traits
        start, record = self._best if takes else None, self._recorder()
        if phase is self._plan.phases[0] and self._plan.first is not None:
            output = solver.collect(solver.solve(self._plan.first, share, self._plan.options, start, record))
        elif (why := solver.obstacle(self._problem)) is None:
            output = solver.run(self._problem, share, solver.spec.options(**phase.options), start, record)
        else:
            self._messages.append(f"{phase.solver}: {why}")
            return
        self.take(phase, solver, output)

    def take(self, phase: SolverPhase, solver: Solver, output: SolverOutput) -> None:
        """Take what a solver came to."""
        self._count(output)
        if solver.origin != "native":  # what others claim is measured
            self._keep(phase.solver, output)
        elif output.claim is Claim.SOLVED and output.point is not None:
            self._messages.append(f"{phase.solver}: solved")
            self._end(output, recorded=Trait.HISTORY in solver.spec.traits)
        elif output.certificate is not None:
            self._messages.append(f"{phase.solver}: {output.claim}, with a certificate")
            self._ended = output
        else:
            self._keep(phase.solver, output)

    def concluded(self) -> SolverOutput:
        """Return the answer that solves it, the certificate that none does, or the best that was found."""
        if self._ended is not None:
            message = "; ".join(self._messages) or self._ended.message
            return replace(self._ended, counters=self._counters, message=message, reported=None)  # by one of several
        best = [f"best error {self._error:.1e}"] if math.isfinite(self._error) else []
        messages = "; ".join([*self._messages, *best]) or "no solver was asked within the limits"
        return SolverOutput(claim=self._last, point=self._best, counters=self._counters, message=messages)

    def _share(self, phase: SolverPhase) -> Budget:
        budget, most = self._budget, phase.iterations
        if budget.iterations is not None:
            left = budget.iterations - self._iterations
            most = left if most is None else min(most, left)
        if most == budget.iterations and math.isinf(budget.seconds):
            return budget
        return replace(budget.left(self._deadline), iterations=most)

    def _count(self, output: SolverOutput) -> None:
        self._iterations += max(output.counters.get("iterations", 1), 1)
        self._counters["solvers"] += 1
        for name, value in output.counters.items():
            self._counters[name] = self._counters.get(name, 0) + value

    def _keep(self, name: str, output: SolverOutput) -> None:
        self._last = output.claim if output.claim is not Claim.SOLVED else Claim.FAILED
        error = math.inf if output.point is None else self._measured(output.point)
        self._messages.append(f"{name}: {output.message or output.claim}")
        if error <= self._budget.tolerance:
            self._end(replace(output, claim=Claim.SOLVED), recorded=False)
        elif error < self._error:
            self._best, self._error = output.point, error

    def _end(self, output: SolverOutput, *, recorded: bool) -> None:
        self._ended = output
        if self._record is not None and not recorded:
            if self._recorded < 0:
                self._record(0, math.nan, self._problem.zero_point)
            self._record(max(self._recorded, 0) + 1, self._measured(output.point), lambda: output.point)

    def _recorder(self) -> Record | None:
        """Pass iterates on with numbers that go on rising from solver to solver; a start is passed on once."""
        record, base = self._record, max(self._recorded, 0)
        if record is None:
            return None

        def passing(iteration: int, error: float, point: Callable[[], Any]) -> None:
            if base + iteration > self._recorded:
                self._recorded = base + iteration
                record(self._recorded, error, point)

        return passing

    def _measured(self, point: Any) -> float:
        return self._error_of(self._problem, point, self._budget.tolerance)
