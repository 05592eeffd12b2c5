"""An affine problem (LCP, MLCP, relay, variational inequality) by its connected parts: each is solved by itself."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.linear import AVI, LCP, MLCP, Relay
from cpbench.foundation import matrices
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput
from cpbench_solvers.automatic import AutomaticChoice, LastNumber
from cpbench_solvers.avi.claims import Affine, data_of, verdict_error
from cpbench_solvers.qp.apart import block, claimed, labels, missed, split

LARGE, FEW = 300, 0.05
"""Unknowns beyond which matrices with at most this share of nonzeros are factored as sparse ones however they came."""
Index: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PartedAffine:
    """A problem with, for each connected part, the numbers of its unknowns and multipliers, rising."""

    problem: Any
    members: list[Index]


def parted(problem: Affine) -> PartedAffine | None:
    """Return a problem of several connected parts with these; None where it is one."""
    M = problem.B if isinstance(problem, MLCP) else problem.M
    if M.shape[0] and not matrices.is_sparse(M) and np.all(matrices.dense(M)[0]):
        return None  # this row joins all unknowns, or all pairs
    M, G, q = data_of(problem)[:3]
    if q.size < 2:
        return None
    part = labels(M, G)
    if part.max() < 1:
        return None
    order = np.argsort(part, kind="stable")
    return PartedAffine(problem, np.split(order, np.cumsum(np.bincount(part))[:-1]))


def restricted(P: Any, at: Index) -> Affine:
    """Return the problem of some unknowns and rows, numbered as those of z, A and C together, rising."""
    if isinstance(P, LCP):
        return LCP(M=block(P.M, at, at), q=P.q[at])
    if isinstance(P, Relay):
        return Relay(M=block(P.M, at, at), q=P.q[at], lb=P.lb[at], ub=P.ub[at])
    if isinstance(P, MLCP):
        u, v, _ = split(at, P.a.size, P.b.size)
        pairs = {"A": (u, u), "B": (v, v), "C": (u, v), "D": (v, u)}
        return MLCP(**{name: block(getattr(P, name), *places) for name, places in pairs.items()}, a=P.a[u], b=P.b[v])
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
        output = run(own, share, None if given is None else own.point_from_vector(given[at]))
        counters.update(output.counters)
        if output.point is not None:
            x[at] = output.point.vector
        if output.claim is not Claim.SOLVED:
            claim = output.claim
            messages.append(missed(output, number, at))
    point, error = problem.point_from_vector(x), verdict_error(problem, x)
    if messages:  # what no part has claimed must be right by its norms, too
        error = max(error, problem.residuals(point, budget.tolerance).error)
    return claimed(point, error, budget, claim, messages, dict(counters))


def stored_by_entries(problem: Affine) -> Affine:
    """Return a large problem of few entries with sparse matrices, others as they are."""
    if (n := sum(problem.point_sizes.values())) <= LARGE:
        return problem
    stored = {name: M for name, M in problem.data().items() if M.ndim == 2}
    if sum(map(matrices.nnz, stored.values())) > FEW * n * n:
        return problem
    return replace(problem, **{name: matrices.sparse(M) for name, M in stored.items()})


class ByParts(AutomaticChoice):
    """Base of the choices for affine problems: connected parts are solved one after the other, at once or where a
    problem of few unknowns is not solved as a whole."""

    few: ClassVar[int] = 0
    """Unknowns up to which to look for parts takes longer than to solve the problem."""

    def setup(self, problem: Any, budget: Budget, options: Any) -> Any:
        """Return a `Plan`, or a `PartedAffine`."""
        parts = parted(problem) if sum(problem.point_sizes.values()) > self.few else None
        return super().setup(stored_by_entries(problem), budget, options) if parts is None else parts

    def solve(
        self, prepared: Any, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        if isinstance(prepared, PartedAffine):
            return self._apart(prepared, budget, options, start, record)
        deadline, last = budget.deadline(), None if record is None else LastNumber(record)
        output = super().solve(prepared, budget, options, start, last)
        if output.claim is Claim.SOLVED or output.certificate is not None or budget.iterations is not None:
            return output
        left, large = budget.left(deadline), sum(prepared.problem.point_sizes.values()) > self.few
        if large or left.seconds <= 0.0 or (parts := parted(prepared.problem)) is None:
            return output  # `setup` has looked for the parts of a large problem
        solution = self._apart(parts, left, options, start, last)
        return solution if solution.claim is Claim.SOLVED else output

    def _apart(
        self, parts: PartedAffine, budget: Budget, options: Any, start: Any, record: LastNumber | Record | None
    ) -> SolverOutput:
        def run(part: Any, share: Budget, begin: Any) -> SolverOutput:
            return self.run(part, share, options, begin)

        output, problem = solve_apart(parts, budget, start, run), parts.problem
        if record is not None and output.point is not None:
            first = record.number + 1 if isinstance(record, LastNumber) else 0
            ends = (first, problem.zero_point()), (first + max(1, output.counters.get("iterations", 0)), output.point)
            for iteration, point in ends:
                record(iteration, self.error(problem, point, budget.tolerance), lambda point=point: point)
        return output
