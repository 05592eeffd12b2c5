"""Automatic choice: solvers of one formulation in turns whose lengths double, in an order that facts decide.

With k members in play the work is at most about 2k times that of the best one, whatever the problem: where that needs
the work w, each other one has had at most 2w (twice that where it cannot go on from its last point). Usually the first
member is done in its first turn. Work is counted in iterations, not timed: a busy machine takes the same way.
Restarts of this kind: Luby, Sinclair and Zuckerman 1993, Inf. Process. Lett. 47:173.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
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

NEARER = 0.1
"""A member goes on from where it was, unless another one has come to this share of its error (docs/decisions/0287)."""
FINER = 0.1
"""Share of the tolerance that is asked for on a problem of another formulation, whose measure is another one."""
FIRST_TURN = {
    **dict.fromkeys(("semismooth Newton", "Newton with pivoting"), 50),
    **dict.fromkeys(("projection", "operator splitting"), 1_000),
    **{"Josephy-Newton": 10, "splitting": 2_000, "enumeration": 4_000},
}
"""Iterations in the first turn by kind of method, about equal in work, enough for most. Others end by themselves."""


class Neighbour(NamedTuple):
    """The same problem in another formulation. `lift` brings a point of it back, `push` brings one there."""

    problem: Problem
    lift: Callable[[Any], Any]
    push: Callable[[Any], Any]


@dataclass(frozen=True)
class SolverPhase:
    """A member. `solver` : a registered one. `iterations` : in its first turn, None for those of its kind. `options` :
    those that differ from its own. `via` : the way to its formulation, where that is another one."""

    solver: str
    iterations: int | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    via: Callable[[Any], Neighbour] | None = None

    @property
    def turn(self) -> int | None:
        """Iterations in its first turn, None where it goes on to its own end."""
        return self.iterations or FIRST_TURN.get(solvers.get(self.solver).spec.method)


class Plan(NamedTuple):
    """Prepared problem. `first` : what the first solver's own `setup` has made of it, None where it does not take it.
    `options` : of that solver. `solver` : that one, where it may go on to its own end before others are prepared."""

    problem: Problem
    phases: tuple[SolverPhase, ...]
    first: Any | None = None
    options: Any = None
    solver: Solver | None = None


class AutomaticChoice(Solver):
    """Base of a choice that ends with the first solver that solves the problem, or certifies that nothing does; the
    message tells of all. A start that is a solution already is the answer."""

    members: ClassVar[tuple[str, ...]]
    """Every solver that `phases` may name."""
    worth: ClassVar[float] = 1.0
    """Error below which an answer is a start for the next solver: a scaled one is about 1 at zero."""

    def error(self, problem: Any, point: Any, tolerance: float) -> float:
        """Return the error of an answer of which no member of our own says that it is solved."""
        return problem.residuals(point, tolerance).error

    def phases(self, problem: Any) -> Sequence[SolverPhase]:
        """Return the members in play in their order, from facts that cost less than solving; pure. Here: all."""
        return [SolverPhase(name) for name in self.members]

    def setup(self, problem: Any, budget: Budget, options: Any) -> Plan:
        phases = tuple(self.phases(problem))
        solver, own = ready(phases[0])
        if not any(problem.point_sizes.values()) or phases[0].via or solver.obstacle(problem) is not None:
            return Plan(problem, phases)
        first = solver.setup(solver.hand_over(problem), budget, own)
        return Plan(problem, phases, first, own, solver if phases[0].turn is None else None)

    def solve(
        self, prepared: Plan, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        deadline, solver, output = budget.deadline(), prepared.solver, None
        # most problems end with the first solver, many in less time than it takes to prepare for more
        if solver is not None and start is None and record is None and budget.seconds > 0 and budget.iterations != 0:
            output = solver.collect(solver.solve(prepared.first, budget, prepared.options))
            if output.claim is Claim.SOLVED and output.point is not None:
                counters = {"iterations": 0, **output.counters, "solvers": output.counters.get("solvers", 0) + 1}
                return solved(output.point, counters, f"{prepared.phases[0].solver}: solved")
        run = _Run(self, prepared, budget, start, record, deadline)
        if output is not None:
            run.take(run.seats.pop(0), output)
        return run.concluded()


def ready(phase: SolverPhase) -> tuple[Solver, Any]:
    """Return the solver of a phase and its options."""
    solver = solvers.get(phase.solver)
    return solver, solver.spec.options(**phase.options) if phase.options else _default(solver.spec.options)


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


class _Seat:
    """A member in play: what its `setup` has made of the problem, the most iterations of its next turn, and where it
    was at the end of its last one, with the least error that it came to."""

    def __init__(self, phase: SolverPhase, problem: Problem) -> None:
        self.phase, self.solver, self.turn, self._problem = phase, solvers.get(phase.solver), phase.turn, problem
        self.prepared = self.options = self.point = None
        self.level = math.inf

    @cached_property
    def neighbour(self) -> Neighbour:
        """The problem that the solver is asked, made once its turn comes."""
        return self.phase.via(self._problem) if self.phase.via else Neighbour(self._problem, _same, _same)

    def run(self, budget: Budget, start: Any, record: Record | None) -> SolverOutput:
        """Run the solver on its own problem; its answer is one of ours."""
        solver, (problem, lift, push) = self.solver, self.neighbour
        if lift is not _same:
            budget = replace(budget, tolerance=FINER * budget.tolerance)
        if self.prepared is None:
            deadline, self.options = budget.deadline(), ready(self.phase)[1]
            self.prepared = solver.setup(solver.hand_over(problem), budget, self.options)
            budget = budget if math.isinf(budget.seconds) else budget.left(deadline)
        passing = None if record is None else lambda done, error, point: record(done, error, lambda: lift(point()))
        begin = None if start is None else push(start)
        output = solver.collect(solver.solve(self.prepared, budget, self.options, begin, passing))
        return output if output.point is None or lift is _same else replace(output, point=lift(output.point))


def _same(point: Any) -> Any:
    return point


class _Run:
    """State of the turns."""

    def __init__(
        self, choice: AutomaticChoice, plan: Plan, budget: Budget, start: Any, record: Record | None, deadline: float
    ) -> None:
        problem, self._error_of, self._worth = plan.problem, choice.error, choice.worth
        self._problem, self._budget, self._record = problem, budget, record
        if start is None and not any(problem.point_sizes.values()):
            start = problem.zero_point()  # nothing is to be found, which some solvers do not take
        self._deadline = deadline
        self._best, self._error = start, math.inf if start is None else self._measured(start)
        self._iterations, self._recorded = 0, -1
        self._messages: dict[str, str] = {}
        self._counters: dict[str, int] = {"iterations": 0, "solvers": 0}
        self._ended: SolverOutput | None = None
        self._last = Claim.FAILED
        self.seats = [_Seat(phase, problem) for phase in plan.phases]
        self.seats[0].prepared, self.seats[0].options = plan.first, plan.options
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

    def _ask(self, seat: _Seat) -> bool:
        """Give a member its turn; return whether it may have another one."""
        if seat.prepared is None and (why := seat.solver.obstacle(seat.neighbour.problem)) is not None:
            self._messages[seat.phase.solver] = f"{seat.phase.solver}: {why}"
            return False
        start = None
        if Trait.WARM_START in seat.solver.spec.traits:
            near = self._error < self._worth and (seat.point is None or self._error <= NEARER * seat.level)
            start = self._best if near else seat.point
        share = self._share(seat)
        output = seat.run(share, start, self._recorder())
        self.take(seat, output)
        seat.turn = seat.turn and 2 * seat.turn
        return output.claim is Claim.MAX_ITER and output.counters.get("iterations", 0) >= (share.iterations or math.inf)

    def take(self, seat: _Seat, output: SolverOutput) -> None:
        """Take what a turn came to."""
        name, solver = seat.phase.solver, seat.solver
        self._count(name, output)
        if solver.origin != "native" or (seat.phase.via and output.certificate is None):
            self._keep(seat, output)  # what others claim, or what is claimed of another problem, is measured
        elif output.claim is Claim.SOLVED and output.point is not None:
            self._messages[name] = f"{name}: solved"
            self._end(output, recorded=Trait.HISTORY in solver.spec.traits)
        elif output.certificate is not None:
            self._messages[name] = f"{name}: {output.claim}, with a certificate"
            # of the problem that the member was asked; the claim is true of both
            self._ended = output if seat.phase.via is None else replace(output, certificate=None)
        else:
            self._keep(seat, output)

    def concluded(self) -> SolverOutput:
        """Take turns; return the answer that solves it, the certificate that none does, or the best that was found."""
        while self.seats and not self.over:
            self.seats = [seat for seat in self.seats if not self.over and self._ask(seat)]
        message = "; ".join(self._messages.values())
        if (ended := self._ended) is not None:  # by one of several, whose time is not that of all
            return replace(ended, counters=self._counters, message=message or ended.message, reported=None)
        best = f"; best error {self._error:.1e}" if math.isfinite(self._error) else ""
        message = f"{message or 'no solver was asked within the limits'}{best}"
        return SolverOutput(claim=self._last, point=self._best, counters=self._counters, message=message)

    def _share(self, seat: _Seat) -> Budget:
        budget, most = self._budget, seat.turn
        if budget.iterations is not None:
            left = budget.iterations - self._iterations
            most = left if most is None else min(most, left)
        return replace(budget if math.isinf(budget.seconds) else budget.left(self._deadline), iterations=most)

    def _count(self, name: str, output: SolverOutput) -> None:
        self._iterations += max(output.counters.get("iterations", 1), 1)
        self._counters["solvers"] += name not in self._messages
        for key, value in output.counters.items():
            self._counters[key] = self._counters.get(key, 0) + value

    def _keep(self, seat: _Seat, output: SolverOutput) -> None:
        self._last = output.claim if output.claim is not Claim.SOLVED else Claim.FAILED
        error = math.inf if output.point is None else self._measured(output.point)
        self._messages[seat.phase.solver] = f"{seat.phase.solver}: {output.message or output.claim}"
        seat.point, seat.level = output.point, min(seat.level, error)
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
