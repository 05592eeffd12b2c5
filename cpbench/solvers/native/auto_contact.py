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
from cpbench.solvers.native.contact_sweeps import ScaledContacts, Sweeps, conclude, scaled_contacts
from cpbench.solvers.options import fixed, searched

STEPS, ITERATIONS = 10, 300
"""What Newton's method and ADMM are expected to need, and three times as many after every failure."""
HARDER = 3.0
PER_ENTRY, PER_CUBE, CALLS = 2e-9, 2e-11, 1e-3
"""Seconds of a Newton step before one was measured: of a sparse entry times √n, of n³ when dense, of all else."""
SOLVE_SHARE = 0.1
"""Of a factorization's time that an iteration of ADMM is expected to take, before one was measured."""
GAINED = 0.1
"""A method that took the error below this times what it was has not failed."""
WORDS = 12
"""Phases that the message tells of, the last ones."""


class Method(StrEnum):
    """What may be tried next."""

    SWEEPS = "sweeps"
    NEWTON = "newton"
    ADMM = "admm"


@dataclass(frozen=True)
class Standing:
    """What a decision is made from: the error now, by how much a sweep multiplies it (NaN when none was made), seconds
    of a sweep, a Newton step and an iteration of ADMM, and how often the last two have failed."""

    error: float
    rate: float
    sweep: float
    step: float
    iteration: float
    newton_failures: int = 0
    admm_failures: int = 0


def policy(standing: Standing, tolerance: float) -> Method:
    """The method that is expected to be done first; the sweeps to start with.

    >>> fast = Standing(error=1e-3, rate=0.9, sweep=1e-5, step=1e-2, iteration=1e-3)
    >>> policy(fast, 1e-4), policy(replace(fast, rate=0.99999), 1e-4)
    (<Method.SWEEPS: 'sweeps'>, <Method.NEWTON: 'newton'>)
    """
    if math.isnan(standing.rate):
        return Method.SWEEPS
    left = math.log(tolerance / standing.error) / math.log(standing.rate) if 0 < standing.rate < 1 else math.inf
    seconds = {
        Method.SWEEPS: left * standing.sweep,
        Method.NEWTON: STEPS * standing.step * HARDER**standing.newton_failures,
        Method.ADMM: ITERATIONS * standing.iteration * HARDER**standing.admm_failures,
    }
    return min(seconds, key=seconds.__getitem__)


@dataclass(frozen=True)
class AutoContactOptions:
    """`sweeps` : in the first phase. `max_iterations` : sweeps, Newton steps and iterations of ADMM together."""

    sweeps: int = searched(50, low=10, high=500, log=True)
    max_iterations: int = fixed(200_000)


@register
class AutoContact(Solver):
    """Sweeps first; then, phase by phase, what `policy` says. The phases and what they reached are in the message.

    The costs are measured, so that another machine, or a busy one, may take another way to an answer.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="auto-contact",
        node="fc",
        summary="Gauss-Seidel, Newton or ADMM, whichever promises to be done first",
        method="automatic choice",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY}),
        options=AutoContactOptions,
    )

    def setup(self, problem: FrictionContact, budget: Budget, options: AutoContactOptions) -> ScaledContacts:
        return scaled_contacts(problem)

    def warmup(self) -> None:
        from cpbench.solvers.native.contact_sweeps import kernel

        kernel("gauss_seidel")
        kernel("contact_splitting")

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
        self.error = contacts.rows.judged(self.best)
        self.iterations, self.told = 0, list[str]()
        self.counters = {"iterations": 0, "sweeps": 0, "newton_steps": 0, "admm_iterations": 0, "factorizations": 0}
        self._count = options.sweeps
        step = _foreseen(contacts.W)
        self._standing = Standing(self.error, math.nan, 0.0, step, SOLVE_SHARE * step)
        if contacts.q.size:
            self._sweeps = Sweeps(contacts.rows)
            self._newton = NewtonPhase(contacts, ContactNewtonOptions())
        if record is not None:
            record(0, self.error, lambda: FCPoint(self.best))

    def phase(self) -> None:
        """What the policy says, until it is done or has had what was expected of it."""
        before, method = self.error, policy(self._standing, self._budget.tolerance)
        began = time.perf_counter()
        match method:
            case Method.SWEEPS:
                done, unit = self._sweep(), "sweeps"
            case Method.NEWTON:
                done, unit = self._newton_steps(), "Newton steps"
            case _:
                done, unit = self._admm(), "ADMM iterations"
        cost = (time.perf_counter() - began) / max(done, 1)
        self.told.append(f"{done} {unit} to {self.error:.1e}")
        failed = int(not self.error <= GAINED * before)
        now = replace(self._standing, error=self.error)
        # one that gains goes on; after a failure sweeps are tried anew, for they start from elsewhere
        rate = math.nan if failed else self._standing.rate
        match method:
            case Method.SWEEPS:
                self._standing = replace(now, rate=(self.error / before) ** (1.0 / max(done, 1)), sweep=cost)
            case Method.NEWTON:
                failures = self._standing.newton_failures + failed
                self._standing = replace(now, rate=rate, step=cost, newton_failures=failures)
            case Method.ADMM:
                failures = self._standing.admm_failures + failed
                self._standing = replace(now, rate=rate, iteration=cost, admm_failures=failures)

    def _sweep(self) -> int:
        r, before = self.best.copy(), self._sweeps.done
        error = self._sweeps.sweep(r, min(self._count, self.limit - self.iterations), self._budget.tolerance)
        done = self._sweeps.done - before
        self._count = 2 * self._count
        self._made("sweeps", done)
        self._seen(r, error)
        return done

    def _newton_steps(self) -> int:
        before = self._newton.factorizations
        self._newton.begin(self.best)
        done = self._repeat("newton_steps", 3 * STEPS, self._newton.step, lambda: self._newton.r)
        self.counters["factorizations"] += self._newton.factorizations - before
        return done

    def _admm(self) -> int:
        splitting = Splitting(self._contacts, ADMMContactOptions(), self.best)
        most = int(ITERATIONS * HARDER**self._standing.admm_failures)
        done = self._repeat("admm_iterations", most, splitting.step, lambda: splitting.r)
        self.counters["factorizations"] += splitting.factorizations
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
            self.best, self.error = r, error
            if self._record is not None:
                self._record(self.iterations, error, lambda: FCPoint(r))


def _foreseen(W: Matrix) -> float:
    """Seconds of a Newton step, before one was measured."""
    n = W.shape[0]
    if sp.issparse(W):
        return CALLS + PER_ENTRY * W.nnz * math.sqrt(n)
    return CALLS + PER_CUBE * n**3
