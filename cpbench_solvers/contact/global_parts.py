"""Solves the connected parts of a global contact problem, linked by M, H and G, one after the other.

Norms over all parts say little of small ones, and factors and penalties suit no two parts of very different masses.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.global_contact import GFCPoint, GlobalContact
from cpbench.foundation.matrices import Vector, is_sparse, transpose
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput
from cpbench.verification.contact_systems import connected
from cpbench.verification.verdict import error_of
from cpbench_solvers.contact.by_parts import SURE
from cpbench_solvers.contact.parts import NO_ROLLING, PartSolver, PartsProgress, claimed, rows_of
from cpbench_solvers.contact.run import ContactMethod, iterate_on
from cpbench_solvers.contact.sweeps import kernel

Index = NDArray[np.int64]
Unknowns: TypeAlias = tuple[Vector, Vector, Vector]
"""v, r and λ that may be written to."""


@dataclass(frozen=True)
class MovingPart:
    """Numbers of the contacts, of the velocities and of the joints of a connected part."""

    contacts: Index
    velocities: Index
    joints: Index

    def start(self, point: GFCPoint, d: int) -> GFCPoint:
        """Return what belongs to the part of an answer to the whole."""
        return GFCPoint(v=point.v[self.velocities], r=point.r[rows_of(self.contacts, d)], lam=point.lam[self.joints])

    def put(self, whole: Unknowns, own: GFCPoint, d: int) -> None:
        """Write the answer of the part into that of the whole."""
        whole[0][self.velocities], whole[2][self.joints] = own.v, own.lam
        whole[1][rows_of(self.contacts, d)] = own.r


@dataclass(frozen=True)
class MovingParts:
    """A problem of several parts."""

    problem: GlobalContact
    parts: tuple[MovingPart, ...]


class DynamicsError:
    """Error of answers to one problem: of the law at the contacts and, where that is within the tolerance, the
    verdict's, which has the dynamics and the joints, too, and takes longer. Infinite where it is not a number.

    Attributes
    ----------
    floor : what rounding may make of the last answer, where that hides its error at the tolerance; else 0.
    """

    def __init__(self, problem: Any, tolerance: float) -> None:
        self._problem, self._tolerance, self.floor = problem, tolerance, 0.0
        self._lengths, self._law = problem.lengths.ravel(), kernel("part_error").velocity_error
        self._moves, mu_r = transpose(problem.at_hand[1]), NO_ROLLING
        if hasattr(problem, "mu_r"):
            mu_r = problem.mu_r / problem.lengths[:, -1]
        free = problem.free_velocity * self._lengths
        self._data = free, problem.mu, mu_r, problem.rho, problem.dimension

    def __call__(self, point: GFCPoint) -> float:
        """Measure an answer."""
        u = (self._moves @ point.v + self._problem.w) * self._lengths
        error, self.floor = self._law(u, point.r / self._lengths, *self._data), 0.0
        if error <= self._tolerance:
            found = error_of(self._problem, point)
            error = found.error
            self.floor = found.floor if found.hidden(error, found.floor, self._tolerance) else 0.0
        return error if math.isfinite(error) else math.inf

    def claimed(self, output: SolverOutput) -> SolverOutput:
        """Return the output whose answer was measured last, `inaccurate` where rounding hides its error."""
        if not self.floor or output.claim is not Claim.SOLVED:
            return output
        message = f"rounding makes errors up to {self.floor:.1e}"
        return replace(output, claim=Claim.INACCURATE, message=message)


def moving_parts(problem: GlobalContact) -> MovingParts | None:
    """Return a problem with its parts, those with the most contacts first; None where it is one part, or where nothing
    moves a contact. What no contact touches is one part."""
    nc, n, p = problem.nc, problem.f.size, problem.b.size
    if nc < 2:
        return None
    m = problem.w.size
    every = connected(problem, m + n + p, (problem.H, m, 0), (problem.M, m, m), (problem.G, m, m + n))
    label = np.concatenate([every[: m : problem.dimension], every[m:]])
    with_contacts, size = np.unique(label[:nc], return_counts=True)
    if size.size < 2 or not np.isin(with_contacts, label[nc : nc + n]).all():
        return None
    label = np.where(np.isin(label, with_contacts), label, -1)
    order = np.argsort(label, kind="stable")
    first = np.searchsorted(label[order], with_contacts)
    groups = np.split(order, first)
    found = [groups[1 + k] for k in np.argsort(-size, kind="stable")] + ([groups[0]] if groups[0].size else [])

    def part(at: Index) -> MovingPart:
        ends = np.searchsorted(at, [nc, nc + n])
        contacts, velocities, joints = np.split(at, ends)
        return MovingPart(contacts, velocities - nc, joints - nc - n)

    return MovingParts(problem, tuple(map(part, found)))


def restricted(problem: Any, part: MovingPart) -> Any:
    """Return the part as a problem by itself."""
    at, contacts, joints = part.velocities, part.contacts, part.joints
    rows = rows_of(contacts, problem.dimension)
    rolling = {"mu_r": problem.mu_r[contacts]} if hasattr(problem, "mu_r") else {}
    return type(problem)(
        M=_block(problem.M, at, at), H=_block(problem.H, at, rows), G=_block(problem.G, at, joints), f=problem.f[at],
        w=problem.w[rows], b=problem.b[joints], mu=problem.mu[contacts], dimension=problem.dimension, **rolling,
    )  # fmt: skip


def _block(A: Any, rows: Index, columns: Index) -> Any:
    return A[rows][:, columns] if is_sparse(A) else A[np.ix_(rows, columns)]


def solve_moving(
    whole: MovingParts,
    budget: Budget,
    start: GFCPoint | None,
    record: Record | None,
    run: Callable[[Any, Budget, GFCPoint | None, Record | None], SolverOutput],
) -> SolverOutput:
    """Return the answer of all parts, each solved by `run`."""
    problem, deadline = whole.problem, budget.deadline()
    first, d = problem.zero_point() if start is None else start, problem.dimension
    now = first.v.copy(), first.r.copy(), first.lam.copy()
    counters, failed = Counter[str](), []
    progress = None if record is None else _progress(record, whole, first)
    for k, part in enumerate(whole.parts):
        begin = None if start is None else part.start(start, d)
        look = None if progress is None else progress.of_part(k, counters["iterations"])
        output = run(restricted(problem, part), budget.left(deadline), begin, look)
        counters.update(output.counters)
        if output.point is not None:
            part.put(now, output.point, d)
        if output.claim is not Claim.SOLVED:
            failed.append((part.contacts.size, output))
    return claimed(GFCPoint(*now), dict(counters), failed, len(whole.parts))


class SolverByMovingParts(PartSolver):
    """A solver of global contact problems, by what `prepare` makes: with the `problem`, and the `point` of reactions.

    It ends within `SURE` of the tolerance: what a part is by itself and in the whole is the same up to rounding.
    """

    @abstractmethod
    def method(self, prepared: Any, budget: Budget, options: Any, r: Vector) -> ContactMethod:
        """Return the iterates of a part from the reactions r."""

    def solve_part(
        self, prepared: Any, budget: Budget, options: Any, start: Any, record: Record | None
    ) -> SolverOutput:
        r = np.zeros(prepared.problem.w.size) if start is None else np.array(start.r)
        sure = replace(budget, tolerance=SURE * budget.tolerance)
        error, method = DynamicsError(prepared.problem, sure.tolerance), self.method(prepared, budget, options, r)
        return error.claimed(iterate_on(error, prepared.point, method, sure, options, record))

    def setup(self, problem: Any, budget: Budget, options: Any) -> Any:
        """Return `MovingParts`, or what is prepared for a problem that is one part."""
        parts = moving_parts(problem)
        return self.prepare(problem, budget, options) if parts is None else parts

    def solve(
        self, prepared: Any, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        if not isinstance(prepared, MovingParts):
            return self.solve_part(prepared, budget, options, start, record)

        def run(part: Any, share: Budget, begin: Any, look: Record | None) -> SolverOutput:
            return self.solve_part(self.prepare(part, share, options), share, options, begin, look)

        return solve_moving(prepared, budget, start, record, run)


def _progress(record: Record, whole: MovingParts, point: GFCPoint) -> PartsProgress:
    now, d = (point.v.copy(), point.r.copy(), point.lam.copy()), whole.problem.dimension

    def put(k: int, own: GFCPoint) -> GFCPoint:
        whole.parts[k].put(now, own, d)
        return GFCPoint(*now)  # a copy

    errors = [error_of(restricted(whole.problem, x), x.start(point, d)).error for x in whole.parts]
    return PartsProgress(record, errors, put)
