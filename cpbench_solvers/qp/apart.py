"""A QP by its connected parts: each is solved in its own units, and takes no time once it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation import matrices
from cpbench.solvers.base import Budget, Claim, Solver, SolverOutput
from cpbench_solvers.kernels import linear_rows, qp_apart, qp_sparse
from cpbench_solvers.lcp.claims import concluded
from cpbench_solvers.qp.claims import ErrorMeasure
from cpbench_solvers.qp.kkt_system import Entries, entries
from cpbench_solvers.qp.proximal_active_set import OPERATIONS, PASSES, ProximalActiveSetOptions

MOST = 100
"""Unknowns of a part up to which the compiled call for all small parts takes it."""
SHOWN = 3
"""Parts that a message names."""


@dataclass(frozen=True, eq=False)
class PartedQP:
    """A QP with the connected part of each of its unknowns, rows of A and rows of C, and how many parts there are."""

    problem: QP
    Q: Entries
    G: Entries
    part: NDArray[np.int64]
    count: int


def parted(problem: QP, most: float = 1.0) -> PartedQP | None:
    """Return a problem of several connected parts with these; None where it is one, or one has more than that share of
    the unknowns and rows."""
    if not matrices.is_sparse(problem.Q) and problem.Q.size and np.all(matrices.dense(problem.Q)[0]):
        return None  # this row joins all unknowns
    G = qp_sparse.stacked(entries(problem.A), entries(problem.C))
    Q = entries(problem.Q)
    part = labels(Q, G)
    count = int(part.max(initial=-1)) + 1
    apart = count > 1 and np.bincount(part).max() <= most * part.size
    return PartedQP(problem, Q, G, part, count) if apart else None


def labels(Q: Entries, G: Entries) -> NDArray[np.int64]:
    """Return the connected part of every unknown and row, numbered from 0. Rows without entries, which are part of
    nothing, count to the first unknown's."""
    part, n = linear_rows.labels(Q, G), Q[0].size - 1
    alone = ~np.isin(part[n:], part[:n])
    if n and alone.any():
        part[n:][alone] = part[0]
        part = np.unique(part, return_inverse=True)[1]
    return part


def solve_apart(parts: PartedQP, budget: Budget, start: QPPoint | None, solver: Solver) -> SolverOutput:
    """Return the answer of all parts: small ones by one compiled call, what is left by `solver`, one part by one.

    A part without a solution ends it; its certificate is one of the whole.
    """
    P, deadline = parts.problem, budget.deadline()
    whole = _Answer(P)
    counts, outcome = np.zeros(2, np.int64), np.empty(parts.count, np.int64)
    kernel, own = qp_apart, ProximalActiveSetOptions()
    how = budget.tolerance, matrices.PSD_TOLERANCE, own.proximal, own.feasibility_tolerance, PASSES, OPERATIONS
    sides = np.concatenate([P.b, P.d])
    most = MOST if budget.iterations is None else 0
    data = parts.Q, parts.G, P.p, sides, P.b.size, P.lb, P.ub, parts.part, parts.count, most
    kernel.solve_parts(*data, *how, whole.z, whole.y, whole.nu, outcome, counts)
    whole.count({"iterations": int(counts.sum()), "proximal_steps": int(counts[1])})
    for q, at in _members(parts, np.flatnonzero(outcome != 0)):
        share = budget.left(deadline, whole.counters["iterations"])
        output = solver.run(restricted(P, at), share, start=None if start is None else _start(P, start, at))
        whole.count(output.counters)
        if output.claim in (Claim.INFEASIBLE, Claim.UNBOUNDED):
            return whole.without_solution(output, q, at)
        whole.take(output, q, at)
    return whole.concluded(budget)


def _members(parts: PartedQP, some: NDArray[np.int64]) -> Iterator[tuple[int, NDArray[np.int64]]]:
    if some.size:
        first, row = qp_apart.members(parts.part, parts.count)
        for q in some.tolist():
            yield q, row[first[q] : first[q + 1]]


def restricted(P: QP, at: NDArray[np.int64]) -> QP:
    """Return the QP of some unknowns and rows, numbered as those of z, A and C together, rising."""
    n, m = P.p.size, P.b.size
    z, rows, equalities = split(at, n, m)
    return QP(
        Q=block(P.Q, z, z), p=P.p[z], A=block(P.A, rows, z), b=P.b[rows], C=block(P.C, equalities, z),
        d=P.d[equalities], lb=P.lb[z], ub=P.ub[z],
    )  # fmt: skip


def block(M: Any, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Any:
    """Return the rows and columns of a matrix, stored as it is."""
    return M[rows][:, columns] if matrices.is_sparse(M) else M[np.ix_(rows, columns)]


def split(at: NDArray[np.int64], n: int, m: int) -> tuple[NDArray[np.int64], ...]:
    """Return which of n unknowns, of m rows of A and of those of C are among some, numbered together, rising."""
    first, last = np.searchsorted(at, [n, n + m])
    return at[:first], at[first:last] - n, at[last:] - n - m


def _start(P: QP, start: QPPoint, at: NDArray[np.int64]) -> QPPoint:
    z, rows, equalities = split(at, P.p.size, P.b.size)
    return QPPoint(start.z[z], start.lam[rows], start.mu[equalities], start.nu[z])


class _Answer:
    """The answer of all parts, as far as they are solved: z (n,), y (r,) of the rows of A and C, nu (n,)."""

    def __init__(self, problem: QP) -> None:
        n, m, k = problem.p.size, problem.b.size, problem.d.size
        self._problem = problem
        self.z, self.y, self.nu = np.zeros(n), np.zeros(m + k), np.zeros(n)
        self.counters: dict[str, int] = {"iterations": 0}
        self._missed: list[str] = []
        self._claim = Claim.FAILED

    def count(self, counters: Any) -> None:
        for name, value in counters.items():
            self.counters[name] = self.counters.get(name, 0) + value

    def take(self, output: SolverOutput, q: int, at: NDArray[np.int64]) -> None:
        """Take what a part came to."""
        if isinstance(output.point, QPPoint):
            z, rows, equalities = split(at, self._problem.p.size, self._problem.b.size)
            self.z[z], self.nu[z] = output.point.z, output.point.nu
            self.y[rows], self.y[self._problem.b.size + equalities] = output.point.lam, output.point.mu
        if output.claim is not Claim.SOLVED:
            self._claim = output.claim
            self._missed.append(missed(output, q, at))

    def without_solution(self, output: SolverOutput, q: int, at: NDArray[np.int64]) -> SolverOutput:
        """Return the claim of a part that has no solution as that of the whole."""
        certificate, n = output.certificate, self.z.size
        if certificate is not None:
            part, certificate = certificate, np.zeros(self.y.size)
            certificate[at[at >= n] - n] = part
        message = f"part {q + 1}: {output.message}"
        return SolverOutput(claim=output.claim, counters=self.counters, certificate=certificate, message=message)

    def concluded(self, budget: Budget) -> SolverOutput:
        """Return the answer with a claim."""
        m = self._problem.b.size
        answer = self.z, self.y[:m], self.y[m:], self.nu
        error = ErrorMeasure(self._problem).verdict(answer)
        return claimed(QPPoint(*answer), error, budget, self._claim, self._missed, self.counters)


def missed(output: SolverOutput, q: int, at: NDArray[np.int64]) -> str:
    """Return what a message says of part q, which is not solved."""
    return f"part {q + 1} ({at.size} unknowns and rows): {output.message or output.claim}"


def claimed(
    point: Any, error: float, budget: Budget, claim: Claim, messages: list[str], counters: dict[str, int]
) -> SolverOutput:
    """Return the answer of all parts with a claim by its error; `claim` : of the last part that is not solved."""
    message = "; ".join([*messages[:SHOWN], f"error {error:.1e}"])
    return concluded(point, error, budget, counters, None if claim is Claim.FAILED else claim, message)
