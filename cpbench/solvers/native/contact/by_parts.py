"""Solves the connected parts of a local contact problem one after the other.

A pile is many clusters of bodies. A norm over all of them says little of the small ones, and sweeps over all of them
are made until the slowest has converged. Each part ends by its own error, so that the work is that of the parts.

A method ends by norms that it has at hand. An answer that passes these is measured once by the sizes that the contacts
in use set (the kernel `part_energy`); where that is more than the tolerance, the method goes on, to an error as much
smaller.
"""

from __future__ import annotations

import time
from abc import abstractmethod
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cpbench.formulations.base import Kind
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.kernel_cache import compiled
from cpbench.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, solved, solved_at
from cpbench.solvers.native.contact.sweeps import BlockRows, ScaledContacts, block_rows, kernel

Index = NDArray[np.int64]


ROUNDS = 6
"""Times that a method goes on to a smaller error of its own."""
SURE = 0.995
"""Share of the tolerance that is claimed: the verdict has an equilibration of its own, to a thousandth."""
SAFE = 0.5
"""Share of the error that is asked for where a method goes on."""


@dataclass(frozen=True)
class ContactPart:
    """A connected part of a problem.

    Attributes
    ----------
    rows : its rows in W. prepared : what the method prepared for it. weights : norms of its blocks and units of its
    contacts, as `part_energy` takes them.
    """

    rows: Index
    blocks: BlockRows
    prepared: Any
    weights: tuple[Vector, ...]

    @classmethod
    def of(cls, rows: Index, problem: FrictionContact, prepared: Any) -> ContactPart:
        """Take the part with these rows, a problem by itself."""
        blocks = prepared.rows if isinstance(prepared, ScaledContacts) else prepared
        if not isinstance(blocks, BlockRows):
            blocks = block_rows(problem)
        nc = problem.nc
        weights = np.empty(blocks.column.size), np.empty(nc), np.empty(nc), np.empty(nc)
        matrix = blocks.start, blocks.column, blocks.blocks, blocks.diagonal
        compiled(kernel("part_energy").weights)(*matrix, problem.dimension, *weights)
        return cls(rows, blocks, prepared, weights)

    def error(self, r: Vector) -> float:
        """Return the error of the reactions r of this part, shape (nc·d,)."""
        blocks, problem = self.blocks, self.blocks.problem
        matrix = blocks.start, blocks.column, blocks.blocks, blocks.diagonal
        law = problem.q, problem.mu, r, problem.dimension
        return float(compiled(kernel("part_energy").part_energy)(*matrix, *law, *self.weights))


@dataclass(frozen=True)
class ContactParts:
    """The parts of a problem; `size` : its rows."""

    parts: tuple[ContactPart, ...]
    size: int


class SolverByParts(Solver):
    """A solver of local contact problems that solves connected parts by themselves.

    A subclass says what it prepares for one part and how it solves that. The answer claims to be solved where every
    part does. A limit of iterations is one of each part, that of time is one of all.
    """

    @abstractmethod
    def prepare(self, problem: FrictionContact, budget: Budget, options: Any) -> Any:
        """Do what `setup` of a solver does, for one part."""

    @abstractmethod
    def solve_part(
        self, prepared: Any, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        """Do what `solve` of a solver does, for one part."""

    def setup(self, problem: FrictionContact, budget: Budget, options: Any) -> ContactParts:
        found = connected_parts(problem)
        parts = []
        for contacts in found:
            rows = _rows(contacts, problem.dimension)
            part = problem if len(found) == 1 else _part(problem, contacts, rows)
            parts.append(ContactPart.of(rows, part, self.prepare(part, budget, options)))
        return ContactParts(tuple(parts), problem.q.size)

    def solve(
        self,
        prepared: ContactParts,
        budget: Budget,
        options: Any,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        if len(prepared.parts) == 1:
            return self._solved(prepared.parts[0], budget, options, start, record)
        r = np.zeros(prepared.size) if start is None else np.array(start.r)
        deadline, counters, failed = time.monotonic() + budget.seconds, Counter[str](), []
        progress = None if record is None else _Progress(record, prepared, r, budget)
        for k, part in enumerate(prepared.parts):
            left = replace(budget, seconds=max(deadline - time.monotonic(), 0.0))
            begin = None if start is None else FCPoint(r[part.rows])
            look = None if progress is None else progress.of_part(k, counters["iterations"])
            output = self._solved(part, left, options, begin, look)
            counters.update(output.counters)
            if output.point is not None:
                r[part.rows] = output.point.r
            if output.claim is not Claim.SOLVED:
                failed.append((k, output))
        if not failed:
            return solved_at(FCPoint, r, dict(counters))
        k, output = failed[0]
        contacts = prepared.parts[k].blocks.problem.nc
        message = f"{len(failed)} of {len(prepared.parts)} connected parts, the first of {contacts} contacts"
        message = f"{message}: {output.message or output.claim}"
        return SolverOutput(claim=output.claim, point=FCPoint(r), counters=dict(counters), message=message)

    def _solved(
        self, part: ContactPart, budget: Budget, options: Any, start: Any | None, record: Record | None
    ) -> SolverOutput:
        """Solve one part; go on where its error is not small enough by the sizes of the contacts in use."""
        begun = time.monotonic()
        output = self.solve_part(part.prepared, budget, options, start, record)
        relaxed = self.spec.kind is Kind.RELAXATION  # the answer is one to another law
        if output.point is None or output.claim is not Claim.SOLVED or relaxed or not part.blocks.problem.nc:
            return output
        error, asked, enough = part.error(output.point.r), budget.tolerance, SURE * budget.tolerance
        for _ in range(ROUNDS):
            if error <= enough:
                return output
            asked *= SAFE * budget.tolerance / error
            left = replace(budget, tolerance=asked, seconds=max(begun + budget.seconds - time.monotonic(), 0.0))
            further = self.solve_part(part.prepared, left, options, output.point, record)
            counters = Counter(output.counters)
            counters.update(further.counters)
            now = error if further.point is None else part.error(further.point.r)
            output = (further if now < error else output).retold(dict(counters), further.message)
            error = min(now, error)
            if further.claim is not Claim.SOLVED:
                break
        if error <= enough:
            return solved(output.point, output.counters)
        message = f"error {error:.1e} by the sizes of the contacts in use"
        message = f"{output.message}; {message}" if output.message else message
        return SolverOutput(claim=Claim.INACCURATE, point=output.point, counters=output.counters, message=message)


class _Progress:
    """The record of a run over all parts: the error is that of the worst part so far."""

    def __init__(self, record: Record, parts: ContactParts, r: Vector, budget: Budget) -> None:
        self._record, self._parts, self._r = record, parts, r.copy()
        points = [FCPoint(r[part.rows]) for part in parts.parts]
        self._errors = [
            part.blocks.problem.residuals(point, budget.tolerance).error
            for part, point in zip(parts.parts, points, strict=True)
        ]

    def of_part(self, k: int, before: int) -> Record:
        """Return the record of part k, which begins after `before` iterations."""

        def look(done: int, error: float, point: Any) -> None:
            self._r = self._r.copy()
            self._r[self._parts.parts[k].rows] = point().r
            self._errors[k] = error
            now = self._r
            self._record(before + done, max(self._errors), lambda: FCPoint(now))

        return look


def connected_parts(problem: FrictionContact) -> list[Index]:
    """Return the contacts of every connected part of W, largest part first."""
    W, nc, d = problem.W, problem.nc, problem.dimension
    if nc < 2:
        return [np.arange(nc)]
    if isinstance(W, np.ndarray):
        if W[:d].reshape(d, nc, d).any(axis=(0, 2)).all():  # the first contact leads to all: most small problems
            return [np.arange(nc)]
        graph = sp.csr_array(W.reshape(nc, d, nc, d).any(axis=(1, 3)))
    else:
        W = sp.csr_array(W)
        if not W.data.all():
            W = W.copy()
            W.eliminate_zeros()
        graph = sp.csr_array((np.ones(W.nnz), W.indices // d, W.indptr[::d].copy()), shape=(nc, nc))
    count, label = connected_components(graph, directed=False)
    if count == 1:
        return [np.arange(nc)]
    order = np.argsort(label, kind="stable")
    return sorted(np.split(order, np.cumsum(np.bincount(label))[:-1]), key=len, reverse=True)


def _rows(contacts: Index, d: int) -> Index:
    return (d * contacts[:, None] + np.arange(d)).ravel()


def _part(problem: FrictionContact, contacts: Index, rows: Index) -> FrictionContact:
    W = problem.W
    block = W[np.ix_(rows, rows)] if isinstance(W, np.ndarray) else sp.csr_array(W)[rows][:, rows]
    return FrictionContact(W=block, q=problem.q[rows], mu=problem.mu[contacts], dimension=problem.dimension)
