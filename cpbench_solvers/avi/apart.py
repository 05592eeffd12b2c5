"""An affine variational inequality, or a relay problem, by its connected parts: each is solved by itself."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.lcp import LCPPoint
from cpbench.formulations.relay import Relay
from cpbench.foundation.kernel_cache import load
from cpbench.solvers.base import Budget, Claim, SolverOutput
from cpbench_solvers.avi.claims import data_of, error_of
from cpbench_solvers.qp.apart import block, claimed, missed, split
from cpbench_solvers.qp.claims import PARTS_KERNEL

Affine: TypeAlias = AVI | Relay
Index: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PartedAffine:
    """A problem with, for each connected part, the numbers of its unknowns and multipliers, rising."""

    problem: Any
    members: list[Index]


def parted(problem: Affine) -> PartedAffine | None:
    """Return a problem of several connected parts with these; None where it is one, or has a row without entries."""
    n = problem.q.size
    if n < 2:
        return None
    part = load(PARTS_KERNEL).labels(*data_of(problem)[:2])
    count = int(part.max()) + 1
    if count < 2 or np.setdiff1d(part[n:], part[:n]).size:
        return None
    order = np.argsort(part, kind="stable")
    return PartedAffine(problem, np.split(order, np.cumsum(np.bincount(part))[:-1]))


def restricted(P: Any, at: Index) -> Affine:
    """Return the problem of some unknowns and rows, numbered as those of z, A and C together, rising."""
    if isinstance(P, Relay):
        return Relay(M=block(P.M, at, at), q=P.q[at], lb=P.lb[at], ub=P.ub[at])
    z, rows, equalities = split(at, P.q.size, P.b.size)
    own = {"M": block(P.M, z, z), "q": P.q[z], "lb": P.lb[z], "ub": P.ub[z]}
    others = {"A": block(P.A, rows, z), "b": P.b[rows], "C": block(P.C, equalities, z), "d": P.d[equalities]}
    return AVI(**own, **others)


def solve_apart(
    parts: PartedAffine, budget: Budget, start: Any | None, run: Callable[[Any, Budget, Any], SolverOutput]
) -> SolverOutput:
    """Return the answer of all parts, solved one after the other by `run`; a limit of iterations is one of all."""
    problem, deadline = parts.problem, budget.deadline()
    x = np.zeros(sum(problem.point_sizes.values()))
    given, counters = None if start is None else start.vector, Counter[str]()
    claim, messages = Claim.FAILED, list[str]()
    for number, at in enumerate(parts.members):
        own, share = restricted(problem, at), budget.left(deadline, counters["iterations"])
        output = run(own, share, None if given is None else _point(own, given[at]))
        counters.update(output.counters)
        if output.point is not None:
            x[at] = output.point.vector
        if output.claim is not Claim.SOLVED:
            claim = output.claim
            messages.append(missed(output, number, at))
    point = _point(problem, x)
    return claimed(point, error_of(problem, point, budget.tolerance), budget, claim, messages, dict(counters))


def _point(problem: Affine, x: Any) -> Any:
    if isinstance(problem, Relay):
        return LCPPoint(x)
    n, m = problem.q.size, problem.b.size
    return AVIPoint(x[:n], x[n : n + m], x[n + m :])
