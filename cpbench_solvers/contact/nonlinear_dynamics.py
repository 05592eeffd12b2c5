"""Newton's method on the dynamics of frictional contact; linear dynamics in every step, by a registered solver."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.global_contact import GFCPoint, GlobalFrictionContact, NFCPoint, NonlinearFrictionContact
from cpbench.formulations.local_contact import FrictionContact
from cpbench.formulations.sizes import row_sizes
from cpbench.foundation import matrices
from cpbench.foundation.matrices import norm
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench_solvers.contact.dynamics_error import DynamicsError
from cpbench_solvers.inner import inner_solver
from cpbench_solvers.lcp.claims import concluded
from cpbench_solvers.traits import ITERATIVE

NODES = ("fc", "gfc")
"""Nodes of which the inner solver may be."""
SHARE = 0.1
"""Of the tolerance, or of the square of the error, that the inner solver is asked for: the error may be squared."""
FINEST, COARSEST = 1e-14, 1e-3
DESCENT = 1e-4
HALVINGS = 8
PROXIMAL = (0.0, 0.1, 1.0, 10.0, 100.0)
"""τ of D = diag(largest entries of F′(v) by row), one after the other until a step is found."""


@dataclass(frozen=True)
class NewtonContactOptions:
    """Options of newton-nfc. `inner` : a solver of node fc or gfc. `memory` : merits of earlier steps, the largest
    of which a new one must be below. `max_iterations` : linearizations."""

    inner: str = "nsgs"
    memory: int = 4
    max_iterations: int = 100


@register
class NewtonContact(Solver):
    """(v, r)⁺ solves F(v) + F′(v)(v⁺ − v) = Hr⁺, u⁺ = Hᵀv⁺ + w with the contact law, which is not linearized.

    Converges quadratically to solutions at which the linearized problem is regular, once the contacts are in their
    final states. Shorter steps between (v, r) and (v, r)⁺ are tried where the judged error does not fall; reactions
    stay in their cones, which are convex. F′(v) has to be nonsingular along the way.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="newton-nfc",
        node="nfc",
        summary="Newton's method on the dynamics, contact problems by a registered fc or gfc solver",
        method="Josephy-Newton",
        citation="Josephy 1979, MRC report 1965; Acary and Brogliato 2008, Springer LNACM 35, section 10.1.5",
        traits=ITERATIVE,
        options=NewtonContactOptions,
        quick=True,
    )

    def setup(
        self, problem: NonlinearFrictionContact, budget: Budget, options: NewtonContactOptions
    ) -> NonlinearFrictionContact:
        problem.F.jacobian(problem.start)  # derives and compiles
        return problem

    def solve(
        self,
        prepared: NonlinearFrictionContact,
        budget: Budget,
        options: NewtonContactOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, deadline = prepared, time.monotonic() + budget.seconds
        inner = inner_solver(options.inner, NODES)
        limit = budget.iterations or options.max_iterations
        counters = {"iterations": 0, "inner_iterations": 0, "factorizations": 0}

        def error_at(point: NFCPoint) -> float:
            error = problem.residuals(point, budget.tolerance).error if point.finite else math.inf
            if not error <= budget.tolerance:
                return error
            # at the answer the connected parts are those of the linearized dynamics
            measured = DynamicsError(problem.linearized(point.v), budget.tolerance, problem.reference)
            return max(error, measured(GFCPoint(v=point.v, r=point.r)), measured.floor)

        merit = _merit(problem)
        point = NFCPoint(problem.start, np.zeros(problem.w.size)) if start is None else start
        best, error = point, error_at(point)
        if not math.isfinite(error):  # a start where F is not defined
            point = best = NFCPoint(problem.free_motion, np.zeros(problem.w.size))
            error = error_at(point)
        least, recent = error, deque([merit(point)], maxlen=options.memory)
        claim, message = Claim.MAX_ITER, f"{limit} linearizations"
        if record is not None:
            record(0, error, lambda: best)
        while not least <= budget.tolerance and counters["iterations"] < limit:
            left = deadline - time.monotonic()
            if left <= 0:
                claim, message = Claim.FAILED, f"out of time after {counters['iterations']} linearizations"
                break
            share = SHARE * max(budget.tolerance, error * error)
            asked = Budget(tolerance=min(max(share, FINEST), COARSEST), seconds=left, seed=budget.seed)
            step = None
            for tau in PROXIMAL:
                target = _linear_step(problem, point, tau, inner, asked, counters)
                step = None if target is None else _search(point, target, max(recent), merit)
                if step is not None or time.monotonic() > deadline:
                    break
            if step is None:
                claim, message = Claim.FAILED, "no step descends"
                break
            point, value = step
            error = error_at(point)
            recent.append(value)
            counters["iterations"] += 1
            if error < least:
                best, least = point, error
                if record is not None:
                    record(counters["iterations"], error, lambda now=best: now)
        if not math.isfinite(least):
            return SolverOutput(claim=Claim.FAILED, counters=counters, message="F is not defined at the start")
        return concluded(best, least, budget, counters, claim, f"{message}, error {least:.1e}")


def _linear_step(
    problem: NonlinearFrictionContact,
    point: NFCPoint,
    tau: float,
    inner: Solver,
    budget: Budget,
    counters: dict[str, int],
) -> NFCPoint | None:
    """Return (v, r) of the problem linearized at `point`, whatever the inner solver claims; None without one."""
    linear = problem.linearized(point.v)
    if tau > 0.0:
        D = sp.diags_array(tau * row_sizes(linear.M))
        linear = replace(linear, M=sp.csr_array(linear.M + D), f=linear.f + D @ point.v)
    counters["factorizations"] += 1
    factors = linear.factorization
    if factors.singular:
        return None
    if inner.spec.node == "gfc":
        subproblem, start = linear, GFCPoint(v=point.v, r=point.r)
    else:
        subproblem, start = _local(linear), FCPoint(r=point.r)
    if inner.obstacle(subproblem) is not None:
        return None
    output = inner.run(subproblem, budget, start=start)
    counters["inner_iterations"] += output.counters.get("iterations", 0)
    if output.point is None or not output.point.finite:
        return None
    r = output.point.r
    return NFCPoint(v=np.asarray(factors.solve(linear.H @ r + linear.f)), r=r)


def _local(linear: GlobalFrictionContact) -> FrictionContact:
    """Return W = HᵀM⁻¹H, q = HᵀM⁻¹f + w; M may be nonsymmetric."""
    H = linear.H
    W = H.T @ np.asarray(linear.factorization.solve(matrices.dense(H)))
    q = H.T @ np.asarray(linear.factorization.solve(linear.f)) + linear.w
    return FrictionContact(W=W, q=q, mu=linear.mu, dimension=linear.dimension)


def _merit(problem: NonlinearFrictionContact) -> Callable[[NFCPoint], float]:
    """Return √(Σdᵢ²/mᵢ + Σ‖Δ_c‖²/ρ_c); its scales are those of the problem, so that no answer can stretch them."""
    root_mass, root_rho = np.sqrt(row_sizes(problem.reference.M)), np.sqrt(problem.rho)[:, None]
    shape, law = (problem.nc, problem.dimension), problem.law

    def merit(point: NFCPoint) -> float:
        with np.errstate(all="ignore"):
            u, r = (problem.H.T @ point.v + problem.w).reshape(shape), point.r.reshape(shape)
            defect = (r - law.project(r - root_rho**2 * law.shift(u))) / root_rho
            return math.hypot(norm((problem.F(point.v) - problem.H @ point.r) / root_mass), norm(defect.ravel()))

    return merit


def _search(
    point: NFCPoint, target: NFCPoint, reference: float, merit: Callable[[NFCPoint], float]
) -> tuple[NFCPoint, float] | None:
    """Return the first of the lengths 1, ½, … whose merit is below the reference; None where none is."""
    length = 1.0
    for _ in range(HALVINGS + 1):
        # the full step is the target itself: the sum would round
        v = target.v if length == 1.0 else point.v + length * (target.v - point.v)
        r = target.r if length == 1.0 else point.r + length * (target.r - point.r)
        trial = NFCPoint(v, r)
        value = merit(trial)
        if value <= (1.0 - DESCENT * length) * reference:
            return trial, value
        length *= 0.5
    return None
