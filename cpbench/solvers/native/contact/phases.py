"""The phases of the automatic choice on frictional contact: sweeps, Newton steps to proximal points, ADMM.

Each begins at the best point so far and ends when it has had what was expected of it; `policy` says which is
next. Beside them the methods of `hedges` have their share of the work.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.matrices import Vector
from cpbench.solvers.base import Budget, Record
from cpbench.solvers.native.contact.admm import ADMMContactOptions, ContactSplitting
from cpbench.solvers.native.contact.hedges import Hedge, NewtonHedge, ProximalHedge
from cpbench.solvers.native.contact.policy import (
    HARDER,
    ITERATION,
    ITERATIONS,
    PER_FACTOR_ENTRY,
    SOLVE_SHARE,
    STEPS,
    NextMethod,
    PolicyState,
    policy,
    step_work,
    sweep_work,
)
from cpbench.solvers.native.contact.proximal_newton import ProximalNewtonOptions, ProximalSteps
from cpbench.solvers.native.contact.sweeps import AcceleratedSweeps, ScaledContacts

GAINED = 0.1
"""A method that took the error below this times what it was has not failed."""
SHORTER = 8
"""Sweeps are so many times fewer again where another method has come much nearer."""
PIECE = 2_000
"""Sweeps between two looks at the clock."""


def counters(sweeps: int) -> dict[str, int]:
    """Return the counters after so many sweeps and nothing else."""
    return {"iterations": sweeps, "sweeps": sweeps, "newton_steps": 0, "admm_iterations": 0, "factorizations": 0}


class Phases:
    """Phases after the first sweeps: the best point so far, what the methods cost and how they fared."""

    def __init__(
        self,
        contacts: ScaledContacts,
        budget: Budget,
        start: Vector,
        sweeps: AcceleratedSweeps,
        limit: int,
        deadline: float,
        record: Record | None,
    ) -> None:
        self._contacts, self._budget, self._record = contacts, budget, record
        self.limit, self.deadline = limit, deadline
        self.best, self.error, self.iterations = sweeps.best.copy(), sweeps.error, sweeps.done
        self.counters = counters(sweeps.done)
        self.messages = [f"{sweeps.done} sweeps to {sweeps.error:.1e}"]
        self._first, self._starts = max(sweeps.done, 1), 0
        self._count = 2 * self._first
        self._sweeps: AcceleratedSweeps | None = sweeps
        self._proximal: ProximalSteps | None = None
        self._drifted: Vector | None = None
        self._mark = self.error
        self._start, self._swept = start, sweeps.best.copy()
        self._hedges: tuple[Hedge, ...] | None = None
        step = step_work(contacts.rows.problem.W)
        self._standing = PolicyState(self.error, sweeps.done, sweep_work(contacts.rows), step, SOLVE_SHARE * step)

    def phase(self) -> None:
        """Do what the policy says, until it is done or has had what was expected of it; then what is due beside it."""
        self._policy_phase()
        now, made = self._standing, self.counters
        hedged = sum(hedge.steps for hedge in self._hedges or ())
        newton, admm = made["newton_steps"] - hedged, made["admm_iterations"]
        work = made["sweeps"] * now.sweep + newton * now.step + admm * now.iteration
        if self._hedges is None and STEPS * now.step <= work:
            self._hedges = NewtonHedge(self._contacts, self._start), ProximalHedge(self._contacts, self._swept)
        for hedge in self._hedges or ():
            self._catch_up(hedge, work)

    def _catch_up(self, hedge: Hedge, work: float) -> None:
        """Advance a method beside the policy until it has had its share of its work."""
        steps = hedge.steps
        while hedge.due(work):
            end = hedge.spent + STEPS * self._standing.step
            while hedge.spent < end and not hedge.over and not self._over:
                before = hedge.steps
                hedge.advance(self.deadline)
                self._made("newton_steps", hedge.steps - before)
                self._seen(hedge.r, self._contacts.rows.judged_error(hedge.r))
            if self._over:
                break
        if hedge.steps > steps:
            self.messages.append(f"{hedge.steps - steps} {hedge.unit} to {self.error:.1e}")

    @property
    def _over(self) -> bool:
        """Whether the tolerance is reached, or the iterations or the time are spent."""
        spent = self.iterations >= self.limit or time.monotonic() > self.deadline
        return self.error <= self._budget.tolerance or spent

    def _policy_phase(self) -> None:
        before, method = self.error, policy(self._standing, self._budget.tolerance)
        match method:
            case NextMethod.SWEEPS:
                done, unit = self._sweep(), "sweeps"
            case NextMethod.NEWTON:
                done, unit = self._proximal_points(), "Newton steps to proximal points"
            case _:
                done, unit = self._admm(), "ADMM iterations"
        self.messages.append(f"{done} {unit} to {self.error:.1e}")
        if self.error <= self._budget.tolerance:
            return
        failed = not self.error <= GAINED * before
        nearer = self.error <= GAINED * self._mark
        if (
            method is not NextMethod.SWEEPS
        ):  # sweeps stood still before: others go on, or the same ones from much nearer
            self._sweeps, self._starts = None, self._starts + 1 if failed else 0
        now = replace(self._standing, error=self.error, sweeps=self.counters["sweeps"])
        if nearer:  # from so much nearer, what failed may not
            self._mark = self.error
            if method is not NextMethod.SWEEPS:
                self._count = max(self._count // SHORTER, self._first)
            self._standing = replace(now, newton_failures=0, admm_failures=0, idle_sweeps=0)
        elif method is NextMethod.NEWTON:
            self._standing = replace(now, newton_failures=now.newton_failures + 1)
        elif method is NextMethod.ADMM:
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
        """Start from the best point; after a failure without acceleration, after the next from nothing in a drawn
        order."""
        rows, times = self._contacts.rows, self._starts
        if times == 0:
            return AcceleratedSweeps(rows, self.best)
        if times % 2 == 1:
            return AcceleratedSweeps(rows, self.best, rows.plain)
        order = np.random.default_rng(self._budget.seed + times).permutation(rows.problem.nc)
        return AcceleratedSweeps(rows, None, rows.sweeping(order))

    def _proximal_points(self) -> int:
        """Take Newton steps to proximal points. Those before go on, unless a better point was found since:
        their errors rise and fall again, and a new beginning would lose the way that they have gone."""
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
            self._seen(proximal.r, self._contacts.rows.judged_error(proximal.r))
            if self.error <= self._budget.tolerance:
                break
        self._drifted = self.best
        self.counters["factorizations"] += proximal.factorizations - made
        return proximal.newton_steps - steps

    def _admm(self) -> int:
        splitting = ContactSplitting(self._contacts, ADMMContactOptions(), self.best)
        most = int(ITERATIONS * HARDER**self._standing.admm_failures)
        while splitting.iterations < most and self.iterations < self.limit and time.monotonic() < self.deadline:
            if not splitting.step():
                break
            self._made("admm_iterations", 1)
            r = splitting.r
            self._seen(r, self._contacts.rows.judged_error(r))
            if self.error <= self._budget.tolerance:
                break
        self.counters["factorizations"] += splitting.factorizations
        self._standing = replace(self._standing, iteration=ITERATION + PER_FACTOR_ENTRY * splitting.entries)
        return splitting.iterations

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
