"""The solve of one problem of a file as `cpbench.solve` does it, in a process of its own with limits.

What the solver loads before its first solve is not in the time of the solve, nor in its memory.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cpbench import graph, storage
from cpbench.analysis.contact_freedom import least_forces
from cpbench.api.problems import verify
from cpbench.api.solution import Solution
from cpbench.api.solving import JUDGE, RoutedSolver, route_to_solver, solve_there
from cpbench.bench import starts
from cpbench.bench.planning import plan
from cpbench.bench.planning.places import located
from cpbench.bench.processes.alone import FIRST, SOLVE, WARMING, Stopped, Work, run_alone
from cpbench.bench.results.rows import Outcome
from cpbench.bench.time_limits import GRACE, REFEREE, START, WARM_UP
from cpbench.cli.answered import Answered
from cpbench.conversions.base import Conversion
from cpbench.errors import CpbenchError, NoRoute, NotApplicable, Unavailable
from cpbench.formulations.base import Kind, Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation.extensions import hook
from cpbench.generators.collection import builtin_folder
from cpbench.solvers.base import Trait
from cpbench.solvers.external import folder
from cpbench.storage.base import require_new
from cpbench.verification import Status


@dataclass(frozen=True)
class SolveRequest:
    """Arguments of `cpbench solve`.

    Attributes
    ----------
    address : of the problem. solver : a name with options, or auto. every : whether all solutions are asked for.
    via : conversions to go through. routes : exact, or all. start : where the solver begins.
    tolerance : the largest error of an answer that counts as solved. limits : of the solve.
    output, force : the file for the answer, and whether it may be there. verbose : whether all lines are shown.
    """

    address: str
    solver: str
    every: bool
    via: tuple[str, ...]
    routes: str
    start: str
    tolerance: float
    limits: plan.Limits
    format: str | None
    output: Path | None
    force: bool
    verbose: bool


def reply(request: SolveRequest, answered: Answered) -> dict[str, Any]:
    """Write the answer where that is asked for; return what is to be printed of it, and whether it is `good`."""
    written = request.output is not None and answered.point is not None
    if request.output is not None and written:
        answered.save(request.output, force=request.force)
    lines = list(answered.lines(verbose=request.verbose))
    return {"lines": lines, "record": answered.record(), "good": bool(answered), "written": written}


def solve_alone(request: SolveRequest) -> dict[str, Any]:
    """Solve as asked, or list all solutions; return what `reply` does.

    Raises CpbenchError where there is nothing to solve.
    """
    seconds, identity = request.limits.seconds, {"problem": "", "node": "?", "solver": request.solver}
    around = REFEREE.limit(seconds)
    limits = {
        FIRST: START.limit(seconds) + around,
        WARMING: WARM_UP.limit(seconds),
        JUDGE: around,
        SOLVE: seconds + GRACE,
    }

    try:
        outcome = run_alone(lambda work: _safely(request, work), limits, request.limits.memory, identity.update)
    except Stopped as stopped:
        outcome = _stopped(stopped, seconds, limits)
    finally:
        folder.remove_abandoned()  # files that it had written for a program of its own
    if "refused" in outcome:
        raise CpbenchError(outcome["refused"])
    if "status" not in outcome:
        return outcome
    named = request.address, identity["problem"], identity["node"], identity["solver"], request.tolerance
    return reply(request, Answered(*named, Outcome(**outcome)))


def _stopped(stopped: Stopped, seconds: float, limits: Mapping[str, float]) -> dict[str, Any]:
    """Return status and message of a process that gave no answer."""
    if stopped.code is not None:
        cause = f"killed by signal {-stopped.code}" if stopped.code < 0 else f"exited with code {stopped.code}"
        return {"status": "crash", "message": f"{stopped.phase}: {cause}"}
    if stopped.phase == SOLVE:
        return {"status": "timeout", "message": f"killed after {seconds:g} s", "solve": seconds}
    return {"status": "error", "message": f"{stopped.phase}: not over after {limits[stopped.phase]:g} s"}


def _safely(request: SolveRequest, work: Work) -> dict[str, Any]:
    """Return the reply, or why there is none."""
    try:
        if request.output is not None:
            require_new(request.output, request.force)
        if not request.every:
            answered = _answered(request, work)
            work.begin(JUDGE)
            return reply(request, answered)
        if request.output is not None:
            hook("require_rows")(request.output)
        work.begin(JUDGE)
        listed: dict[str, Any] = hook("reply_to")(
            located(request.address, builtin_folder), request.format, request.output, request.force
        )
        return listed
    except CpbenchError as refusal:
        return {"refused": str(refusal)}
    except MemoryError:
        return {"status": str(Status.MEMOUT), "message": f"{work.phase}: ran out of memory"}
    except Exception as error:
        return {"status": str(Status.ERROR), "message": f"{work.phase}: {type(error).__name__}: {error}"}


def _answered(request: SolveRequest, work: Work) -> Answered:
    """Return what became of the solve, whatever that is; raises CpbenchError where there is nothing to solve."""
    begun = time.perf_counter()
    address, outcome = located(request.address, builtin_folder), Outcome()
    policy = starts.one_start(request.start)
    problem = storage.load(address, format=request.format)
    outcome = replace(outcome, load=time.perf_counter() - begun)
    work.say(problem=problem.name, node=problem.node)
    label = request.solver
    try:
        routed = _routed(problem, request)
        label = routed.name
        work.say(solver=label)
        outcome = replace(outcome, route=routed.label, kind=str(routed.kind), convert=routed.seconds)
        outcome = replace(outcome, target_tolerance=graph.tolerance(routed.problem, request.tolerance, routed.steps))
        point = None
        if policy.warm:
            point, started = _start(policy, problem, routed, address, request.tolerance)
            outcome = replace(outcome, started=started)
        work.begin(WARMING)
        routed.solver.warmup()
        solution, target_error = solve_there(
            problem, routed, request.tolerance, request.limits.seconds, point, on_phase=work.begin
        )
    except (NotApplicable, Unavailable) as refusal:
        status = Status.UNSUPPORTED if isinstance(refusal, NotApplicable) else Status.UNAVAILABLE
        refused = replace(outcome, status=str(status), message=str(refusal))
        return Answered(request.address, problem.name, problem.node, label, request.tolerance, refused)
    return _of(request.address, solution, target_error, outcome)


def _routed(problem: Problem, request: SolveRequest) -> RoutedSolver:
    """Bring the problem to the solver: by exact conversions, and where these do not lead there by all of them if that
    is asked for."""
    via: tuple[Conversion, ...] = ()
    if request.via:
        via = plan.parse_request(plan.pinned(request.via))[1]
    try:
        return route_to_solver(problem, request.solver, via)
    except NoRoute:
        if request.routes != "all":
            raise
    return route_to_solver(problem, request.solver, via, frozenset(Kind))


def _start(
    policy: starts.StartPolicy, problem: Problem, routed: RoutedSolver, address: str, tolerance: float
) -> tuple[Any, str]:
    """Return the starting point on the solver's own problem, and its description; raises NotApplicable."""
    if Trait.WARM_START not in routed.solver.spec.traits:
        raise NotApplicable(routed.name, "takes no starting point, and a cold start is not what was asked for")
    begin = starts.start(policy, problem, address, routed.problem, routed.steps)
    return begin.point, begin.description


def _of(address: str, solution: Solution, target_error: float, known: Outcome) -> Answered:
    """Return a solution as the outcome of a solve, with `target_error`, its error on the solver's own problem; where
    forces are not unique with those of least norm, if these pass, too."""
    if solution and isinstance(solution.problem, ContactProblem):
        least = least_forces(solution.problem, solution.point, solution.tolerance)
        if least is not None and (verdict := verify(solution.problem, least, tolerance=solution.tolerance)).solved:
            solution = replace(solution, point=least, verdict=verdict)
    problem, verdict, spent = solution.problem, solution.verdict, solution.seconds
    outcome = replace(
        known,
        status=str(solution.status),
        claim=solution.claim or None,
        error=verdict.error,
        target_error=target_error,
        flags=",".join(verdict.flags),
        message=solution.message,
        parts=json.dumps({**verdict.judged, **verdict.parts}),
        counters=json.dumps(dict(solution.counters)),
        **{name: spent[name] for name in ("setup", "solve", "lift", "verify") if name in spent},
    )
    identity = address, problem.name, problem.node, solution.solver, solution.tolerance
    return Answered(*identity, outcome, problem, solution.point)
