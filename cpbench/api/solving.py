"""Solving one problem in this process: find a solver and a route, warm up, solve, carry the answer back, judge it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from cpbench import graph, proofs, verification
from cpbench.api.solution import Solution
from cpbench.bench.judging import PROOF_SECONDS, judge_answer, look_for_proof
from cpbench.bench.planning.plan import AUTO, nearest_automatic
from cpbench.conversions.base import Conversion
from cpbench.errors import Ended, NoRoute, NotApplicable, ProblemError, Unavailable, described
from cpbench.formulations.base import Kind, Problem
from cpbench.formulations.programs import NLP
from cpbench.foundation.child_processes import blas_threads
from cpbench.foundation.text import read_brackets
from cpbench.graph import EXACT
from cpbench.solvers.base import Budget, Solver, missing, parse_options, solvers, warm_up
from cpbench.solvers.stopping import second_tolerance
from cpbench.verification import FALSE_CLAIMS, MET_TOLERANCE, PROVEN, Status

PROOF_SHARE = 0.5
"""The part of the time limit within which a proof is looked for that there is no solution."""
UNASKED_SECONDS = 0.5
"""Longest search, in seconds, for each proof that no solver claims, where no answer meets the tolerance."""
SOLVE, JUDGE = "solve", "judge"
"""Phases of `solve_there`."""


@dataclass(frozen=True)
class RoutedSolver:
    """A solver, and the problem as it was brought there.

    Attributes
    ----------
    problem : of the solver's own formulation. steps : conversions that led there, `label` and `kind` of them all.
    seconds : what they took.
    """

    solver: Solver
    options: Any
    name: str
    problem: Problem
    steps: int = 0
    label: str = "direct"
    kind: Kind = Kind.EQUIVALENT
    seconds: float = 0.0


def solve(
    problem: Problem, solver: str | None = None, *, tolerance: float = 1e-6, seconds: float = 10.0, threads: int = 1
) -> Solution:
    """Solve a problem, in this process, and measure the answer on it.

    Parameters
    ----------
    problem : of any formulation; where the solver is for another one, exact conversions lead there and back.
    solver : a name, with options where wanted: ``"nsgs[omega=1.2]"``. None or ``"auto"``: the automatic choice of
        cpbench's own solvers for this formulation, or for the nearest one that has such a choice and takes the problem.
    tolerance : the largest error of an answer that counts as solved (see `Solution.error`).
    seconds : limit of set-up and solve [s], from after the warm-up on. The solver gets it; one that does not look
        at the clock is not stopped, and its answer has the status `timeout`. `cpbench.run` stops whatever does not end.
    threads : of BLAS and OpenMP in this process, while this lasts; as `--threads` of the command.

    Returns
    -------
    Solution : also where the solver fails, which its `status` says.

    Raises
    ------
    UnknownName : no such solver or option. NoRoute : no exact conversion leads from the problem to the solver.
    NotApplicable : the solver refuses the problem. Unavailable : its package is not installed.

    >>> import cpbench
    >>> lcp = cpbench.LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-5.0, -6.0])
    >>> solution = cpbench.solve(lcp, "lemke")
    >>> bool(solution), solution.x.round(12).tolist(), solution.route
    (True, [1.333333333333, 2.333333333333], 'direct')
    """
    if not isinstance(problem, Problem):
        where = "its attribute problem is one" if hasattr(problem, "problem") else "cpbench.load reads one from a file"
        raise ProblemError("problem", f"is a {type(problem).__name__}, expected a Problem; {where}")
    for name, value in (("tolerance", tolerance), ("seconds", seconds), ("threads", threads)):
        if not value > 0:
            raise ProblemError(name, "must be positive")
    routed = route_to_solver(problem, solver)
    warm_up(routed.solver)
    with blas_threads(threads):
        return solve_there(problem, routed, tolerance, seconds)[0]


def route_to_solver(
    problem: Problem,
    name: str | None = None,
    via: Sequence[Conversion] = (),
    kinds: frozenset[Kind] = EXACT,
) -> RoutedSolver:
    """Bring the problem to a solver by its name, or to the nearest automatic choice that takes it (None, AUTO).

    `via` : conversions to go through. `kinds` : the promises that others may have.

    Raises UnknownName, NoRoute, NotApplicable, Unavailable.
    """
    if name is None or name == AUTO:
        return _automatic(problem, via, kinds)
    base, given = read_brackets("solver", name)
    solver = solvers.get(base)
    state = solver.availability()
    if not state.ok:
        raise Unavailable(state.state, f"{base}: {state.detail}")
    routed = _brought(problem, solver, parse_options(solver.spec, given), name, via, kinds)
    why = solver.obstacle(routed.problem)
    if why is not None:
        raise NotApplicable(name, why)
    return routed


def _automatic(problem: Problem, via: Sequence[Conversion], kinds: frozenset[Kind]) -> RoutedSolver:
    """Bring the problem to the nearest automatic choice that takes it; raises NoRoute."""
    refused: list[str] = []
    for name in nearest_automatic(via[-1].target if via else problem.node):
        chosen = solvers.get(name)
        try:
            routed = _brought(problem, chosen, chosen.spec.options(), name, via, kinds)
        except NoRoute as cause:
            refused.append(str(cause))
            continue
        why = chosen.obstacle(routed.problem)
        if why is None:
            return routed
        refused.append(f"{name}: {why}")
    tried = f" (tried: {refused[0]})" if refused else ""
    raise NoRoute(f"no automatic choice takes this problem ({problem.node}): {_accepting_solvers(problem)}{tried}")


def _brought(
    problem: Problem, solver: Solver, options: Any, name: str, via: Sequence[Conversion], kinds: frozenset[Kind]
) -> RoutedSolver:
    if solver.spec.node == problem.node and not via:
        return RoutedSolver(solver, options, name, problem, kind=solver.spec.kind)
    done = graph.Memory()
    arrival = graph.arrive(problem, solver.spec.node, kinds, via, apply=done)
    kind = max(arrival.kind, solver.spec.kind, key=lambda kind: kind.rank)
    return RoutedSolver(
        solver,
        options,
        name,
        arrival.problem,
        len(arrival.route.steps),
        arrival.route.label,
        kind,
        done.seconds(problem, arrival.route),
    )


def solve_there(
    problem: Problem,
    routed: RoutedSolver,
    tolerance: float,
    seconds: float,
    start: Any = None,
    on_phase: Callable[[str], None] = lambda _: None,
) -> tuple[Solution, float]:
    """Run the solver and judge what it returns; once more for a smaller tolerance where its package's claim fails.

    Returns the solution, and the error of its answer on the solver's own problem.

    `start` : a point of the solver's own problem. `on_phase` : called with SOLVE and JUDGE where these begin.
    """
    run = partial(_judged, problem, routed, tolerance, start=start, on_phase=on_phase)
    target_tolerance = graph.tolerance(routed.problem, tolerance, routed.steps)
    first, missed = run(Budget(tolerance=target_tolerance, seconds=seconds))
    if first.status not in FALSE_CLAIMS:
        return first, missed
    smaller = second_tolerance(routed.solver.stopping, target_tolerance, first.claim, missed)
    if smaller is None:
        return first, missed
    second, missed_again = run(Budget(tolerance=smaller, seconds=seconds))
    better = second.status in MET_TOLERANCE
    kept, other = (second, first) if better else (first, second)
    which = "first" if better else "second"
    retried = f"asked twice, then for {smaller:.1e}; the {which} answer: {other.status}, error {other.error:.1e}"
    message = "; ".join(filter(None, (kept.message, retried)))
    return replace(kept, message=message), missed_again if better else missed


def _judged(
    problem: Problem,
    routed: RoutedSolver,
    tolerance: float,
    budget: Budget,
    *,
    start: Any,
    on_phase: Callable[[str], None],
) -> tuple[Solution, float]:
    """Return what one run of the solver is worth, and the error of its answer on its own problem."""
    seconds = budget.seconds
    ended = partial(
        Solution, problem=problem, solver=routed.name, tolerance=tolerance, route=routed.label, kind=routed.kind
    )
    spent = {"convert": routed.seconds} if routed.steps else {}
    solver = routed.solver
    try:
        handed = solver.hand_over(routed.problem)
        on_phase(SOLVE)
        begun = time.perf_counter()
        prepared = solver.setup(handed, budget, routed.options)
        between = time.perf_counter()
        output = solver.solve(prepared, budget, routed.options, start)
        spent |= {"setup": between - begun, "solve": time.perf_counter() - between}
        output = solver.collect(output)
        on_phase(JUDGE)
    except (NotApplicable, Unavailable):
        raise
    except Exception as error:
        causes = {MemoryError: Status.MEMOUT, Ended: Status.CRASH}
        status = next((status for kind, status in causes.items() if isinstance(error, kind)), Status.ERROR)
        message = described(error)
        broken = ended(status=status, verdict=verification.no_answer(tolerance), seconds=spent, message=message)
        return broken, broken.error
    judgement = judge_answer(
        problem,
        routed.problem,
        routed.steps,
        None if output.point is None else output.point.arrays(),
        tolerance=tolerance,
        claim=output.claim,
        kind=routed.kind,
        promise=solver.spec.kind,
        prove=lambda claim: _proof(problem, routed, tolerance, claim, output.certificate, PROOF_SHARE * seconds),
    )
    # the solver knows the limit, and nothing stops it in this process
    late = spent["setup"] + spent["solve"] > seconds
    remarks = [judgement.message, output.message, f"answered after the limit of {seconds:g} s" if late else ""]
    solution = ended(
        status=Status.TIMEOUT if late and judgement.status not in PROVEN else judgement.status,
        verdict=judgement.verdict,
        point=judgement.point,
        claim=str(output.claim),
        seconds={**spent, "lift": judgement.lift, "verify": judgement.verify},
        counters=dict(output.counters),
        message="; ".join(filter(None, remarks)),
    )
    return solution, (judgement.target or judgement.verdict).error


def _proof(
    problem: Problem, routed: RoutedSolver, tolerance: float, claim: str, certificate: Any, seconds: float
) -> proofs.ProofAttempt | None:
    """Look for a proof that the problem has no solution: that which the solver claims, or any where it claims none.

    Where no conditions are known of the problem, those of the solver's own problem stand for it, if every solution of
    the one is one of the other: what the conversion rounds is far below the margin of a proof.
    """
    subject, direct = problem, not routed.steps
    program = isinstance(problem, NLP) and proofs.objective(routed.problem) is None  # optimality has no objective
    if proofs.conditions(problem) is None and routed.kind in (Kind.EQUIVALENT, Kind.NECESSARY) and not program:
        subject, direct = routed.problem, True
    search = partial(proofs.prove, subject, tolerance=tolerance)
    proof_attempt = look_for_proof(search, direct, claim, certificate, min(seconds, PROOF_SECONDS))
    if proof_attempt is None:
        attempts = (search(kind, None, min(seconds, UNASKED_SECONDS)) for kind in PROVEN)
        proof_attempt = next((attempt for attempt in attempts if attempt.proof is not None), None)
    if proof_attempt is not None and proof_attempt.proof is not None and subject is not problem:
        return replace(
            proof_attempt, message=f"{proof_attempt.message} (as {subject.node}, which has the same solutions)"
        )
    return proof_attempt


def _accepting_solvers(problem: Problem) -> str:
    """Say which installed solvers take a problem as it is."""
    of_node = (
        one for one in solvers if one.spec.node == problem.node and one.spec.by_default and not missing(one.spec)
    )
    names = [one.spec.name for one in of_node if one.obstacle(problem) is None]
    if not names:
        return f"name a solver; cpbench list solvers {problem.node} has those that take it as it is"
    return f"name a solver that takes it as it is: {', '.join(names)}"
