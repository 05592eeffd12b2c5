"""Many small problems of one size by compiled calls, and which of the answers are right: `solve_many`, and sets of a
plan that ask for throughput."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.errors import ProblemError
from cpbench.formulations.base import Problem
from cpbench.formulations.stack import Stack
from cpbench.foundation.matrices import Dense, Vector
from cpbench.solvers.automatic import automatic_solver
from cpbench.solvers.base import Budget, Claim, Solver, StackCall, solvers
from cpbench.verification.stacked import judge_stack

CLAIMS = tuple(Claim)
"""Claims by the numbers that messages have for them."""


@dataclass(frozen=True, eq=False)
class MeasuredAnswers:
    """Answers of compiled calls, measured.

    Attributes
    ----------
    x : (k, n) each answer as one vector. error : (k,) measured. stationary : (k,) whether a right answer is no more
    than that. left : the numbers of the problems that were not solved. solve, verify : wall time [s].
    """

    x: Dense
    error: Vector
    stationary: NDArray[np.bool_]
    left: NDArray[np.int64]
    solve: float
    verify: float


def call_for(problem: Problem) -> StackCall:
    """Return the compiled call of the automatic choice for many problems like this one; raises ProblemError where it
    does not take them."""
    name = automatic_solver(problem.node)
    call = None if name is None else solvers.get(name).stack_call
    if call is None:
        raise ProblemError("problems", f"are of {problem.node}, which no compiled call takes; cpbench.solve takes one")
    sizes = problem.point_sizes
    unknowns = sizes.get("z", sum(sizes.values()))  # of a program without its multipliers
    if unknowns > call.unknowns:
        why = f"have {unknowns} unknowns, at most {call.unknowns}: use cpbench.solve for each"
        raise ProblemError("problems", why)
    return call


def solve_measured(call: StackCall, stack: Stack, tolerance: float, threads: int) -> MeasuredAnswers:
    """Solve by compiled calls and measure every answer; those that fail are tried again with less of the tolerance."""
    x = np.full((stack.count, sum(stack.point_sizes.values())), np.nan)
    error, stationary = np.full(stack.count, np.inf), np.zeros(stack.count, dtype=bool)
    left, solve, verify = np.arange(stack.count), 0.0, 0.0
    for share in call.shares:
        some = stack if left.size == stack.count else stack.only(left)
        begun = time.perf_counter()
        answers = call.solve(some, share * tolerance, threads)
        between = time.perf_counter()
        verdicts = judge_stack(some, answers, tolerance)
        solve += between - begun
        verify += time.perf_counter() - between
        x[left], error[left] = np.concatenate(list(answers.values()), axis=1), verdicts.error
        stationary[left] = verdicts.stationary
        left = left[~verdicts.solved]
        if not left.size:
            break
    return MeasuredAnswers(x, error, stationary, left, solve, verify)


def solve_all(solver: Solver, stack: Stack, budget: Budget, options: Any, threads: int) -> dict[str, Vector]:
    """Solve by compiled calls, and what these leave by the solver itself; return the vectors of `messages.Result`."""
    if solver.stack_call is None:
        raise ProblemError("problems", f"{solver.spec.name} takes them one by one")
    found = solve_measured(solver.stack_call, stack, budget.tolerance, threads)
    x, claims, answered, alone = found.x, np.zeros(stack.count), np.ones(stack.count), np.zeros(stack.count)
    alone[found.left] = 1.0
    for i in found.left.tolist():
        output = solver.run(stack.problem(i), budget, options)
        claims[i], answered[i] = CLAIMS.index(output.claim), output.point is not None
        if output.point is not None:
            x[i] = output.point.vector
    parts = np.split(x, np.cumsum(list(stack.point_sizes.values()))[:-1], axis=1)
    answers = {name: part.ravel() for name, part in zip(stack.point_sizes, parts, strict=True)}
    return {**answers, "claim": claims, "answered": answered, "alone": alone}


def part_of(vectors: Mapping[str, Any], count: int, i: int) -> tuple[Claim, bool, bool, dict[str, Vector]]:
    """Return claim, whether there is an answer, whether it was found alone, and the answer of problem i of `count`;
    raises ValueError where vectors have other lengths, IndexError for a claim that is none."""
    own = {name: np.asarray(vector).reshape(count, -1)[i] for name, vector in vectors.items()}
    claim, answered, alone = (int(own.pop(name)[0]) for name in ("claim", "answered", "alone"))
    return CLAIMS[claim], bool(answered), bool(alone), own if answered else {}
