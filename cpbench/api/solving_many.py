"""Solving many small problems of one size in this process: one compiled call, and verdicts as arrays."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.api.solving import solve
from cpbench.bench.stacked import call_for, solve_measured
from cpbench.errors import ProblemError
from cpbench.formulations.base import Problem
from cpbench.formulations.stack import Stack
from cpbench.foundation.matrices import Dense, Vector
from cpbench.verification import Status


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
    solved = solve_measured(call_for(stack.problem(0)), stack, tolerance, threads)
    x, error, left = solved.x, solved.error, solved.left
    status = np.where(solved.stationary, Status.STATIONARY, Status.SOLVED).astype(f"<U{max(map(len, Status))}")
    begun = time.perf_counter()
    for i in left.tolist():
        solution = solve(stack.problem(i), tolerance=tolerance, seconds=seconds)
        x[i] = np.nan if solution.x is None else solution.x
        status[i], error[i] = str(solution.status), solution.error
    spent = {"solve": solved.solve, "verify": solved.verify, "one by one": time.perf_counter() - begun}
    return Solutions(stack, x, status, error, tolerance, left, spent)


def _stacked(problems: Sequence[Problem] | type[Problem], arrays: Mapping[str, Any]) -> Stack:
    """Return the problems as a stack that the compiled calls take; raises ProblemError."""
    if isinstance(problems, type):
        stack = Stack.of_arrays(problems, arrays)
    elif arrays:
        raise ProblemError("arrays", f"{', '.join(arrays)} go with a class of problems, not with problems")
    else:
        stack = Stack.of_problems(problems)
    return stack
