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
from cpbench.foundation.matrices import Vector, is_sparse
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput
from cpbench_solvers.contact.by_parts import SURE
from cpbench_solvers.contact.dynamics_error import DynamicsError, moving_labels
from cpbench_solvers.contact.parts import PartSolver, PartsProgress, claimed, rows_of
from cpbench_solvers.contact.run import ContactMethod, iterate_on

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


def moving_parts(problem: GlobalContact) -> MovingParts | None:
    """Return a problem with its parts, those with the most contacts first; None where it is one part, or where nothing
    moves a contact. What no contact touches is one part."""
    nc, n = problem.nc, problem.f.size
    if nc < 2:
        return None
    label = np.concatenate(moving_labels(problem))
    with_contacts, size = np.unique(label[:nc], return_counts=True)
    if size.size < 2 or not np.isin(with_contacts, label[nc : nc + n]).all():
        return None
    label = np.where(np.isin(label, with_contacts), label, -1)
    order = np.argsort(label, kind="stable")
    first = np.searchsorted(label[order], with_contacts)
    groups = np.split(order, first)
    largest_first = [groups[1 + k] for k in np.argsort(-size, kind="stable")] + ([groups[0]] if groups[0].size else [])

    def part(at: Index) -> MovingPart:
        ends = np.searchsorted(at, [nc, nc + n])
        contacts, velocities, joints = np.split(at, ends)
        return MovingPart(contacts, velocities - nc, joints - nc - n)

    return MovingParts(problem, tuple(map(part, largest_first)))


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

    errors = [DynamicsError(restricted(whole.problem, x), math.inf)(x.start(point, d)) for x in whole.parts]
    return PartsProgress(record, errors, put)
