"""Projected Gauss–Seidel on a relay problem: z_i ← its nearest point in [lb_i, ub_i] to z_i − ω w_i/M_ii."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import LCPPoint, Relay
from cpbench.foundation.cones import project_box
from cpbench.foundation.matrices import Vector, entries, max_abs, sparse
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress, next_stop
from cpbench_solvers.avi.claims import error_of
from cpbench_solvers.kernels import box_splitting
from cpbench_solvers.lcp.claims import concluded
from cpbench_solvers.lcp.pgs import PGSOptions, diagonal_obstacle
from cpbench_solvers.traits import ITERATIVE

CHUNK = 256
"""The most sweeps between two measurements of the error."""


@dataclass(frozen=True)
class PGSRelayOptions(PGSOptions):
    """Options of pgs-relay. `omega` : over-relaxation, in ]0, 2[."""

    omega: float = 1.0


@dataclass(frozen=True)
class RelayRows:
    """M by rows (starts, columns, values), and its diagonal."""

    problem: Relay
    matrix: tuple[Any, Any, Vector]
    diagonal: Vector


@register
class PGSRelay(Solver):
    """A method that converges for symmetric positive definite and for H-matrices with positive diagonal.

    Unknowns that are fixed (lb = ub) need no diagonal.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="pgs-relay",
        node="relay",
        summary="projected Gauss-Seidel with bounds",
        method="splitting",
        citation="Cryer 1971; Moreau 1988; Jean 1999",
        traits=ITERATIVE,
        options=PGSRelayOptions,
    )

    def obstacle(self, problem: Relay) -> str | None:
        return diagonal_obstacle("M where lb < ub", np.where(problem.moving, problem.M.diagonal(), 1.0), "newton-relay")

    def setup(self, problem: Relay, budget: Budget, options: PGSRelayOptions) -> RelayRows:
        diagonal = np.where(problem.moving, problem.M.diagonal(), 1.0)
        return RelayRows(problem, entries(sparse(problem.M)), diagonal)

    def solve(
        self,
        prepared: RelayRows,
        budget: Budget,
        options: PGSRelayOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        kernel = box_splitting
        problem = prepared.problem
        z = project_box(np.zeros_like(problem.q) if start is None else start.z, problem.lb, problem.ub)
        limit, sweeps, chunk = budget.iterations or options.max_iterations, 0, 1
        law = (*prepared.matrix, prepared.diagonal, problem.q, problem.lb, problem.ub)
        progress = Progress(options.stall_window, budget.seconds, "sweeps")
        error = error_of(problem, LCPPoint(z), budget.tolerance)
        if record is not None:
            record(0, error, lambda: LCPPoint(z))
        best, best_error = z.copy(), error
        claim, message = Claim.MAX_ITER, f"{limit} sweeps"
        forces = max_abs(problem.q[problem.moving]) or 1.0
        while best_error > budget.tolerance and sweeps < limit:
            threshold = 0.1 * min(budget.tolerance, error) * forces
            until = min(limit, sweeps + chunk)
            while True:
                most = next_stop(sweeps, until, record) - sweeps
                done, settled = kernel.sweeps(*law, z, options.omega, threshold, most)
                sweeps += done
                if settled or sweeps == until:
                    break
                if record is not None:
                    record(sweeps, np.nan, lambda: LCPPoint(z))
            chunk = min(2 * chunk, CHUNK)
            error = error_of(problem, LCPPoint(z), budget.tolerance)
            if record is not None:
                record(sweeps, error, lambda: LCPPoint(z))
            if error < best_error:
                best, best_error = z.copy(), error
            why = progress.trouble(sweeps, error)
            if why is not None:
                claim, message = Claim.FAILED, why
                break
        counters = {"iterations": sweeps, "matrix_vector_products": sweeps}
        return concluded(LCPPoint(best), best_error, budget, counters, claim, f"{message}, error {best_error:.1e}")
