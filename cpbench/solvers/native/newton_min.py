"""Semismooth Newton on min(z, Mz + q) = 0, made global by the Fischer–Burmeister merit function."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.matrices import Matrix, Vector, identity, norm
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.lcp_claims import (
    ScaledLCP,
    conclude,
    dense_obstacle,
    error_of,
    principal,
    scale,
    solve_linear,
)
from cpbench.solvers.native.ncp_functions import fischer_burmeister
from cpbench.solvers.options import fixed, searched

ARMIJO = 1e-4
ACCEPT = 0.9
"""A full step that cuts the merit to this share is taken without further question."""
BACKTRACKS = 40


@dataclass(frozen=True)
class NewtonMinOptions:
    """`max_iterations` : Newton steps. `regularisation` : first multiple of I added to a singular Jacobian."""

    max_iterations: int = fixed(300)
    regularisation: float = searched(1e-10, low=1e-14, high=1e-4, log=True)


@register
class NewtonMin(Solver):
    """Direction: z_A = 0, M_FF z_F = -q_F with F = {w < z}. Merit: ½‖φ(z, w)‖², φ = z + w - √(z² + w²).

    Where the direction does not descend, the regularised Fischer–Burmeister Newton direction is tried, then the
    gradient. Finite on P-problems once F is right; elsewhere it may end in a stationary point, and says so.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="newton-min",
        node="lcp",
        summary="semismooth Newton on min(z, w), Fischer-Burmeister line search",
        method="semismooth Newton",
        citation="Kummer 1988; Harker and Pang 1990; De Luca, Facchinei and Kanzow 2000, Comput. Optim. Appl. 16:173",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=NewtonMinOptions,
    )

    def obstacle(self, problem: LCP) -> str | None:
        return None if sp.issparse(problem.M) else dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: NewtonMinOptions) -> ScaledLCP:
        return scale(problem, keep_sparse=True)

    def solve(
        self,
        prepared: ScaledLCP,
        budget: Budget,
        options: NewtonMinOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, M, q = prepared.problem, prepared.M, prepared.q
        z = np.zeros(q.size) if start is None else start.z / prepared.z_unit
        limit = budget.iterations or options.max_iterations
        deadline = time.monotonic() + budget.seconds
        counters = {"iterations": 0, "factorizations": 0, "matrix_vector_products": 1}
        best, best_error = z, np.inf
        claim, message = Claim.MAX_ITER, f"{limit} iterations"
        for done in range(limit + 1):
            w = M @ z + q
            shown = np.maximum(z, 0.0) * prepared.z_unit
            error = error_of(problem, shown)
            if record is not None:
                record(done, error, partial(LCPPoint, shown))
            if error < best_error:
                best, best_error = z, error
            if error <= budget.tolerance or done == limit:
                break
            if time.monotonic() > deadline:
                message = f"out of time after {done} iterations"
                break
            following = _step(M, q, z, w, options.regularisation, counters)
            if following is None:
                claim = Claim.FAILED
                message = (
                    f"no descent at error {best_error:.1e} after {done} iterations: a stationary point of the merit"
                )
                break
            z = following
            counters["iterations"] = done + 1
        answer = np.maximum(best, 0.0) * prepared.z_unit
        return conclude(problem, answer, budget, counters, otherwise=claim, message=message)


def _step(M: Matrix, q: Vector, z: Vector, w: Vector, delta: float, counters: dict[str, int]) -> Vector | None:
    """The next iterate, None when none of the three directions lowers the merit."""
    phi, a, b = fischer_burmeister(z, w)
    merit = 0.5 * float(phi @ phi)
    gradient = a * phi + M.T @ (b * phi)
    counters["matrix_vector_products"] += 1

    def merit_at(x: Vector) -> float:
        counters["matrix_vector_products"] += 1
        value = fischer_burmeister(x, M @ x + q)[0]
        return 0.5 * float(value @ value)

    counters["factorizations"] += 1
    newton = _min_direction(M, q, z, w, delta)
    if newton is not None:
        if merit_at(z + newton) <= ACCEPT * merit:
            return z + newton
        found = _backtrack(merit_at, z, newton, merit, float(gradient @ newton))
        if found is not None:
            return found
    counters["factorizations"] += 1
    smooth = _fischer_direction(M, phi, a, b, delta)
    for direction in (smooth, -gradient):
        if direction is not None:
            found = _backtrack(merit_at, z, direction, merit, float(gradient @ direction))
            if found is not None:
                return found
    return None


def _min_direction(M: Matrix, q: Vector, z: Vector, w: Vector, delta: float) -> Vector | None:
    """To the basic solution of F = {w < z}; a singular M_FF gets δI, growing until it can be solved."""
    F = np.flatnonzero(w < z)
    A = principal(M, F)
    target = np.zeros_like(z)
    x = solve_linear(A, -q[F])
    while x is None and delta <= 1e-2:
        x = solve_linear(A + delta * identity(F.size, A), -q[F] + delta * z[F])
        delta *= 1e3
    if x is None:
        return None
    target[F] = x
    return target - z


def _fischer_direction(M: Matrix, phi: Vector, a: Vector, b: Vector, delta: float) -> Vector | None:
    """-(diag(a) + diag(b) M + δI)⁻¹ φ with δ at least a share of ‖φ‖ (Levenberg–Marquardt near singularity)."""
    shift = max(delta, 1e-4 * min(1.0, norm(phi)))
    J = M * b[:, None] if isinstance(M, np.ndarray) else sp.diags_array(b) @ M
    diagonal = a + shift
    J = J + (np.diag(diagonal) if isinstance(J, np.ndarray) else sp.diags_array(diagonal))
    x = solve_linear(J, -phi)
    return x


def _backtrack(merit_at: Any, z: Vector, direction: Vector, merit: float, slope: float) -> Vector | None:
    """Armijo on the merit; None for a direction that does not descend or gains nothing to rounding."""
    if not slope < -1e-14 * merit:
        return None
    t = 1.0
    for _ in range(BACKTRACKS):
        trial = z + t * direction
        if merit_at(trial) <= merit + ARMIJO * t * slope:
            return trial if t * norm(direction) > 1e-16 * norm(z) else None
        t *= 0.5
    return None
