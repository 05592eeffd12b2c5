"""Conic solvers called directly, as they stand in `cone_solver.toml`: on quadratic programs over products of cones, and
on QPs.

What a conic solver of a cone program calls solved, almost solved or stuck is measured; where its row says so and it is
not good enough it gets a few Newton steps (`cpbench.solvers.shared.polish`, option `polish`), and the claim is about
what was measured last.

K becomes Lorentz cones as `lorentz_rows` says. The program is scaled first: every factor by its largest entry in A,
x by `x_unit`, the objective by the size of the forces, so that tolerances mean the same in grams and in tonnes.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, solvers
from cpbench.solvers.shared.lorentz_rows import lorentz_rows
from cpbench.solvers.shared.polish import polish
from cpbench.solvers.stopping import Stopping
from cpbench_adapters.conic_models import MODELS, ConicProgram
from cpbench_adapters.qp_backend import BackendAnswer, QPBackend, table_spec
from cpbench_adapters.qp_standard_form import StandardForm
from cpbench_adapters.qp_tolerances import Settings


@dataclass(frozen=True)
class ConeProgram(ConicProgram):
    """The program in x̂, ŝ and ŷ; back x = x_unit x̂, y = back·Tᵀŷ."""

    problem: ConeQP
    T: Any
    x_unit: float
    back: Any

    def point(self, x: Any, y: Any) -> ConeQPPoint:
        """Return our point from x̂ and ŷ."""
        return ConeQPPoint(x=self.x_unit * x[: self.problem.p.size], y=self.back * (self.T.T @ y))


def cone_program(problem: ConeQP) -> ConeProgram:
    """Return `problem` scaled, over {0}, ℝ₊ and Lorentz cones."""
    K = problem.K
    forces = max(matrices.max_abs(problem.p), matrices.max_abs(problem.Q) * problem.x_unit) or 1.0
    unit, sizes = problem.x_unit or 1.0, problem.block_sizes
    first = np.cumsum(K.size).astype(int) - K.size.astype(int)
    radius = [K.mu[i] / (sizes[first[i]] * unit) if K.kind[i] == Cone.CYLINDER else K.mu[i] for i in range(K.kind.size)]
    cones, T, U, c = lorentz_rows(ProductCone(K.kind, K.size, np.array(radius), K.mu_r))
    scaled = sp.diags_array(1.0 / sizes) @ sp.csr_array(problem.A)
    extra = U.shape[1]
    return ConeProgram(
        problem=problem,
        P=sp.block_diag([sp.csr_array(problem.Q) * (unit / forces), sp.csr_array((extra, extra))], format="csc"),
        q=np.concatenate([problem.p / forces, np.zeros(extra)]),
        A=-sp.hstack([T @ scaled, U], format="csc"),
        b=T @ (problem.b / (sizes * unit)) + c,
        cones=cones,
        T=T,
        x_unit=unit,
        back=forces / sizes,
    )


@dataclass(frozen=True)
class PolishOptions:
    """Options of those that are polished. `polish` : the most Newton steps on an answer that is not good enough."""

    polish: int = 10


class ConeSolver(Solver):
    """One conic solver; every factor becomes Lorentz cones. Keys of its row: fields of `SolverSpec`, `model`, and
    `polished` where its answers are."""

    def __init__(self, row: Mapping[str, Any]) -> None:
        self.spec = table_spec(row, node="coneqp", **({"options": PolishOptions} if row.get("polished") else {}))
        self.model = MODELS[row["model"]]

    def obstacle(self, problem: ConeQP) -> str | None:
        if problem.p.size == 0:
            return "has no unknown (n = 0): there is nothing to minimise"
        if not problem.convex:
            least = matrices.least_eigenvalue(problem.Q)
            return f"not convex: Q has, at unit diagonal, the eigenvalue {least:.1e} or less"
        return None

    def setup(self, problem: ConeQP, budget: Budget, options: Any) -> ConeProgram:
        return cone_program(problem)

    def stopping(self, tolerance: float, problem: ConeQP | None = None) -> Stopping:
        return self.model.stopping(tolerance)

    def solve(
        self,
        prepared: ConeProgram,
        budget: Budget,
        options: Any,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        end = self.model(prepared, self.model.settings(budget)).solve()
        claim, counters = end.claim, {"iterations": end.iterations}
        if not end.usable:
            claim = claim if claim in (Claim.INFEASIBLE, Claim.UNBOUNDED) else Claim.FAILED
            return SolverOutput(claim=claim, counters=counters, message=end.status)
        point = prepared.point(end.x, end.y)
        if isinstance(options, PolishOptions):
            steps = options.polish if claim in (Claim.SOLVED, Claim.INACCURATE) else 0
            point, error, counters["polishing_steps"] = polish(prepared.problem, point, budget.tolerance, steps)
        else:
            error = prepared.problem.residuals(point, budget.tolerance).error
        if error <= budget.tolerance:
            claim = Claim.SOLVED
        elif claim is Claim.SOLVED:
            claim = Claim.INACCURATE
        return SolverOutput(claim=claim, point=point, counters=counters, message=f"{end.status}, error {error:.1e}")

    def warmup(self) -> None:
        K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.5))
        self.run(ConeQP.over(np.eye(3), -np.ones(3), K))


class ConicQP(QPBackend):
    """One conic solver on QPs: equations are rows in {0}, inequalities and bounds in ℝ₊."""

    bounds_as_rows = True

    def __init__(self, row: Mapping[str, Any]) -> None:
        self.spec = table_spec(row, node="qp")
        self.model = MODELS[row["model"]]
        self.claims = self.model.claims

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        A = sp.vstack([M for M in (sp.csr_matrix((0, form.q.size)), form.A, form.G) if M is not None])
        b, h = (np.zeros(0) if side is None else side for side in (form.b, form.h))
        k, cones = b.size, [("zero", b.size), ("nonnegative", h.size)]
        end = self.model(ConicProgram(form.P, form.q, A, np.concatenate([b, h]), cones), settings).solve()
        counters = {"iterations": end.iterations}
        return BackendAnswer(status=end.status, x=end.x, y=end.y[:k], z=end.y[k:], counters=counters)


for _kind, _rows in tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8")).items():
    for _row in _rows:
        solvers.add(_row["name"], {"coneqp": ConeSolver, "qp": ConicQP}[_kind](_row))
