"""Solving many small problems of one size in this process: one compiled call, and verdicts as arrays."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.api.solving import solve
from cpbench.errors import ProblemError
from cpbench.formulations.base import Problem
from cpbench.formulations.stack import Stack
from cpbench.foundation.matrices import Dense, Vector
from cpbench.solvers.base import StackCall, automatic_solver, solvers
from cpbench.verification import Status
from cpbench.verification.stacked import judge_stack


@dataclass(frozen=True, eq=False)
class Solutions:
    """Answers to k problems, measured on them.

    Attributes
    ----------
    stack : the problems. x : (k, n) every answer as one vector, its parts one after the other; NaN where there is none.
    status : (k,) what the answers are worth, as `Solution.status`. error : (k,) the errors measured, without unit.
    tolerance : what was asked for.
    one_by_one : the numbers of the problems that compiled calls did not solve, and the automatic choice was asked.
    seconds : wall time of `solve`, the compiled calls, of `verify` and of `one by one` [s].
    """

    stack: Stack
    x: Dense
    status: NDArray[np.str_]
    error: Vector
    tolerance: float
    one_by_one: NDArray[np.int64]
    seconds: Mapping[str, float] = field(default_factory=dict)

    def __len__(self) -> int:
        return self.stack.count

    @property
    def solved(self) -> NDArray[np.bool_]:
        """(k,) whether the answers meet the tolerance."""
        return (self.status == Status.SOLVED) | (self.status == Status.STATIONARY)

    def __repr__(self) -> str:
        node, most = self.stack.kind.node, float(np.max(self.error, where=self.solved, initial=0.0))
        kept = f"{int(self.solved.sum())} of {len(self)} solved at {self.tolerance:g}, error at most {most:.2g}"
        return f"<Solutions of {node}: {kept}, {self.one_by_one.size} one by one>"


def solve_many(
    problems: Sequence[Problem] | type[Problem],
    /,
    *,
    tolerance: float = 1e-6,
    seconds: float = 10.0,
    threads: int = 1,
    **arrays: Any,
) -> Solutions:
    """Solve many small problems of one size by one compiled call, and measure every answer.

    What that call does not solve goes to the automatic choice, one by one.

    Parameters
    ----------
    problems : LCP, MLCP, QP or frictional contact of at most 64 unknowns; or the class of these, with stacked `arrays`.
    tolerance : the largest error of an answer that counts as solved.
    seconds : limit of each problem that is solved by itself [s]. threads : over how many the compiled call is spread.
    arrays : the data by their names, such as ``M=`` (k, n, n) and ``q=`` (k, n); one without the first axis is the same
        for all problems.

    Raises
    ------
    ProblemError : the problems or arrays do not fit together, are too large, or of another formulation.

    >>> import cpbench, numpy
    >>> q = numpy.array([[-5.0, -6.0], [1.0, -2.0]])
    >>> solutions = cpbench.solve_many(cpbench.LCP, M=[[2.0, 1.0], [1.0, 2.0]], q=q, tolerance=1e-9)
    >>> solutions.x.round(6).tolist(), solutions.status.tolist()
    ([[1.333333, 2.333333], [0.0, 1.0]], ['solved', 'solved'])
    """
    if not (tolerance > 0 and seconds > 0 and threads > 0):
        wrong = "tolerance" if not tolerance > 0 else "seconds" if not seconds > 0 else "threads"
        raise ProblemError(wrong, "must be positive")
    stack = _stacked(problems, arrays)
    solutions = _solve_measured(_call_for(stack.problem(0)), stack, tolerance, threads)
    begun = time.perf_counter()
    for i in solutions.one_by_one.tolist():
        solution = solve(stack.problem(i), tolerance=tolerance, seconds=seconds)
        solutions.x[i] = np.nan if solution.x is None else solution.x
        solutions.status[i], solutions.error[i] = str(solution.status), solution.error
    return replace(solutions, seconds={**solutions.seconds, "one by one": time.perf_counter() - begun})


def _call_for(problem: Problem) -> StackCall:
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


def _solve_measured(call: StackCall, stack: Stack, tolerance: float, threads: int) -> Solutions:
    """Solve by compiled calls and measure every answer; those that fail are tried again with less of the tolerance.
    What is left has to be solved one by one."""
    x = np.full((stack.count, sum(stack.point_sizes.values())), np.nan)
    error = np.full(stack.count, np.inf)
    status = np.full(stack.count, Status.SOLVED, dtype=f"<U{max(map(len, Status))}")
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
        status[left] = np.where(verdicts.stationary, Status.STATIONARY, Status.SOLVED)
        left = left[~verdicts.solved]
        if not left.size:
            break
    return Solutions(stack, x, status, error, tolerance, left, {"solve": solve, "verify": verify})


def _stacked(problems: Sequence[Problem] | type[Problem], arrays: Mapping[str, Any]) -> Stack:
    """Return the problems as a stack that the compiled calls take; raises ProblemError."""
    if isinstance(problems, type):
        return Stack.of_arrays(problems, arrays)
    if arrays:
        raise ProblemError("arrays", f"{', '.join(arrays)} go with a class of problems, not with problems")
    return Stack.of_problems(problems)
