"""Nonsmooth Gauss–Seidel by colours: contacts that share no block are solved by several threads at once.

The contacts lie in memory as they are solved, colour after colour. Those of one colour do not read each other's
reactions, so that an answer is the same to the last bit for any number of threads.
"""

from __future__ import annotations

from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Record, SolverOutput, SolverSpec, register
from cpbench_solvers.contact.by_parts import SolverByParts, contact_spec
from cpbench_solvers.contact.run import ContactMethod, MethodOptions, iterate
from cpbench_solvers.contact.sweeps import block_rows, conclude, kernel


@dataclass(frozen=True)
class ColouredOptions(MethodOptions):
    """Options of nsgs-coloured. `threads` : that share the contacts of a colour, worth it from 10⁴ contacts on."""

    threads: int = 1


@dataclass(frozen=True)
class Coloured:
    """The rows of W and the law of its contacts by colours: contact i here is `contacts[i]` of the problem, and colour
    k has the contacts bounds[k] ≤ i < bounds[k + 1]. `matrix`, `law` are the kernel's."""

    problem: FrictionContact
    contacts: NDArray[np.int64]
    bounds: NDArray[np.int64]
    matrix: tuple[Any, ...]
    law: tuple[Vector, Vector, Vector]

    @classmethod
    def of(cls, problem: FrictionContact) -> Coloured:
        nc, d, kernels = problem.nc, problem.dimension, kernel("coloured_sweeps")
        rows = block_rows(problem)
        reads = sp.csr_array((np.ones(rows.column.size, np.int8), rows.column, rows.start.astype(np.int64)), (nc, nc))
        both = sp.csr_array(reads + reads.T)  # W need not have a block where its transpose has one
        colour = np.zeros(nc, np.int64)
        many = kernels.colours(both.indptr.astype(np.uint64), both.indices.astype(np.uint32), colour)
        contacts = np.argsort(colour, kind="stable")
        place = np.empty(nc, np.int64)
        place[contacts] = np.arange(nc)
        start = np.concatenate([[0], np.cumsum(np.diff(rows.start.astype(np.int64))[contacts])]).astype(np.uint64)
        column, blocks = np.empty_like(rows.column), np.zeros_like(rows.blocks)
        kernels.reorder(rows.start, rows.column, rows.blocks, contacts, place, d * d, start, column, blocks)
        return cls(
            problem,
            contacts,
            np.concatenate([[0], np.cumsum(np.bincount(colour, minlength=many))]),
            (start, column, blocks, rows.diagonal[contacts], rows.local[contacts]),
            (problem.q.reshape(nc, d)[contacts].ravel(), problem.mu[contacts], problem.rho[contacts]),
        )

    def point(self, r: Vector) -> FCPoint:
        """Return reactions in the order of the colours as an answer."""
        return FCPoint(self.by_contact(r))

    def by_contact(self, r: Vector) -> Vector:
        """Return reactions r, shape (nc·d,), in the order of the contacts, from the order of the colours."""
        back = np.empty((self.contacts.size, self.problem.dimension))
        back[self.contacts] = r.reshape(back.shape)
        return back.ravel()

    def judged_error(self, r: Vector) -> float:
        if not r.size:
            return 0.0
        return kernel("contact_error").judged(*self.matrix[:4], *self.law, r, self.problem.dimension)

    def shares(self, threads: int) -> list[list[NDArray[np.int64]]]:
        """Return for every colour its contacts in as many shares, of about as many blocks each."""
        order, work = np.arange(self.contacts.size), self.matrix[0].astype(np.int64) + np.arange(self.contacts.size + 1)
        shares: list[list[NDArray[np.int64]]] = []
        for first, last in zip(self.bounds[:-1], self.bounds[1:], strict=True):
            levels = np.linspace(work[first], work[last], threads + 1)[1:-1]
            shares.append(np.split(order[first:last], np.searchsorted(work[first:last], levels)))
        return shares


class ColouredSweeps(ContactMethod):
    """Sweeps over the colours; a share of each is for the calling thread."""

    pieces: ClassVar[bool] = True

    def __init__(self, prepared: Coloured, r: Vector, threads: int, pool: ThreadPoolExecutor | None) -> None:
        self._prepared, self._r, self._pool = prepared, r, pool
        self._lam, self._shares = np.zeros(prepared.contacts.size), prepared.shares(threads)
        self.counters = {"projections": 0}

    @property
    def r(self) -> Vector:
        return self._r.copy()

    def step(self, many: int, error: float, seconds: float) -> str | None:
        part, prepared = kernel("coloured_sweeps").part, self._prepared
        data = (*prepared.matrix, *prepared.law, self._r, self._lam)
        for _ in range(many):
            for mine, *others in self._shares:
                pending = [self._pool.submit(part, *data, o, prepared.problem.dimension) for o in others if self._pool]
                part(*data, mine, prepared.problem.dimension)
                for other in pending:
                    other.result()
        self.counters["projections"] += many * prepared.contacts.size
        return None


@contextmanager
def helpers(threads: int) -> Generator[ThreadPoolExecutor | None]:
    """Return threads beside the calling one, for one solve: a process that is forked afterwards misses none."""
    if threads <= 1:
        yield None
        return
    with ThreadPoolExecutor(threads - 1) as pool:
        yield pool


@register
class NSGSColoured(SolverByParts):
    """Block Gauss–Seidel with exact one-contact solves, contacts in the order of their colours."""

    spec: ClassVar[SolverSpec] = contact_spec(
        name="nsgs-coloured",
        summary="nonsmooth Gauss-Seidel by colours, for several threads",
        method="splitting",
        citation="Jean and Moreau 1987; Adams and Ortega 1982, Int. Conf. Parallel Processing, 53",
        options=ColouredOptions,
        by_default=False,
    )

    def prepare(self, problem: FrictionContact, budget: Budget, options: ColouredOptions) -> Coloured:
        kernel("contact_error")
        return Coloured.of(problem)

    def solve_part(
        self, prepared: Coloured, budget: Budget, options: ColouredOptions, start: Any, record: Record | None
    ) -> SolverOutput:
        problem = prepared.problem
        r = np.zeros(problem.q.size) if start is None else start.r.reshape(problem.nc, -1)[prepared.contacts].ravel()
        limit, threads = budget.iterations or options.max_iterations, max(1, options.threads)
        with helpers(threads) as pool:
            method = ColouredSweeps(prepared, r, threads, pool)
            end = iterate(method, prepared.judged_error, prepared.point, budget, limit, options.stall_window, record)
        return conclude(problem, prepared.by_contact(end.r), end.error, budget, end.claim, end.message, end.counters)
