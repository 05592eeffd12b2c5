"""Clarabel on quadratic programs over products of cones, called directly.

K becomes Lorentz cones as `lorentz_rows` says. The program is scaled first: every factor by its largest entry in A,
x by `x_unit`, the objective by the size of the forces, so that tolerances mean the same in grams and in tonnes.

Tolerance ε: Clarabel's residuals get ε/10; a gap δ leaves s and y up to √δ from the conditions on the boundary of
a cone, so the gap gets ε²/10, but neither gets less than double precision allows. What Clarabel calls solved, almost
solved or stuck is measured; if it is not good enough it gets a few Newton steps (`cone_polish`, option `polish`), and
the claim is about what was measured last.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench import matrices
from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.product_cones import Cone, ProductCone
from cpbench.solvers.adapters.cone_polish import polish
from cpbench.solvers.adapters.lorentz_rows import lorentz_rows
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register

FINEST, FINEST_GAP = 1e-13, 1e-15
"""The least residual and gap that are asked for, relative to data of size 1."""
INFEASIBILITY = 1e-7
"""Largest tolerance on a proof of infeasibility or unboundedness, whatever ε."""
_CLAIMS = {
    "Solved": Claim.SOLVED,
    "AlmostSolved": Claim.INACCURATE,
    "InsufficientProgress": Claim.INACCURATE,
    "NumericalError": Claim.FAILED,
    "PrimalInfeasible": Claim.INFEASIBLE,
    "DualInfeasible": Claim.UNBOUNDED,
    "MaxIterations": Claim.MAX_ITER,
    "MaxTime": Claim.MAX_ITER,
}


@dataclass(frozen=True)
class ClarabelConeOptions:
    """`polish` : the most Newton steps on an answer that is not good enough."""

    polish: int = 10


@dataclass(frozen=True)
class _Model:
    """Clarabel's data, and the way back: x = x_unit x̂, y = back·Tᵀŷ."""

    problem: ConeQP
    P: Any
    q: Any
    A: Any
    b: Any
    cones: list[Any]
    T: Any
    x_unit: float
    back: Any


@register
class ClarabelCone(Solver):
    """Interior point on the homogeneous embedding with Nesterov–Todd scaling; every factor becomes Lorentz cones."""

    spec = SolverSpec(
        name="clarabel-cone",
        node="coneqp",
        summary="interior point on the homogeneous embedding, second-order and rolling cones, in Rust",
        method="interior point",
        citation="Goulart and Chen, Clarabel: an interior-point solver for conic programs, arXiv 2405.12762",
        requires=("clarabel",),
        install="pip install clarabel",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        options=ClarabelConeOptions,
    )

    def obstacle(self, problem: ConeQP) -> str | None:
        if problem.p.size == 0:
            return "has no unknown (n = 0): there is nothing to minimise"
        if not problem.convex:
            least = matrices.least_eigenvalue(problem.Q)
            return f"not convex: Q has the eigenvalue {least:.1e} (max|Q| = {matrices.max_abs(problem.Q):.1e})"
        return None

    def setup(self, problem: ConeQP, budget: Budget, options: Any) -> _Model:
        import clarabel

        K = problem.K
        forces = max(matrices.max_abs(problem.p), matrices.max_abs(problem.Q) * problem.x_unit) or 1.0
        unit, sizes = problem.x_unit or 1.0, problem.block_sizes
        first = np.cumsum(K.size).astype(int) - K.size.astype(int)
        radius = [
            K.mu[i] / (sizes[first[i]] * unit) if K.kind[i] == Cone.CYLINDER else K.mu[i] for i in range(K.kind.size)
        ]
        cones, T, U, c = lorentz_rows(ProductCone(K.kind, K.size, np.array(radius), K.mu_r))
        scaled = sp.diags_array(1.0 / sizes) @ sp.csr_array(problem.A)
        A = -sp.hstack([T @ scaled, U], format="csc")
        extra = U.shape[1]
        P = sp.block_diag([sp.csr_array(problem.Q) * (unit / forces), sp.csr_array((extra, extra))])
        made = {
            "zero": clarabel.ZeroConeT,
            "nonnegative": clarabel.NonnegativeConeT,
            "lorentz": clarabel.SecondOrderConeT,
        }
        return _Model(
            problem=problem,
            P=sp.csc_array(sp.triu(P)),
            q=np.concatenate([problem.p / forces, np.zeros(extra)]),
            A=A,
            b=T @ (problem.b / (sizes * unit)) + c,
            cones=[made[kind](size) for kind, size in cones],
            T=T,
            x_unit=unit,
            back=forces / sizes,
        )

    def solve(
        self, prepared: _Model, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        import clarabel

        model = clarabel.DefaultSolver(
            prepared.P, prepared.q, prepared.A, prepared.b, prepared.cones, _settings(budget)
        )
        solution = model.solve()
        status, counters = str(solution.status), {"iterations": int(solution.iterations)}
        claim = _CLAIMS.get(status, Claim.FAILED)
        if claim in (Claim.INFEASIBLE, Claim.UNBOUNDED):  # there x is a ray
            return SolverOutput(claim=claim, counters=counters, message=status)
        x = prepared.x_unit * np.asarray(solution.x)[: prepared.problem.p.size]
        point = ConeQPPoint(x=x, y=prepared.back * (prepared.T.T @ np.asarray(solution.z)))
        if not point.finite:
            return SolverOutput(claim=Claim.FAILED, counters=counters, message=status)
        steps = options.polish if claim in (Claim.SOLVED, Claim.INACCURATE) else 0
        point, error, counters["polishing_steps"] = polish(prepared.problem, point, budget.tolerance, steps)
        if error <= budget.tolerance:
            claim = Claim.SOLVED
        elif claim is Claim.SOLVED:
            claim = Claim.INACCURATE
        return SolverOutput(claim=claim, point=point, counters=counters, message=f"{status}, error {error:.1e}")

    def warmup(self) -> None:
        K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.5))
        self.run(ConeQP.over(np.eye(3), -np.ones(3), K))


def _settings(budget: Budget) -> Any:
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_feas = max(0.1 * budget.tolerance, FINEST)
    settings.tol_gap_abs = settings.tol_gap_rel = max(0.1 * budget.tolerance**2, FINEST_GAP)
    settings.tol_infeas_abs = settings.tol_infeas_rel = min(0.1 * budget.tolerance, INFEASIBILITY)
    settings.max_iter = 200 if budget.iterations is None else budget.iterations
    if math.isfinite(budget.seconds):
        settings.time_limit = budget.seconds
    return settings
