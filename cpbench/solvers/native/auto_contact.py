"""Frictional contact by whichever of Gauss–Seidel, Newton and ADMM promises to be done first, from what they cost."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.matrices import Matrix, Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.admm_contact import ADMMContactOptions, Splitting
from cpbench.solvers.native.contact_newton import ContactNewtonOptions, NewtonPhase
from cpbench.solvers.native.contact_sweeps import (
    AcceleratedSweeps,
    BlockRows,
    ScaledContacts,
    conclude,
    kernel,
    scaled_contacts,
)
from cpbench.solvers.native.progress import next_stop
from cpbench.solvers.options import fixed, searched

STEPS, ITERATIONS = 10, 300
"""What Newton's method and ADMM are expected to need, and three times as many after every failure."""
HARDER = 3.0
GAINED = 0.1
"""A method that took the error below this times what it was has not failed."""
PER_BLOCK, PER_CONTACT = 3.0, 25.0
"""Of an accelerated sweep: nanoseconds for a block of W and for a contact."""
STEP, PER_ENTRY, PER_CUBE = 5e5, 2.0, 0.02
"""Of a Newton step: nanoseconds for all calls, for an entry of W times √n when W is sparse, for n³ when it is dense."""
SOLVE_SHARE = 0.03
"""Of a Newton step that an iteration of ADMM is expected to take, before its factors are there to be counted."""
ITERATION, PER_FACTOR_ENTRY = 2e4, 1.5
"""Of an iteration of ADMM: nanoseconds for all calls and for an entry of the factors.

Not measured while it runs, so that the same problem takes the same way everywhere. The constants are those of one core
of an AMD EPYC of 2021 at 23 files of 20 to 935 contacts: costs counted by them and the measured ones are within a
factor of 2 of each other.
"""
PIECE = 2_000
"""Sweeps between two looks at the clock."""
WORDS = 12
"""Phases that the message tells of, the last ones."""


class Method(StrEnum):
    """What may be tried next."""

    SWEEPS = "sweeps"
    NEWTON = "newton"
    ADMM = "admm"


@dataclass(frozen=True)
class Standing:
    """What a decision is made from: the error now, how many sweeps were made in all, the nanoseconds of a sweep, a
    Newton step and an iteration of ADMM, and how often the last two have failed."""

    error: float
    sweeps: int
    sweep: float
    step: float
    iteration: float
    newton_failures: int = 0
    admm_failures: int = 0


def policy(standing: Standing, tolerance: float) -> Method:
    """The method that is expected to be done first; the sweeps to start with.

    Accelerated sweeps stand still for long and then gain a lot: they are expected to go on at the rate that they had on
    average, so that the time for which they may stand still grows with the time that they have taken.

    >>> new = Standing(error=1.0, sweeps=0, sweep=1e4, step=1e7, iteration=1e6)
    >>> policy(new, 1e-4), policy(replace(new, sweeps=100, error=1e-3), 1e-4)
    (<Method.SWEEPS: 'sweeps'>, <Method.SWEEPS: 'sweeps'>)
    >>> policy(replace(new, sweeps=100_000, error=1e-3), 1e-4)
    <Method.NEWTON: 'newton'>
    """
    if standing.sweeps == 0:
        return Method.SWEEPS
    gained = -math.log(standing.error) if 0 < standing.error < 1 else 0.0
    left = standing.sweeps * (-math.log(tolerance) / gained - 1.0) if gained > 0 else math.inf
    work = {
        Method.SWEEPS: left * standing.sweep,
        Method.NEWTON: STEPS * standing.step * HARDER**standing.newton_failures,
        Method.ADMM: ITERATIONS * standing.iteration * HARDER**standing.admm_failures,
    }
    return min(work, key=work.__getitem__)


@dataclass(frozen=True)
class AutoContactOptions:
    """`sweeps` : in the first phase. `max_iterations` : sweeps, Newton steps and iterations of ADMM together."""

    sweeps: int = searched(50, low=10, high=500, log=True)
    max_iterations: int = fixed(200_000)


@register
class AutoContact(Solver):
    """Accelerated sweeps first; then, phase by phase, what `policy` says. The message tells the phases and what they
    reached. Work is counted, not timed: the way to an answer is the same on every machine, and on a busy one.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="auto-contact",
        node="fc",
        summary="Gauss-Seidel with acceleration, Newton or ADMM, whichever promises to be done first",
        method="automatic choice",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=AutoContactOptions,
    )

    def setup(self, problem: FrictionContact, budget: Budget, options: AutoContactOptions) -> ScaledContacts:
        return scaled_contacts(problem)

    def warmup(self) -> None:
        for name in ("gauss_seidel", "anderson", "contact_splitting"):
            kernel(name)

    def solve(
        self,
        prepared: ScaledContacts,
        budget: Budget,
        options: AutoContactOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        run = _Run(prepared, budget, options, None if start is None else np.array(start.r), record)
        claim, message = Claim.MAX_ITER, f"{run.limit} iterations"
        while not run.error <= budget.tolerance and run.iterations < run.limit:
            run.phase()
            if time.monotonic() > run.deadline and not run.error <= budget.tolerance:
                claim, message = Claim.FAILED, f"out of time after {run.iterations} iterations"
                break
        output = conclude(prepared.rows.problem, run.best, run.error, budget, claim, message, run.counters)
        told = ", ".join(run.told[-WORDS:])
        return replace(output, message="; ".join(part for part in (told, output.message) if part))


class _Run:
    """The best point so far, what the methods cost and how they fared."""

    def __init__(
        self,
        contacts: ScaledContacts,
        budget: Budget,
        options: AutoContactOptions,
        start: Vector | None,
        record: Record | None,
    ) -> None:
        self._contacts, self._budget, self._record = contacts, budget, record
        self.limit = budget.iterations or options.max_iterations
        self.deadline = time.monotonic() + budget.seconds
        self.best = np.zeros(contacts.q.size) if start is None else start
        # a cold start is looked at after the first sweep only, unless somebody records it
        blind = start is None and record is None and self.best.size > 0
        self.error = math.inf if blind else contacts.rows.judged(self.best)
        self.iterations, self.told = 0, list[str]()
        self.counters = {"iterations": 0, "sweeps": 0, "newton_steps": 0, "admm_iterations": 0, "factorizations": 0}
        self._count = options.sweeps
        self._sweeps: AcceleratedSweeps | None = None
        self._newton: NewtonPhase | None = None
        step = _step_work(contacts.rows.problem.W)
        self._standing = Standing(self.error, 0, _sweep_work(contacts.rows), step, SOLVE_SHARE * step)
        if record is not None:
            record(0, self.error, lambda: FCPoint(self.best))

    def phase(self) -> None:
        """What the policy says, until it is done or has had what was expected of it."""
        before, method = self.error, policy(self._standing, self._budget.tolerance)
        match method:
            case Method.SWEEPS:
                done, unit = self._sweep(), "sweeps"
            case Method.NEWTON:
                done, unit = self._newton_steps(), "Newton steps"
            case _:
                done, unit = self._admm(), "ADMM iterations"
        self.told.append(f"{done} {unit} to {self.error:.1e}")
        failed = int(not self.error <= GAINED * before)
        now = replace(self._standing, error=self.error, sweeps=self.counters["sweeps"])
        match method:
            case Method.SWEEPS:
                self._standing = now
            case Method.NEWTON:
                self._standing = replace(now, newton_failures=now.newton_failures + failed)
            case Method.ADMM:
                self._standing = replace(now, admm_failures=now.admm_failures + failed)

    def _sweep(self) -> int:
        sweeps = self._sweeps
        if sweeps is None or self.error < sweeps.error:  # the first, or others have come nearer
            sweeps = self._sweeps = AcceleratedSweeps(self._contacts.rows, self.best)
        before = sweeps.done
        until, end = min(self._count, self.limit - self.iterations), self._budget.tolerance
        self._count = 2 * self._count
        # in pieces only where somebody wants to see the points between
        while sweeps.done - before < until and not sweeps.error <= end and time.monotonic() < self.deadline:
            done = sweeps.done
            piece = min(next_stop(done, before + until, self._record) - done, PIECE)
            finite = sweeps.sweep(piece, end)
            self._made("sweeps", sweeps.done - done)
            self._seen(sweeps.best, sweeps.error)
            if not finite:
                break
        return sweeps.done - before

    def _newton_steps(self) -> int:
        newton = self._newton = self._newton or NewtonPhase(self._contacts, ContactNewtonOptions())
        before = newton.factorizations
        newton.begin(self.best)
        done = self._repeat("newton_steps", 3 * STEPS, newton.step, lambda: newton.r)
        self.counters["factorizations"] += newton.factorizations - before
        return done

    def _admm(self) -> int:
        splitting = Splitting(self._contacts, ADMMContactOptions(), self.best)
        most = int(ITERATIONS * HARDER**self._standing.admm_failures)
        done = self._repeat("admm_iterations", most, splitting.step, lambda: splitting.r)
        self.counters["factorizations"] += splitting.factorizations
        self._standing = replace(self._standing, iteration=ITERATION + PER_FACTOR_ENTRY * splitting.entries)
        return done

    def _repeat(self, name: str, most: int, step: Callable[[], bool], answer: Callable[[], Vector]) -> int:
        done = 0
        while done < most and self.iterations < self.limit and time.monotonic() < self.deadline:
            if not step():
                break
            done += 1
            self._made(name, 1)
            r = answer()
            self._seen(r, self._contacts.rows.judged(r))
            if self.error <= self._budget.tolerance:
                break
        return done

    def _made(self, name: str, count: int) -> None:
        self.iterations += count
        self.counters["iterations"] = self.iterations
        self.counters[name] += count

    def _seen(self, r: Vector, error: float) -> None:
        if error < self.error:
            self.error = error
            self.best = best = r.copy()
            if self._record is not None:
                self._record(self.iterations, error, lambda: FCPoint(best))


def _sweep_work(rows: BlockRows) -> float:
    """Nanoseconds of an accelerated sweep."""
    return PER_BLOCK * rows.column.size + PER_CONTACT * rows.problem.nc


def _step_work(W: Matrix) -> float:
    """Nanoseconds of a Newton step."""
    n = W.shape[0]
    return STEP + (PER_ENTRY * W.nnz * math.sqrt(n) if sp.issparse(W) else PER_CUBE * n**3)
