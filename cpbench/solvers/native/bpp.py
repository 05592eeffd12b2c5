"""Block principal pivoting on an LCP: all infeasible components change sides at once, one at a time when that fails."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.lcp import LCP
from cpbench.matrices import Vector, dense
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.lcp_claims import (
    ScaledLCP,
    conclude,
    dense_obstacle,
    error_of,
    principal,
    refined,
    scale,
    solve_linear,
)
from cpbench.solvers.options import fixed, searched

PATIENCE = 3
"""Block changes allowed without a new least number of infeasibilities (Júdice and Pires: p)."""


@dataclass(frozen=True)
class BPPOptions:
    """`max_iterations` : 0 stands for 10n + 200. `feasibility_tolerance` : in data scaled to size one."""

    max_iterations: int = fixed(0)
    feasibility_tolerance: float = searched(1e-12, low=1e-15, high=1e-8, log=True)


@register
class BlockPrincipalPivoting(Solver):
    """Active sets F with M_FF z_F = -q_F; ends for P-matrices (Murty's rule takes over when blocks do not help).

    For other matrices it may meet a singular M_FF or come back to an active set it has seen: it then says so.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="bpp",
        node="lcp",
        summary="block principal pivoting with Murty's rule as safeguard",
        method="pivoting",
        citation="Kostreva 1978; Júdice and Pires 1994, Computers & OR 21:587; Murty 1974",
        traits=frozenset({Trait.WARM_START, Trait.DETERMINISTIC}),
        options=BPPOptions,
    )

    def obstacle(self, problem: LCP) -> str | None:
        return dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: BPPOptions) -> ScaledLCP:
        return scale(problem)

    def solve(
        self,
        prepared: ScaledLCP,
        budget: Budget,
        options: BPPOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, q = prepared.problem, prepared.q
        n = q.size
        inside = np.zeros(n, dtype=bool) if start is None else _guessed(prepared, start.z / prepared.z_unit)
        limit = budget.iterations or options.max_iterations or 10 * n + 200
        deadline = time.monotonic() + budget.seconds
        least, patience = n + 1, PATIENCE
        seen: set[bytes] = set()
        z = np.zeros(n)
        for done in range(limit + 1):
            counters = {"iterations": done, "factorizations": done + 1}
            F = np.flatnonzero(inside)
            basic = _basic_solution(prepared, F)
            if basic is None:
                message = f"M_FF of size {F.size} is singular after {done} iterations: use lemke"
                return conclude(problem, z, budget, counters, otherwise=Claim.FAILED, message=message)
            z, w = basic
            infeasible = np.flatnonzero(np.where(inside, z, w) < -options.feasibility_tolerance)
            if infeasible.size == 0:
                return _finish(problem, np.maximum(z, 0.0) * prepared.z_unit, F, budget, counters)
            if infeasible.size < least:
                least, patience = infeasible.size, PATIENCE
                seen.clear()
            elif patience > 0:
                patience -= 1
            else:
                key = inside.tobytes()
                if key in seen:
                    message = f"cycles after {done} iterations: M is not a P-matrix, use lemke"
                    z = np.maximum(z, 0.0) * prepared.z_unit
                    return conclude(problem, z, budget, counters, otherwise=Claim.FAILED, message=message)
                seen.add(key)
                infeasible = infeasible[-1:]
            inside[infeasible] = ~inside[infeasible]
            if time.monotonic() > deadline:
                limit = done
                break
        counters = {"iterations": limit, "factorizations": limit + 1}
        z = np.maximum(z, 0.0) * prepared.z_unit
        message = f"{least} components infeasible at best after {limit} iterations"
        return conclude(problem, z, budget, counters, otherwise=Claim.MAX_ITER, message=message)


def _guessed(lcp: ScaledLCP, z: Vector) -> np.ndarray[Any, Any]:
    """Components that are positive in the solution near to z: where z > w; a rounding error above 0 is no sign."""
    return z > lcp.M @ z + lcp.q


def _basic_solution(lcp: ScaledLCP, F: np.ndarray[Any, Any]) -> tuple[Vector, Vector] | None:
    """z with M_FF z_F = -q_F, zero elsewhere, and w, zero on F; None where M_FF is singular."""
    x = solve_linear(principal(lcp.M, F), -lcp.q[F])
    if x is None:
        return None
    z = np.zeros_like(lcp.q)
    z[F] = x
    w = lcp.M[:, F] @ x + lcp.q
    w[F] = 0.0
    return z, w


def _finish(problem: LCP, z: Vector, F: np.ndarray[Any, Any], budget: Budget, counters: dict[str, int]) -> SolverOutput:
    error = error_of(problem, z)
    if not error <= budget.tolerance:
        candidate = refined(dense(problem.M), problem.q, z, F)
        counters["factorizations"] += 1
        if (better := error_of(problem, candidate)) < error:
            z, error = candidate, better
    return conclude(problem, z, budget, counters, error=error)
