"""Bodies and joints eliminated from a global contact problem: what gfc-fc, grfc-rfc, gfc-fcm and fcm-fc share.

With K = [[M, −G], [Gᵀ, 0]] (K = M without joints) and v, λ the velocities and joint reactions for given r,

    (v, λ) = K⁻¹(Hr + f, −b),   u = Wr + q,   W = [Hᵀ 0]K⁻¹[H; 0],   q = w + [Hᵀ 0]K⁻¹(f, −b).
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from cpbench.conversions import elimination
from cpbench.conversions.base import Conversion, Size
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.global_contact import GFCPoint, GlobalContact
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector

NO_LOCAL = "no contact problem in r alone exists: take constrained or massless unknowns out of the model first"


def obstacle(problem: GlobalContact) -> str | None:
    """Return why velocities and joint reactions do not follow from r; None when they do."""
    if not problem.b.size:
        return singular_mass(problem)
    instead = NO_LOCAL if problem.saddle.singular and problem.factorization.singular else "use gfc-fcm, which keeps λ"
    return elimination.singularity(problem.saddle, "the matrix [[M, -G], [Gᵀ, 0]] of bodies and joints", instead)


def kind(problem: GlobalContact) -> Kind:
    """Return the promise that the condition number of K allows."""
    return elimination.kind(problem.saddle.rcond)


def reservation(problem: GlobalContact) -> str:
    """Return the condition number behind `kind`."""
    return elimination.reservation(problem.saddle.rcond, "the matrix of bodies and joints")


def singular_mass(problem: GlobalContact) -> str | None:
    """Return the obstacle of edges that eliminate v by M alone."""
    return elimination.singularity(problem.factorization, "the mass matrix M", NO_LOCAL)


def condense(problem: GlobalContact) -> tuple[Matrix, Vector, Trace]:
    """Eliminate v: W, q and the trace: `factor` (K), `H`, `f`, `b`. W is symmetric to the last bit when M is
    symmetric.
    """
    H, joints = problem.H, problem.b.size
    if joints:
        H = matrices.block([[H], [matrices.zeros(joints, H.shape[1], H)]])
        W = elimination.product(matrices.transpose(H), problem.saddle, H)
        if matrices.is_symmetric(problem.M):  # then W is too, though K is not
            W = elimination.symmetrised(W)
    else:
        W = elimination.congruence(H, problem.factorization)
    return W, problem.free_velocity, {"factor": problem.saddle, "H": problem.H, "f": problem.f, "b": problem.b}


def size_bound(problem: GlobalContact) -> Size:
    """Bound the size of W that `condense` will make; joints couple all contacts."""
    if problem.b.size:
        return Size.dense(problem.w.size, problem.w.size)
    return elimination.size_bound(matrices.transpose(problem.H), problem.factorization, problem.H)


def lift(point: FCPoint, trace: Trace) -> GFCPoint:
    """Return (v, λ) = K⁻¹(Hr + f, −b)."""
    force = trace["H"] @ point.r + trace["f"]
    v, lam = np.split(trace["factor"].solve(np.concatenate([force, -trace["b"]])), [force.size])
    return GFCPoint(v=v, r=point.r, lam=lam)


class Condensation(Conversion):
    """Base of the edges that eliminate velocities and joint reactions. Trace: `factor` (K), `H`, `f`, `b`."""

    equation: ClassVar[str] = "P_LM → P_L"
    kind: ClassVar[Kind] = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    cost: ClassVar[float] = 1.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, GlobalContact)
        return kind(problem)

    def reservation(self, problem: GlobalContact) -> str:
        return reservation(problem)

    def obstacle(self, problem: GlobalContact) -> str | None:
        return obstacle(problem)

    def predict(self, problem: GlobalContact) -> Size:
        return size_bound(problem)

    def lift(self, point: FCPoint, trace: Trace) -> GFCPoint:
        return lift(point, trace)

    def push(self, point: GFCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.r)
