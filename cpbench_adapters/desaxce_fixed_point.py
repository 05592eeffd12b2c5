"""Frictional contact as a fixed point of convex programs: De Saxcé's term frozen, a cone program solved, and again.

With s_c = μ_c‖u_Tc‖ (rolling: + μ_rc‖ω_c‖) given, the law K*_μ ∋ Wr + q + s e_N ⟂ r ∈ K_μ is, for a symmetric PSD W,
the optimality condition of  min ½rᵀWr + (q + s e_N)ᵀr over Π K_μ.  Its solution has velocities u = Wr + q and gives
the next s; a fixed point obeys the law. s = 0, the start unless one is given, is the convex relaxation, which is a
solver by itself as well.

A W that is a little nonsymmetric is split into its symmetric part and the rest, (W − Wᵀ)r/2 of the last iterate, which
is frozen like s.

s e_N is inside K*, so that a program that is unbounded has a bounded one above it: s is raised to twice itself, or to
the largest μ_c‖q_Tc‖, that of the free velocities.

The map from s to the next need not contract. After `PATIENCE` iterations that do not lower the error, measured on the
law as the formulation measures it, s goes half as far towards the next one, and so on down to `SHORTEST`. The best
iterate is kept.

The program is scaled by the contacts' own masses: r = f·D x with D = √ρ_c in every row of a contact (rows of moments
times their length ℓ_c) makes the diagonal blocks of DWD about 1, and f = max|Dq|, so that tolerances mean the same in
grams and in tonnes.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Kind
from cpbench.formulations.contact import FCPoint, LocalContact
from cpbench.formulations.local_contact import FrictionContact, RollingFrictionContact
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, Law, ProductCone, RollingCoulomb
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, solvers
from cpbench.solvers.shared.lorentz_rows import lorentz_rows
from cpbench.solvers.shared.progress import Progress
from cpbench.solvers.stopping import Stopping
from cpbench_adapters.conic_models import MODELS, ConicModel, ConicProgram
from cpbench_adapters.qp_backend import table_spec

BY_CONTACT = "norms over all contacts: the verdict compares each with its own velocities, too"
"""What the test does not see: an answer that passes it may miss the law of a light contact by more."""
SYMMETRY_LIMIT = 1e-8
"""Asymmetry up to which a Delassus matrix counts as symmetric (assembled ones are not to rounding)."""
ASYMMETRY, INDEFINITE = 3e-2, 1e-5
"""Asymmetry and −λ_min of W scaled to unit diagonal up to which it is tried: assembled Delassus matrices are neither
symmetric (RockPile_tob1 has 2e-2) nor positive semidefinite (Confeti-ex13 has 6e-7) to rounding."""
PATIENCE, LOWER, SHORTEST = 40, 0.95, 1 / 16
"""Iterations that may fail to bring the error below `LOWER` times its least before s goes half as far; 30 were seen to
pass before undamped steps converged, and shorter ones took longer."""
RAISES = 10
"""How often s may be raised."""
STALL = 300


@dataclass(frozen=True)
class DeSaxceOptions:
    """Options of the methods of this module. `max_iterations` : convex programs."""

    max_iterations: int = 1000


@dataclass(frozen=True)
class ScaledContact(ConicProgram):
    """The problem in x, r = size·x: DWD = P + skew, Dq over f, its law in units of `lengths`, the cones of x."""

    problem: LocalContact
    law: Law
    skew: Any
    size: Vector

    def shift(self, x: Vector) -> Vector:
        """Return the frozen term, s e_N + skew x; shape (n,)."""
        rest = self.skew @ x
        U = (self.P @ x + rest + self.q).reshape(self.problem.nc, -1)
        return rest + (self.law.shift(U) - U).ravel()


class ConicFixedPoint(Solver):
    """The fixed point on De Saxcé's term around the conic solver of a row of the table: fields of `SolverSpec`, and
    `model`. `asymmetry` : of W, the most that is taken."""

    asymmetry: ClassVar[float] = ASYMMETRY
    given: ClassVar[Mapping[str, Any]] = {"options": DeSaxceOptions}
    """Fields of `SolverSpec` that no row has."""

    def __init__(self, row: Mapping[str, Any]) -> None:
        self.spec = table_spec(row, **self.given)
        self.model_type = MODELS[row["model"]]

    def model(self, prepared: ScaledContact, budget: Budget) -> ConicModel:
        """Return the model of the program with s = 0."""
        return self.model_type(prepared, self.model_type.settings(budget))

    def stopping(self, tolerance: float, problem: LocalContact | None = None) -> Stopping:
        return replace(self.model_type.stopping(tolerance), differs=BY_CONTACT, factor=math.inf)

    def obstacle(self, problem: LocalContact) -> str | None:
        asymmetry = matrices.asymmetry(problem.W)
        if asymmetry > self.asymmetry:
            return (
                f"needs W symmetric, asymmetry = {asymmetry:.1e} > {self.asymmetry:.0e}: its steps are "
                "minimisations; use nsgs or nsgs-rfc"
            )
        if not matrices.is_psd(problem.W, INDEFINITE):
            return (
                f"needs W positive semidefinite: scaled to unit diagonal it has an eigenvalue below -{INDEFINITE:.0e}"
            )
        return None

    def warmup(self) -> None:
        if self.spec.node == "fc":
            self.run(FrictionContact(W=np.eye(3), q=np.array([-1.0, 2.0, 0.0]), mu=np.array([0.5])))
        else:
            q = np.array([-1.0, 2.0, 0.0, 0.0, 1.0])
            self.run(RollingFrictionContact(W=np.eye(5), q=q, mu=np.array([0.5]), mu_r=np.array([0.1])))

    def setup(self, problem: LocalContact, budget: Budget, options: Any) -> ScaledContact:
        D = (np.sqrt(problem.rho)[:, None] * problem.lengths).ravel()
        scale = sp.diags_array(D)
        W = sp.csc_array(scale @ sp.csr_array(problem.W) @ scale)
        q = D * problem.q
        f = matrices.max_abs(q) or 1.0
        law = problem.law.in_units(problem.lengths)
        kind, mu_r = (Cone.ROLLING, law.mu_r) if isinstance(law, RollingCoulomb) else (Cone.SECOND_ORDER, 0.0)
        cones, T, _, b = lorentz_rows(ProductCone.of((kind, problem.nc, problem.dimension, problem.mu, mu_r)))
        P, skew = (W + W.T) * 0.5, (W - W.T) * 0.5
        return ScaledContact(P, q / f, sp.csc_array(-T), b, cones, problem, law, skew, f * D)

    def solve(
        self,
        prepared: ScaledContact,
        budget: Budget,
        options: DeSaxceOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, d = prepared.problem, prepared.problem.dimension
        r = np.zeros(problem.q.size) if start is None else np.array(start.r)
        counters = {"iterations": 0, "inner_iterations": 0}
        best, least = FCPoint(r), problem.residuals(FCPoint(r), budget.tolerance).error
        if record is not None:
            record(0, least, lambda: best)
        if least <= budget.tolerance:
            return SolverOutput(claim=Claim.SOLVED, point=best, counters=counters)
        limit = options.max_iterations if budget.iterations is None else budget.iterations
        progress = Progress(STALL, budget.seconds, "convex programs")
        model = self.model(prepared, Budget(tolerance=budget.tolerance, seconds=budget.seconds))
        frozen = np.zeros(r.size) if start is None else prepared.shift(r / prepared.size)
        length, wasted, raised = 1.0, 0, 0
        claim, message = Claim.MAX_ITER, f"{limit} convex programs"
        while counters["iterations"] < limit:
            end = model.solve(prepared.q + frozen)
            counters["iterations"] += 1
            counters["inner_iterations"] += end.iterations
            done = counters["iterations"]
            if end.claim is Claim.UNBOUNDED and raised < RAISES:
                higher = np.maximum(2.0 * frozen[::d], prepared.shift(np.zeros(r.size))[::d].max())
                if (higher > frozen[::d]).any():
                    frozen[::d], length, raised = higher, max(0.5 * length, SHORTEST), raised + 1
                    continue
            if not end.usable:
                claim, message = Claim.FAILED, f"convex program {done}: {end.status}"
                break
            point = FCPoint(prepared.size * end.x)
            error = problem.residuals(point, budget.tolerance).error
            if record is not None:
                record(done, error, lambda point=point: point)
            wasted = 0 if error <= LOWER * least else wasted + 1
            if error < least:
                best, least = point, error
            if error <= budget.tolerance:
                return SolverOutput(claim=Claim.SOLVED, point=point, counters=counters, message=end.status)
            why = progress.trouble(done, error)
            if why is not None:
                claim, message = Claim.FAILED, why
                break
            if wasted >= PATIENCE:
                length, wasted = max(0.5 * length, SHORTEST), 0
            frozen = frozen + length * (prepared.shift(end.x) - frozen)
        return SolverOutput(claim=claim, point=best, counters=counters, message=f"{message}, error {least:.1e}")


class Relaxation(ConicFixedPoint):
    """min ½rᵀWr + qᵀr over the friction cones (Anitescu and Tasora 2010): K*_μ ∋ Wr + q ⟂ r ∈ K_μ, the law without De
    Saxcé's term. Separated and sticking contacts obey the exact law in its solution; a sliding contact with μ > 0 lifts
    off with u_N = μ‖u_T‖."""

    given = {"kind": Kind.RELAXATION}
    asymmetry = SYMMETRY_LIMIT

    def obstacle(self, problem: LocalContact) -> str | None:
        if problem.nc == 0:
            return "has no contact (nc = 0): there is nothing to minimise"
        return super().obstacle(problem)

    def solve(
        self,
        prepared: ScaledContact,
        budget: Budget,
        options: Any,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        end = self.model(prepared, budget).solve()
        claim, counters = end.claim, {"iterations": end.iterations}
        if not end.usable:
            claim = claim if claim in (Claim.INFEASIBLE, Claim.UNBOUNDED) else Claim.FAILED
            return SolverOutput(claim=claim, counters=counters, message=end.status)
        return SolverOutput(claim=claim, point=FCPoint(prepared.size * end.x), counters=counters, message=end.status)


for _kind, _rows in tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8")).items():
    for _row in _rows:
        solvers.add(_row["name"], {"fixed_point": ConicFixedPoint, "relaxation": Relaxation}[_kind](_row))
