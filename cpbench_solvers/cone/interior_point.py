"""A primal-dual interior point method with Nesterov and Todd's scaling, for monotone problems over cones.

Every factor of K becomes rows of {0}, ℝ₊ and Lorentz cones, ŝ = Gx + h with auxiliary unknowns for dual rolling cones
(`lorentz_rows`), and the path of

    Mx + p − Gᵀy = 0,  Gx + h − ŝ = 0,  ŝ ∘ y = μe

is followed to μ = 0 by Mehrotra's steps from outside: a prediction with μ = 0 tells how much of μ to keep and how the
product bends, one factorization serves both.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.errors import ProblemError
from cpbench.formulations.conic import SOCLCP, ConeQP
from cpbench.foundation import matrices
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Matrix, Vector, least_eigenvalue, max_abs
from cpbench.solvers.base import Budget, SolverSpec, Trait, register, solvers
from cpbench.solvers.shared.lorentz_rows import lorentz_rows
from cpbench.solvers.shared.polish import polish
from cpbench_solvers.cone.lorentz_scaling import GroupScaling, LorentzCones
from cpbench_solvers.cone.run import ConicSolver, Iterates
from cpbench_solvers.cone.scaled_form import ConicForm

FRACTION = 0.99
"""How much of the way to the boundary a step goes at most."""
REGULAR = 1e-12
"""On the diagonal, for the factorization only: refinement takes it out again."""
REFINEMENTS = 2
SHORT = 1e-6
"""A step of less stands still."""
LOST = "no step in double precision: the iterate is at the boundary"
NEAR, NEWTON_STEPS = 1e-2, 15
"""The last digits are looked for by that many steps of Newton's method at most, from errors below this."""


@dataclass(frozen=True)
class ConeInteriorPointOptions:
    """Options of interior-point-coneqp, interior-point-soclcp. `correction` : the exponent in μ⁺ = (1 −
    α)^correction μ, α the length of the prediction."""

    correction: float = 3.0
    max_iterations: int = 100


class CentralPath:
    """The iterates of one run; x, s and y are those of `ConicForm`, others those of the Lorentz cones."""

    def __init__(self, form: ConicForm, options: ConeInteriorPointOptions) -> None:
        self._form, self._options = form, options
        named, self._T, U, c = lorentz_rows(form.K)
        self._cones = LorentzCones.of(named)
        extra = U.shape[1]
        self._G = matrices.block([[sp.csr_array(self._T @ sp.csr_array(form.A)), U]])
        self._h = self._T @ form.b + c
        self._M = sp.csr_array(sp.block_diag([sp.csr_array(form.M), sp.csr_array((extra, extra))]))
        self._p = np.concatenate([form.p, np.zeros(extra)])
        self._sparse = matrices.is_sparse(form.M)
        if not self._sparse:
            self._G, self._M = matrices.dense(self._G), matrices.dense(self._M)
        self.counters = {"iterations": 0, "factorizations": 0}
        self._e = self._cones.identity()
        self._begin()

    @property
    def x(self) -> Vector:
        return self._x[: self._form.p.size]

    @property
    def s(self) -> Vector:
        return self._form.K.project(self._form.A @ self.x + self._form.b)

    @property
    def y(self) -> Vector:
        return self._T.T @ self._y

    def _begin(self) -> None:
        """Start where the equations hold with W = I, moved inside (Vandenberghe 2010, section 7.3)."""
        n = self._p.size
        solved = self._solver(sp.csr_array(sp.diags_array(self._e_all())))
        start = None if solved is None else solved(-self._p, -self._h)
        if start is None:
            self._x, y = np.zeros(n), np.zeros(self._h.size)
        else:
            self._x, y = start
        s = self._G @ self._x + self._h
        self._s, self._y = self._inside(s), self._inside(y)

    def _e_all(self) -> Vector:
        """Return 1 in every row but those of {0}."""
        one = np.zeros(self._cones.rows)
        for rows in self._cones.groups:
            one[rows] = 1.0
        return one

    def _inside(self, v: Vector) -> Vector:
        margin = self._cones.margin(v)
        if margin > 1e-8 * max(max_abs(v), 1.0) or not np.isfinite(margin):
            return v
        return v + (1.0 - margin) * self._e

    @np.errstate(all="ignore")
    def step(self) -> str | None:
        cones, s, y = self._cones, self._s, self._y
        scaling = GroupScaling.of(cones, s, y)
        lam = scaling.lam
        solve = self._solver(scaling.squared())
        if solve is None:
            return LOST
        stationarity = self._M @ self._x + self._p - self._G.T @ y
        # rows of {0} have no slack
        primal = self._G @ self._x + self._h - np.where(self._e_all() > 0, s, 0.0)
        mu = float(lam @ lam) / max(cones.degree, 1)

        def direction(r: Vector, share: float) -> tuple[Vector, Vector, Vector, Vector] | None:
            """Return dx, dy, W⁻¹ds, W dy with λ∘(W⁻¹ds + W dy) = −r, `share` of the residuals left out."""
            d = cones.divided(lam, r)
            solution = solve(-(1.0 - share) * stationarity, -(1.0 - share) * primal - scaling.times(d))
            if solution is None:
                return None
            dx, dy = solution
            scaled = scaling.times(dy)
            return dx, dy, -d - scaled, scaled

        prediction = direction(cones.product(lam, lam), 0.0)
        if prediction is None:
            return LOST
        alpha = self._length(scaling, prediction[2], prediction[3], 1.0)
        # Mehrotra's: the further the prediction got, the less centering
        sigma = (1.0 - alpha) ** self._options.correction
        bend = cones.product(prediction[2], prediction[3])
        solution = direction(cones.product(lam, lam) + bend - sigma * mu * self._e, sigma)
        if solution is None:
            return LOST
        dx, dy, ds, dy_scaled = solution
        alpha = self._length(scaling, ds, dy_scaled, FRACTION)
        if not alpha > SHORT:
            return f"steps of length {alpha:.0e} only, after {self.counters['iterations']} iterations"
        self._x, self._y = self._x + alpha * dx, y + alpha * dy
        self._s = s + alpha * scaling.times(ds)
        return None

    def _length(self, scaling: GroupScaling, ds: Vector, dy: Vector, share: float) -> float:
        """Return the length of the step, in the scaled space, where both parts are λ."""
        longest = min(self._cones.longest(scaling.lam, d) for d in (ds, dy))
        return min(1.0, share * longest)

    def _solver(self, squared: Any) -> Any:
        """Return (a, c) -> (dx, dy) with M dx − Gᵀdy = a, G dx + W²dy = c; None where it is singular."""
        n, m = self._p.size, self._h.size
        W2: Matrix = squared if self._sparse else squared.toarray()
        K = matrices.block([[self._M, -matrices.transpose(self._G)], [self._G, W2]])
        shift = REGULAR * max(max_abs(self._M), 1.0) * np.ones(n + m)
        eye: Any = sp.csr_array(sp.diags_array(shift)) if self._sparse else np.diag(shift)
        factors = Factorization(K + eye)
        self.counters["factorizations"] += 1

        def solve(a: Vector, c: Vector) -> tuple[Vector, Vector] | None:
            right = np.concatenate([a, c])
            try:
                v = np.asarray(factors.solve(right))
                # refined with K, so that the shift, which only keeps pivots away from 0, is not in the answer
                for _ in range(REFINEMENTS):
                    v = v + factors.solve(right - K @ v)
            except ProblemError:
                return None
            return (v[:n], v[n:]) if np.isfinite(v).all() else None

        return solve


class _InteriorPoint(ConicSolver):
    """Base of the solvers of the two nodes."""

    window = 15
    every = True

    def begin(
        self, form: ConicForm, start: tuple[Vector, Vector] | None, options: ConeInteriorPointOptions
    ) -> Iterates:
        return CentralPath(form, options)

    def finish(
        self, form: ConicForm, best: Any, error: float, tolerance: float, counters: dict[str, int]
    ) -> tuple[Any, float]:
        """Return the last digits, which are lost near the boundary of a cone: a gap δ is an error of √δ there."""
        if not tolerance < error < NEAR or not best.finite:
            return best, error
        if isinstance(form.problem, ConeQP):
            best, error, steps = polish(form.problem, best, tolerance, NEWTON_STEPS, form.error)
        else:
            budget = Budget(tolerance=tolerance, iterations=NEWTON_STEPS)
            ended = solvers.get("newton-soclcp").run(form.problem, budget, start=best)
            steps, reached = ended.counters["iterations"], form.error(ended.point)
            best, error = (ended.point, reached) if reached < error else (best, error)
        counters["polishing_steps"] = steps
        return best, error


_spec = partial(
    SolverSpec,
    method="interior point",
    traits=frozenset({Trait.SPARSE, Trait.HISTORY, Trait.DETERMINISTIC}),
    options=ConeInteriorPointOptions,
)


@register
class InteriorPointCone(_InteriorPoint):
    """Ten to twenty iterations for Q ⪰ 0 with a point inside K; the last digits by Newton on the natural map."""

    spec: ClassVar[SolverSpec] = _spec(
        name="interior-point-coneqp",
        node="coneqp",
        summary="primal-dual interior point, Nesterov-Todd scaling, predictor-corrector",
        citation="Nesterov and Todd 1997, Math. Oper. Res. 22:1; Mehrotra 1992, SIAM J. Optim. 2:575; "
        "Vandenberghe 2010, The CVXOPT linear and quadratic cone program solvers",
    )


@register
class InteriorPointSOCLCP(_InteriorPoint):
    """The same for monotone M, symmetric or not."""

    spec: ClassVar[SolverSpec] = _spec(
        name="interior-point-soclcp",
        node="soclcp",
        summary="primal-dual interior point, Nesterov-Todd scaling, for monotone maps",
        citation="Nesterov and Todd 1997, Math. Oper. Res. 22:1; Yoshise 2006, SIAM J. Optim. 17:1129",
    )

    def obstacle(self, problem: ConeQP | SOCLCP) -> str | None:
        if isinstance(problem, SOCLCP) and not problem.monotone:
            least = least_eigenvalue(problem.M)
            return f"not monotone: M + Mᵀ has, at unit diagonal, the eigenvalue {least:.1e}: use newton-soclcp"
        return super().obstacle(problem)
