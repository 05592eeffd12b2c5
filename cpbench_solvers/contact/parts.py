"""Connected parts of a local contact problem, and how wrong reactions are in each."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cpbench.formulations.local_contact import FrictionContact, RollingFrictionContact
from cpbench.foundation.matrices import EPS, Vector
from cpbench.solvers.base import Budget, Record, Solver, SolverOutput, solved
from cpbench_solvers.contact.rolling_blocks import RollingBlocks, rolling_blocks
from cpbench_solvers.contact.sweeps import BlockRows, ScaledContacts, block_rows
from cpbench_solvers.kernels import part_error

Index = NDArray[np.int64]
Contact = FrictionContact | RollingFrictionContact

NO_ROLLING = np.zeros(0)
ROUNDINGS = 8.0
"""Roundings of the largest term that a sum may carry."""
FEW = 20
"""Numbers of which Python finds the least sooner than NumPy."""
DENSE = 100
"""Parts of at most so many rows are full matrices: sparse ones take longer to make than to solve."""


class PartSolver(Solver):
    """A solver that solves connected parts of a problem by themselves.

    The answer is solved where every part is. A limit of iterations is one of each part, that of time one of all.
    """

    @abstractmethod
    def prepare(self, problem: Any, budget: Budget, options: Any) -> Any:
        """Do what `setup` of a solver does, for one part."""

    @abstractmethod
    def solve_part(
        self, prepared: Any, budget: Budget, options: Any, start: Any, record: Record | None
    ) -> SolverOutput:
        """Do what `solve` of a solver does, for one part."""


@dataclass(eq=False)
class MeasuredParts:
    """A problem of one or more connected parts, and how wrong reactions are in each of them.

    Attributes
    ----------
    label : (nc,), the number of the part of each contact. count : how many parts there are.
    """

    blocks: BlockRows | RollingBlocks
    label: Index
    count: int

    def errors(self, r: Vector) -> Vector:
        """Return the error of the reactions r, shape (nc·d,), in every part."""
        blocks, result = self.blocks, np.empty(self.count)
        problem = blocks.problem
        if isinstance(blocks, RollingBlocks):
            law = *blocks.law[:4], r / blocks.lengths
        else:
            law = problem.q, problem.mu, NO_ROLLING, blocks.rho, r
        part_error.part_error(*blocks.matrix, *law, problem.dimension, self.label, result)
        return result


class ContactPart(NamedTuple):
    """A connected part of a problem: its rows in W, and what the method prepared for it."""

    rows: Index | slice
    measured: MeasuredParts
    prepared: Any

    @classmethod
    def of(cls, rows: Index | slice, problem: Contact, prepared: Any) -> ContactPart:
        """Take the part with these rows, a problem by itself."""
        blocks = prepared.rows if isinstance(prepared, ScaledContacts) else prepared
        if not isinstance(blocks, (BlockRows, RollingBlocks)):
            blocks = rows_of_blocks(problem)
        return cls(rows, MeasuredParts(blocks, np.zeros(problem.nc, np.int64), 1), prepared)

    @property
    def problem(self) -> Contact:
        """The part as a problem."""
        return self.measured.blocks.problem

    def error(self, r: Vector) -> float:
        """Return the error of the reactions r of this part, shape (nc·d,)."""
        return float(self.measured.errors(r)[0])

    def hidden(self, answer: Vector, tolerance: float) -> bool:
        """Return whether rounding hides that the error of these reactions is within the tolerance.

        Most are far from that by |W_ij| ≤ d/min ρ, as it is of a W that is positive semidefinite.
        """
        blocks, r = self.measured.blocks, answer
        problem = blocks.problem
        d = problem.dimension
        if isinstance(blocks, RollingBlocks):
            q, _, _, rho, _ = blocks.law
            r = r / blocks.lengths
        else:
            q, rho = problem.q, blocks.rho
        # by Cauchy's inequality: ‖q‖₂/√n ≤ ‖q‖∞ and ‖r‖₁ ≤ √n‖r‖₂, for sums take longer
        size = math.sqrt(q.dot(q))
        least = min(rho.tolist()) if rho.size <= FEW else np.minimum.reduce(rho)
        pushed = d / least * math.sqrt(q.size * r.dot(r))
        if d * ROUNDINGS * EPS * (pushed + size) < tolerance * size / math.sqrt(q.size):
            return False
        return rounding_error(problem, answer, np.zeros(problem.nc, np.int64)) >= tolerance


@dataclass(frozen=True)
class ContactParts:
    """A problem that has several parts: as a whole, and the contacts of each; `make` prepares one part."""

    whole: MeasuredParts
    contacts: tuple[Index, ...]
    make: Callable[[Index], ContactPart]

    def __getitem__(self, k: int) -> ContactPart:
        """Return the part with this number, prepared when it is first asked for."""
        if k not in self._made:
            self._made[k] = self.make(self.contacts[k])
        return self._made[k]

    @cached_property
    def _made(self) -> dict[int, ContactPart]:
        return {}


class PartsProgress:
    """The record of a run over all parts: the error is that of the worst part so far.

    Iterations are counted over all parts. The start of a part is the answer of the part before it, and not recorded
    again.

    errors : of the parts at first. put : (k, answer of part k) -> the whole answer with it.
    """

    def __init__(self, record: Record, errors: list[float], put: Callable[[int, Any], Any]) -> None:
        self._record, self._errors, self._put = record, errors, put
        self._last = -1

    def of_part(self, k: int, before: int) -> Record:
        """Return the record of part k, which begins after `before` iterations."""

        def look(done: int, error: float, point: Callable[[], Any]) -> None:
            now = self._put(k, point())
            self._errors[k] = error
            if before + done > self._last:
                self._last = before + done
                self._record(self._last, max(self._errors), lambda: now)

        return look


def claimed(point: Any, counters: dict[str, int], failed: list[tuple[int, SolverOutput]], count: int) -> SolverOutput:
    """Return the answer of `count` parts, solved where all are; `failed` : contacts and output of the others."""
    if not failed:
        return solved(point, counters)
    contacts, output = failed[0]
    message = f"{len(failed)} of {count} connected parts, the first of {contacts} contacts"
    message = f"{message}: {output.message or output.claim}"
    return SolverOutput(claim=output.claim, point=point, counters=counters, message=message)


def rows_of_blocks(problem: Contact) -> BlockRows | RollingBlocks:
    """Return W by rows of blocks."""
    return rolling_blocks(problem) if isinstance(problem, RollingFrictionContact) else block_rows(problem)


def rounding_error(problem: Contact, r: Vector, label: Index) -> float:
    """Return what rounding may make of the velocities of reactions, over the free velocities of their part."""
    lengths, d = problem.lengths.ravel(), problem.dimension
    sums = (abs(problem.W) @ np.abs(r) + np.abs(problem.q)) * lengths
    noise, free = (np.linalg.norm(x.reshape(-1, d), axis=1) for x in (ROUNDINGS * EPS * sums, problem.q * lengths))
    size = np.zeros(1 + label.max(initial=0))
    np.maximum.at(size, label, free)
    size = np.where(size > 2.0**-40 * size.max(), size, size.max())[label]
    return float(np.divide(noise, size, out=np.zeros(noise.size), where=size > 0).max(initial=0.0))


def error_or_rounding(problem: Contact, r: Vector, tolerance: float) -> float:
    """Return the largest error of a part, and where rounding hides it at the tolerance, what that may make of it."""
    parts = connected_parts(problem)
    label = labels_of(parts, problem.nc)
    error = float(MeasuredParts(rows_of_blocks(problem), label, len(parts)).errors(r).max(initial=0.0))
    floor = rounding_error(problem, r, label)
    return floor if max(error, tolerance) <= floor else error


def at_rest(q: Vector, d: int) -> bool:
    """Return whether r = 0 solves contacts with these free velocities: wherever q_N ≥ 0, the dual cone has û, with
    rolling friction too."""
    return q.size == 0 or (q[0] >= 0.0 and bool((q[::d] >= 0.0).all()))


def at_hand(point: Any, counters: dict[str, int], record: Record | None) -> SolverOutput:
    """Return the output of a solver whose first point is the answer."""
    if record is not None:
        record(0, 0.0, lambda: point)
    return solved(point, counters)


def labels_of(parts: list[Index], count: int) -> Index:
    """Return the number of the part of each of `count` contacts."""
    label = np.empty(count, np.int64)
    for k, contacts in enumerate(parts):
        label[contacts] = k
    return label


def connected_parts(problem: Contact) -> list[Index]:
    """Return the contacts of every connected part of W, largest part first."""
    W, nc, d = problem.W, problem.nc, problem.dimension
    if nc < 2:
        return [np.arange(nc)]
    if isinstance(W, np.ndarray):
        # the first contact leads to all: most small problems, and most of these by the normals alone
        if np.count_nonzero(W[0, ::d]) == nc or W[:d].reshape(d, nc, d).any(axis=(0, 2)).all():
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


def rows_of(contacts: Index, d: int) -> Index:
    """Return the rows of contacts in W."""
    return (d * contacts[:, None] + np.arange(d)).ravel()


def part_of(problem: Contact, contacts: Index, rows: Index, position: Index) -> Contact:
    """Return the part with these contacts as a problem; `place` : of the contacts in it."""
    W, d = problem.W, problem.dimension
    if isinstance(W, np.ndarray):
        block: Any = W[np.ix_(rows, rows)]
    else:
        W = sp.csr_array(W)
        lengths = W.indptr[rows + 1] - W.indptr[rows]
        start = np.concatenate([[0], np.cumsum(lengths)])
        at = np.arange(start[-1]) + np.repeat(W.indptr[rows] - start[:-1], lengths)
        some = W.data[at] != 0.0  # all of them are in columns of the part
        at, row = at[some], np.repeat(np.arange(rows.size), lengths)[some]
        column = d * position[W.indices[at] // d] + W.indices[at] % d
        if rows.size <= DENSE:
            block = np.zeros((rows.size, rows.size))
            block[row, column] = W.data[at]
        else:
            block = sp.csr_array((W.data[at], (row, column)), shape=(rows.size, rows.size))
    data: dict[str, Any] = {"W": block, "q": problem.q[rows], "mu": problem.mu[contacts], "dimension": d}
    if isinstance(problem, RollingFrictionContact):
        return RollingFrictionContact(**data, mu_r=problem.mu_r[contacts])
    return FrictionContact(**data)
