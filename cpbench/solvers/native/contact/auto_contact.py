"""Frictional contact by whichever of Gauss–Seidel, Newton and ADMM promises to be done first, from what they cost."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.contact.admm_contact import ADMMContactOptions, Splitting
from cpbench.solvers.native.contact.contact_policy import (
    HARDER,
    ITERATION,
    ITERATIONS,
    PER_FACTOR_ENTRY,
    SOLVE_SHARE,
    STEPS,
    Method,
    Standing,
    policy,
    step_work,
    sweep_work,
)
from cpbench.solvers.native.contact.contact_sweeps import (
    AcceleratedSweeps,
    ScaledContacts,
    conclude,
    kernel,
    scaled_contacts,
)
from cpbench.solvers.native.contact.proximal_newton import ProximalNewtonOptions, ProximalSteps
from cpbench.solvers.options import fixed, searched

GAINED = 0.1
"""A method that took the error below this times what it was has not failed."""
SHORTER = 8
"""Sweeps are so many times fewer again where another method has come much nearer."""
PIECE = 2_000
"""Sweeps between two looks at the clock."""
WORDS = 12
"""Phases that the message tells of, the last ones."""
ROUNDED = "converged up to rounding"


@dataclass(frozen=True)
class AutoContactOptions:
    """`sweeps` : in the first phase. `max_iterations` : sweeps, Newton steps and iterations of ADMM together."""

    sweeps: int = searched(50, low=10, high=500, log=True)
    max_iterations: int = fixed(200_000)


@register
class AutoContact(Solver):
    """Accelerated sweeps first; then, phase by phase, what `policy` says. The message tells the phases and what they
    reached where there were several. Work is counted, not timed: the way to an answer is the same on every machine,
    and on a busy one.
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
        rows, limit = prepared.rows, budget.iterations or options.max_iterations
        deadline = time.monotonic() + budget.seconds
        sweeps = AcceleratedSweeps(rows, None if start is None else start.r)
        look = None
        if record is not None:
            begin = np.zeros(prepared.q.size) if start is None else start.r
            record(0, rows.judged(begin), lambda: FCPoint(begin))
            look = partial(_tell, record, sweeps)
        sweeps.sweep(min(options.sweeps, limit), budget.tolerance, look)
        # most small problems are done here, in less time than it takes to prepare for more
        if sweeps.error <= budget.tolerance:
            counters = _counters(sweeps.done)
            return conclude(rows.problem, sweeps.best, sweeps.error, budget, Claim.INACCURATE, ROUNDED, counters)
        run = _Run(prepared, budget, options, sweeps, deadline, record)
        claim, message = Claim.MAX_ITER, f"{limit} iterations"
        while not run.error <= budget.tolerance and run.iterations < limit:
            if time.monotonic() > deadline:
                claim, message = Claim.FAILED, f"out of time after {run.iterations} iterations"
                break
            run.phase()
        if run.error <= budget.tolerance:
            claim, message = Claim.INACCURATE, ROUNDED
        output = conclude(rows.problem, run.best, run.error, budget, claim, message, run.counters)
        told = (", ".join(run.told[-WORDS:]), output.message)
        return replace(output, message="; ".join(part for part in told if part))


def _tell(record: Record, sweeps: AcceleratedSweeps) -> None:
    record(sweeps.done, sweeps.error, lambda: FCPoint(sweeps.best))


def _counters(sweeps: int) -> dict[str, int]:
    return {"iterations": sweeps, "sweeps": sweeps, "newton_steps": 0, "admm_iterations": 0, "factorizations": 0}


class _Run:
    """What comes after the first sweeps: the best point so far, what the methods cost and how they fared."""

    def __init__(
        self,
        contacts: ScaledContacts,
        budget: Budget,
        options: AutoContactOptions,
        sweeps: AcceleratedSweeps,
        deadline: float,
        record: Record | None,
    ) -> None:
        self._contacts, self._budget, self._record = contacts, budget, record
        self.limit, self.deadline = budget.iterations or options.max_iterations, deadline
        self.best, self.error, self.iterations = sweeps.best.copy(), sweeps.error, sweeps.done
        self.counters = _counters(sweeps.done)
        self.told = [f"{sweeps.done} sweeps to {sweeps.error:.1e}"]
        self._first, self._count, self._starts = options.sweeps, 2 * options.sweeps, 0
        self._sweeps: AcceleratedSweeps | None = sweeps
        self._proximal: ProximalSteps | None = None
        self._drifted: Vector | None = None
        self._mark = self.error
        step = step_work(contacts.rows.problem.W)
        self._standing = Standing(self.error, sweeps.done, sweep_work(contacts.rows), step, SOLVE_SHARE * step)

    def phase(self) -> None:
        """What the policy says, until it is done or has had what was expected of it."""
        before, method = self.error, policy(self._standing, self._budget.tolerance)
        match method:
            case Method.SWEEPS:
                done, unit = self._sweep(), "sweeps"
            case Method.NEWTON:
                done, unit = self._proximal_points(), "Newton steps to proximal points"
            case _:
                done, unit = self._admm(), "ADMM iterations"
        self.told.append(f"{done} {unit} to {self.error:.1e}")
        if self.error <= self._budget.tolerance:
            return
        failed = not self.error <= GAINED * before
        nearer = self.error <= GAINED * self._mark
        if method is not Method.SWEEPS:  # sweeps stood still before: others go on, or the same ones from much nearer
            self._sweeps, self._starts = None, self._starts + 1 if failed else 0
        now = replace(self._standing, error=self.error, sweeps=self.counters["sweeps"])
        if nearer:  # from so much nearer, what failed may not
            self._mark = self.error
            if method is not Method.SWEEPS:
                self._count = max(self._count // SHORTER, self._first)
            self._standing = replace(now, newton_failures=0, admm_failures=0, idle_sweeps=0)
        elif method is Method.NEWTON:
            self._standing = replace(now, newton_failures=now.newton_failures + 1)
        elif method is Method.ADMM:
            self._standing = replace(now, admm_failures=now.admm_failures + 1)
        else:  # sweeps gain in jumps: only who gained nothing has failed
            idle = now.idle_sweeps + done if self.error == before else 0
            self._standing = replace(now, idle_sweeps=idle)

    def _sweep(self) -> int:
        sweeps = self._sweeps = self._sweeps or self._started()
        before, end = sweeps.done, self._budget.tolerance
        until = before + min(self._count, self.limit - self.iterations)
        self._count = 2 * self._count

        earlier = self.counters["sweeps"] - before

        def look() -> None:
            self._made("sweeps", sweeps.done - (self.counters["sweeps"] - earlier))
            self._seen(sweeps.best, sweeps.error)

        while sweeps.done < until and not sweeps.error <= end and time.monotonic() < self.deadline:
            finite = sweeps.sweep(min(until - sweeps.done, PIECE), end, None if self._record is None else look)
            look()
            if not finite:
                break
        return sweeps.done - before

    def _started(self) -> AcceleratedSweeps:
        """From the best point; after a failure without acceleration, after the next from nothing in a drawn order."""
        rows, times = self._contacts.rows, self._starts
        if times == 0:
            return AcceleratedSweeps(rows, self.best)
        if times % 2 == 1:
            return AcceleratedSweeps(rows, self.best, memory=0)
        order = np.random.default_rng(self._budget.seed + times).permutation(rows.problem.nc)
        return AcceleratedSweeps(rows, None, order)

    def _proximal_points(self) -> int:
        """Newton steps to them. Those before go on, unless somebody else has found a better point since: their errors
        rise and fall again, and a new beginning would lose the way that they have gone."""
        if self._proximal is None or self._drifted is not self.best:
            self._proximal = ProximalSteps(self._contacts, ProximalNewtonOptions(), self.best)
        proximal = self._proximal
        made, steps = proximal.factorizations, proximal.newton_steps
        end = steps + 3 * STEPS * HARDER**self._standing.newton_failures
        while proximal.newton_steps < end and self.iterations < self.limit and time.monotonic() < self.deadline:
            before = proximal.newton_steps
            if not proximal.step(self.limit - self.iterations, self.deadline):
                break
            self._made("newton_steps", max(proximal.newton_steps - before, 1))
            self._seen(proximal.r, self._contacts.rows.judged(proximal.r))
            if self.error <= self._budget.tolerance:
                break
        self._drifted = self.best
        self.counters["factorizations"] += proximal.factorizations - made
        return proximal.newton_steps - steps

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
