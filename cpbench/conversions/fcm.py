"""Conversions of fcm."""

from __future__ import annotations

import numpy as np

from cpbench.conversions import elimination
from cpbench.conversions.base import Size, edge
from cpbench.conversions.elimination import Elimination
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import FCMPoint, FrictionContact, MixedFrictionContact
from cpbench.foundation import matrices

PSEUDO_INVERSE_LIMIT = 2000
"""Most constraints whose singular R is pseudo-inverted (a dense singular value decomposition)."""
RANGE_TOLERANCE = 1e-9
"""Share of s or Vᵀ outside the range of R up to which they count as in it."""


@edge("fcm-fc", equation="P_L", cost=1.0)
class FCMtoFC(Elimination):
    """Local mixed → local frictional contact: the reactions of bilateral constraints eliminated.

    Source  u = Wr + Vλ + q,  Vᵀr + Rλ + s = 0, contact law.
    Target  u = (W − VR⁻¹Vᵀ)r + q − VR⁻¹s, the same law, the same r. A singular R (constraints that repeat each other)
            has R⁺ in its place when s and the columns of Vᵀ are in its range.
    Lift    λ = −R⁻¹(Vᵀr + s), of least norm where R is singular.        Push  r.
    Kind    equivalent while eps cond(R) <= 1e-8 (`elimination.LOSSLESS`), one-way beyond: the target may then lack
            solutions of the source, and what is lifted is as exact as rounding leaves it. Refused from cond(R) = 1e13
            on. A singular R is as good as the part of it that R⁺ inverts, and one-way where V N is not 0, N the null
            space of R: motions of the contacts then depend on parts of λ that r does not decide, and only the least λ
            is found.

    Trace: `factor` (R) or `pseudo` (R⁺), `V`, `s`.
    """

    eliminated = "R"

    def rcond(self, problem: MixedFrictionContact) -> float:
        """Return that of R, or of the part of a singular R that R⁺ inverts (1-norm)."""
        if not problem.factorization.singular:
            return problem.factorization.rcond
        sizes = [float(np.abs(part).sum(axis=0).max()) for part in (matrices.dense(problem.R), problem.pseudo_inverse)]
        return 1.0 / (sizes[0] * sizes[1]) if sizes[0] > 0.0 else 1.0

    def exactness(self, problem: MixedFrictionContact) -> Kind:
        return Kind.ONE_WAY if _free(problem) > RANGE_TOLERANCE else super().exactness(problem)

    def reservation(self, problem: MixedFrictionContact) -> str:
        free = _free(problem)
        if free > RANGE_TOLERANCE:
            return (
                f"R is singular and {free:.1e} of V acts on its null space: λ moves contacts in ways r does not decide"
            )
        return super().reservation(problem)

    def obstacle(self, problem: MixedFrictionContact) -> str | None:
        if not problem.factorization.singular:
            return None
        p = problem.s.size
        if p > PSEUDO_INVERSE_LIMIT:
            why = elimination.singularity(problem.factorization, "R", "take constraints out that repeat others")
            return f"{why} (more than {PSEUDO_INVERSE_LIMIT} constraints, no pseudo-inverse is tried)"
        inverse, R = problem.pseudo_inverse, matrices.dense(problem.R)
        outside = np.eye(p) - R @ inverse
        for name, rows in (("s", problem.s[:, None]), ("Vᵀ", matrices.dense(problem.V).T)):
            off, top = matrices.max_abs(outside @ rows), matrices.max_abs(rows)
            if off > RANGE_TOLERANCE * top:
                rank = matrices.rank(problem.R)
                return (
                    f"R ({p}x{p}, rank {rank}) is singular and {name} is not in its range, "
                    f"{off / top:.1e} of it is outside: the constraints contradict each other or bind r alone"
                )
        return None

    def predict(self, problem: MixedFrictionContact) -> Size:
        return elimination.size_bound(
            problem.V, problem.factorization, matrices.transpose(problem.V), matrices.nnz(problem.W)
        )

    def apply(self, problem: MixedFrictionContact) -> tuple[FrictionContact, Trace]:
        self.require(problem)
        V, factor = problem.V, problem.factorization
        trace = {"V": V, "s": problem.s}
        if factor.singular:
            inverse = problem.pseudo_inverse
            less = matrices.dense(V) @ inverse @ matrices.dense(V).T
            shift = V @ (inverse @ problem.s)
            trace["pseudo"] = inverse
        else:
            less = elimination.congruence(matrices.transpose(V), factor)
            shift = V @ factor.solve(problem.s)
            trace["factor"] = factor
        W = elimination.compact(problem.W - less)
        if matrices.is_symmetric(problem.W) and matrices.is_symmetric(problem.R):
            W = elimination.symmetrised(W)
        return FrictionContact(W=W, q=problem.q - shift, mu=problem.mu, dimension=problem.dimension), trace

    def lift(self, point: FCPoint, trace: Trace) -> FCMPoint:
        right = trace["V"].T @ point.r + trace["s"]
        lam = trace["factor"].solve(right) if "factor" in trace else trace["pseudo"] @ right
        return FCMPoint(r=point.r, lam=-lam)

    def push(self, point: FCMPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.r)


def _free(problem: MixedFrictionContact) -> float:
    """Return the share of V that acts on the null space of R, 0 where R is nonsingular."""
    top = matrices.max_abs(problem.V)
    if not problem.factorization.singular or top == 0.0:
        return 0.0
    null = np.eye(problem.s.size) - problem.pseudo_inverse @ matrices.dense(problem.R)
    return matrices.max_abs(problem.V @ null) / top
