"""Conversions of contact with the dynamics of the bodies: gfc, grfc and nfc."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from cpbench.conversions import contact_laws, elimination
from cpbench.conversions.base import Conversion, SameUnknowns, Size, edge
from cpbench.conversions.contact_laws import Frozen
from cpbench.conversions.elimination import Elimination
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.expressions.recording import product, recorded
from cpbench.formulations.global_contact import (
    GFCPoint,
    GlobalContact,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    NonlinearFrictionContact,
)
from cpbench.formulations.linear import MLCP, MLCPPoint
from cpbench.formulations.local_contact import FCMPoint, FrictionContact, MixedFrictionContact, RollingFrictionContact
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.foundation.text import counted

NO_LOCAL = "no contact problem in r alone exists: take constrained or massless unknowns out of the model first"


def singular_mass(problem: GlobalContact) -> str | None:
    """Return the obstacle of edges that eliminate v by M alone."""
    return elimination.singularity(problem.factorization, "the mass matrix M", NO_LOCAL)


def condense(problem: GlobalContact) -> tuple[Matrix, Vector, Trace]:
    """Eliminate velocities and joint reactions: W, q and the trace: `factor` (K), `H`, `f`, `b`.

    With K = [[M, −G], [Gᵀ, 0]] (K = M without joints) and v, λ the velocities and joint reactions for given r,

        (v, λ) = K⁻¹(Hr + f, −b),   u = Wr + q,   W = [Hᵀ 0]K⁻¹[H; 0],   q = w + [Hᵀ 0]K⁻¹(f, −b).

    W is symmetric to the last bit when M is symmetric.
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


class Condensation(Elimination):
    """Base of the edges that eliminate velocities and joint reactions. Trace: `factor` (K), `H`, `f`, `b`."""

    equation: ClassVar[str] = "P_LM → P_L"
    cost: ClassVar[float] = 1.0
    eliminated = "the matrix of bodies and joints"

    def rcond(self, problem: GlobalContact) -> float:
        return problem.saddle.rcond

    def obstacle(self, problem: GlobalContact) -> str | None:
        if not problem.b.size:
            return singular_mass(problem)
        instead = "use gfc-fcm, which keeps λ"
        if problem.saddle.singular and problem.factorization.singular:
            instead = NO_LOCAL
        return elimination.singularity(problem.saddle, "the matrix [[M, -G], [Gᵀ, 0]] of bodies and joints", instead)

    def predict(self, problem: GlobalContact) -> Size:
        if problem.b.size:  # joints couple all contacts
            return Size.dense(problem.w.size, problem.w.size)
        return elimination.size_bound(matrices.transpose(problem.H), problem.factorization, problem.H)

    def lift(self, point: FCPoint, trace: Trace) -> GFCPoint:
        force = trace["H"] @ point.r + trace["f"]
        v, lam = np.split(trace["factor"].solve(np.concatenate([force, -trace["b"]])), [force.size])
        return GFCPoint(v=v, r=point.r, lam=lam)

    def push(self, point: GFCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.r)


@edge("gfc-coneqp")
class GFCtoConeQP(Frozen):
    """Global frictional contact → cone QP in the velocities, De Saxcé's shift frozen (the dual form).

    Source  Mv = Hr + Gλ + f,  Gᵀv + b = 0,  u = Hᵀv + w,  K*_μ ∋ u + μ‖u_T‖e_N ⟂ r ∈ K_μ,  M symmetric.
    Target  min ½vᵀMv − fᵀv  subject to  Hᵀv + w + s e_N ∈ ΠK*_μ,  Gᵀv + b = 0, with s_c given for μ_c‖u_Tc‖.
    Lift    v; r and λ are the multipliers.        Push  v, y = (r, λ).
    Kind    relaxation: exact where no contact moves along, open ones included; one step of the fixed point on s
            otherwise (Acary, Cadoux, Lemaréchal and Malick 2011). Nothing is eliminated, so M may be singular.

    `slip`: s_c [m/s], one number a contact, none for s = 0. Trace: `contacts` (rows of H).
    """

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        why = contact_laws.asymmetric("M", problem.M, "use gfc-fc, then fc-soclcp")
        return super().obstacle(problem) or why

    def apply(self, problem: GlobalFrictionContact) -> tuple[ConeQP, Trace]:
        self.require(problem)
        d, m = problem.dimension, problem.w.size
        w = self.shifted(problem.w, problem)
        primal = ProductCone.of((Cone.SECOND_ORDER, problem.nc, d, problem.mu), (Cone.FREE, 1, problem.b.size))
        A = matrices.block([[matrices.transpose(problem.H)], [matrices.transpose(problem.G)]])
        target = ConeQP.over(problem.M, -problem.f, primal.dual(), A, np.concatenate([w, problem.b]))
        return target, {"contacts": m}

    def lift(self, point: ConeQPPoint, trace: Trace) -> GFCPoint:
        r, lam = np.split(point.y, [trace["contacts"]])
        return GFCPoint(v=point.x, r=r, lam=lam)

    def push(self, point: GFCPoint, trace: Trace) -> ConeQPPoint:
        return ConeQPPoint(x=point.v, y=np.concatenate([point.r, point.lam]))


@edge("gfc-fc")
class GFCtoFC(Condensation):
    """Global → local frictional contact: the Delassus operator (P_LM → P_L).

    Source  Mv = Hr + Gλ + f,  Gᵀv + b = 0,  u = Hᵀv + w, contact law on (u, r);  K = [[M, −G], [Gᵀ, 0]] nonsingular.
    Target  u = Wr + q,  W = [Hᵀ 0]K⁻¹[H; 0],  q = w + [Hᵀ 0]K⁻¹(f, −b), the same law, the same r. Without joints
            W = HᵀM⁻¹H,  q = HᵀM⁻¹f + w.
    Lift    (v, λ) = K⁻¹(Hr + f, −b).        Push  r.
    Kind    equivalent while eps cond(K) <= 1e-8 (`elimination.LOSSLESS`), one-way beyond: the target may then lack
            solutions of the source, and what is lifted is as exact as rounding leaves it. Refused from cond(K) = 1e13
            on. M may be nonsymmetric, or singular by itself.

    Trace: `factor` (K), `H`, `f`, `b`.
    """

    def apply(self, problem: GlobalFrictionContact) -> tuple[FrictionContact, Trace]:
        self.require(problem)
        W, q, trace = condense(problem)
        return FrictionContact(W=W, q=q, mu=problem.mu, dimension=problem.dimension), trace


@edge("gfc-fcm", equation="P_LM → P_L", cost=2.0)
class GFCtoFCM(Elimination):
    """Global → local mixed frictional contact: velocities eliminated, joint reactions kept (FCLIB local with V, R, s).

    Source  Mv = Hr + Gλ + f,  Gᵀv + b = 0,  u = Hᵀv + w, contact law;  M symmetric and nonsingular.
    Target  u = Wr + Vλ + q,  Vᵀr + Rλ + s = 0, the same law:  W = HᵀM⁻¹H,  V = HᵀM⁻¹G,  R = GᵀM⁻¹G,
            q = HᵀM⁻¹f + w,  s = GᵀM⁻¹f + b.
    Lift    v = M⁻¹(Hr + Gλ + f).        Push  r, λ.
    Kind    equivalent while eps cond(M) <= 1e-8 (`elimination.LOSSLESS`), one-way beyond: the target may then lack
            solutions of the source, and what is lifted is as exact as rounding leaves it. Refused from cond(M) = 1e13
            on. M must be symmetric because the schema has one V for both rows.

    Trace: `factor` (M), `H`, `G`, `f`.
    """

    eliminated = "the mass matrix M"

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        if not matrices.is_symmetric(problem.M):
            asymmetry = matrices.asymmetry(problem.M)
            return f"M is not symmetric, asymmetry = {asymmetry:.1e}: Vᵀ would not be Gᵀ M⁻¹ H; use gfc-fc"
        return singular_mass(problem)

    def apply(self, problem: GlobalFrictionContact) -> tuple[MixedFrictionContact, Trace]:
        self.require(problem)
        factor, H, G = problem.factorization, problem.H, problem.G
        free = factor.solve(problem.f)
        target = MixedFrictionContact(
            W=elimination.congruence(H, factor),
            V=elimination.product(matrices.transpose(H), factor, G),
            R=elimination.congruence(G, factor),
            q=H.T @ free + problem.w,
            s=G.T @ free + problem.b,
            mu=problem.mu,
            dimension=problem.dimension,
        )
        return target, {"factor": factor, "H": H, "G": G, "f": problem.f}

    def lift(self, point: FCMPoint, trace: Trace) -> GFCPoint:
        force = trace["H"] @ point.r + trace["G"] @ point.lam + trace["f"]
        return GFCPoint(v=trace["factor"].solve(force), r=point.r, lam=point.lam)

    def push(self, point: GFCPoint, trace: Trace) -> FCMPoint:
        return FCMPoint(r=point.r, lam=point.lam)


@edge("gfc-mlcp", equation="(40)", kind=Kind.EQUIVALENT, cost=1.0)
class GFCtoMLCP(Conversion):
    """Frictionless global contact → MLCP (equation (40)).

    Source  Mv = Hr + Gλ + f,  Gᵀv + b = 0,  u = Hᵀv + w,  μ = 0: r_T = 0,  0 ≤ r_N ⟂ u_N ≥ 0.
    Target  (v, λ) free, complementary r_N:  A = [[M, −G], [Gᵀ, 0]],  C = [−H_N; 0],  D = [H_Nᵀ, 0],  B = 0,
            a = (−f, b),  b = w_N.
    Lift    v, λ, r = (r_N, 0).        Push  the same, backwards.
    Kind    equivalent. M may be singular. G and f are FCLIB's: the lecture's f has the opposite sign, and its G is Gᵀ
            here.

    Trace: `n` (velocities), `d` (rows of a contact).
    """

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        rubbing = np.flatnonzero(problem.mu)
        if not rubbing.size:
            return None
        c = int(rubbing[0])
        return (
            f"friction at {counted(rubbing.size, 'contact')}, the first is {c} with μ = {problem.mu[c]:g}; use gfc-fc"
        )

    def apply(self, problem: GlobalFrictionContact) -> tuple[MLCP, Trace]:
        self.require(problem)
        M, G, d, nc, p = problem.M, problem.G, problem.dimension, problem.nc, problem.b.size
        H_N: Matrix = problem.H[:, ::d]
        target = MLCP(
            A=matrices.block([[M, -G], [matrices.transpose(G), matrices.zeros(p, p, M)]]),
            B=matrices.zeros(nc, nc, M),
            C=matrices.block([[-H_N], [matrices.zeros(p, nc, M)]]),
            D=matrices.block([[matrices.transpose(H_N), matrices.zeros(nc, p, M)]]),
            a=np.concatenate([-problem.f, problem.b]),
            b=problem.w[::d],
        )
        return target, {"n": problem.f.size, "d": d}

    def lift(self, point: MLCPPoint, trace: Trace) -> GFCPoint:
        r = np.zeros(point.v.size * trace["d"])
        r[:: trace["d"]] = point.v
        return GFCPoint(v=point.u[: trace["n"]], r=r, lam=point.u[trace["n"] :])

    def push(self, point: GFCPoint, trace: Trace) -> MLCPPoint:
        return MLCPPoint(u=np.concatenate([point.v, point.lam]), v=point.r[:: trace["d"]])


@edge("gfc-nfc", equation="P_LM in P", kind=Kind.EQUIVALENT, cost=2.0)
class GFCtoNFC(SameUnknowns):
    """Frictional contact in global form → with nonlinear dynamics, which the linear ones are a case of.

    Source  Mv = Hr + f,  u = Hᵀv + w, contact law on (u, r).
    Target  F(v) = Hr with F(v) = Mv − f, the same H, w and law.
    Lift    v, r.        Push  v, r.
    Kind    equivalent. The target has no joints: a problem with some is refused.
    """

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        if problem.b.size:
            return f"G has {problem.b.size} joints, and nfc none; eliminate them by gfc-fc"
        return None

    def apply(self, problem: GlobalFrictionContact) -> tuple[NonlinearFrictionContact, Trace]:
        self.require(problem)
        F = recorded(problem.f.size, lambda v: product(problem.M, v) - problem.f)
        target = NonlinearFrictionContact(F=F, H=problem.H, w=problem.w, mu=problem.mu, dimension=problem.dimension)
        return target, {}


@edge("grfc-rfc")
class GRFCtoRFC(Condensation):
    """Global → local rolling frictional contact: the Delassus operator (P_LM → P_L).

    Source  Mv = Hr + Gλ + f,  Gᵀv + b = 0,  u = Hᵀv + w, rolling contact law;  K = [[M, −G], [Gᵀ, 0]] nonsingular.
    Target  u = Wr + q,  W = [Hᵀ 0]K⁻¹[H; 0],  q = w + [Hᵀ 0]K⁻¹(f, −b), the same law, the same r.
    Lift    (v, λ) = K⁻¹(Hr + f, −b).        Push  r.
    Kind    equivalent while eps cond(K) <= 1e-8 (`elimination.LOSSLESS`), one-way beyond: the target may then lack
            solutions of the source, and what is lifted is as exact as rounding leaves it. Refused from cond(K) = 1e13
            on. M may be nonsymmetric, or singular by itself.

    Trace: `factor` (K), `H`, `f`, `b`.
    """

    def apply(self, problem: GlobalRollingFrictionContact) -> tuple[RollingFrictionContact, Trace]:
        self.require(problem)
        W, q, trace = condense(problem)
        local = RollingFrictionContact(W=W, q=q, mu=problem.mu, mu_r=problem.mu_r, dimension=problem.dimension)
        return local, trace


PLACES = ("free", "start")


@edge("nfc-gfc", equation="P to P_LM", kind=Kind.RELAXATION, cost=2.0)
class NFCtoGFC(SameUnknowns):
    """Frictional contact with nonlinear dynamics → linear dynamics at one velocity: a step of Newton's method.

    Source  F(v) = Hr,  u = Hᵀv + w, contact law on (u, r).
    Target  Mv = Hr + f with M = F′(v₀), f = Mv₀ − F(v₀), the same H, w and law.
    Lift    v, r.        Push  v, r.
    Kind    equivalent where F is affine; else a relaxation: the terms of second order in v − v₀ are dropped, and the
            answer is that of the source only where it is v₀ itself. The solver newton-nfc takes such steps to the end.

    `at`: v₀ is the `free` motion, F(v₀) = 0, or the problem's `start`; `velocity`: v₀ itself, which then counts.
    """

    best_kind = Kind.EQUIVALENT

    at: str = "free"
    velocity: tuple[float, ...] = ()

    def exactness(self, problem: Problem) -> Kind:
        return Kind.EQUIVALENT if self._affine(problem) else Kind.RELAXATION

    def reservation(self, problem: NonlinearFrictionContact) -> str:
        if self._affine(problem):
            return ""
        terms = problem.F.compiled.C.shape[1]
        return f"F has {terms} nonlinear terms, which are linearized at one velocity; use the solver newton-nfc"

    def _affine(self, problem: Problem) -> bool:
        return isinstance(problem, NonlinearFrictionContact) and problem.F.compiled.affine

    def obstacle(self, problem: NonlinearFrictionContact) -> str | None:
        if self.at not in PLACES:
            return f"at = '{self.at}' is no place to linearize at; use {' or '.join(PLACES)}"
        if self.velocity and len(self.velocity) != problem.start.size:
            return f"velocity has {len(self.velocity)} numbers, v has {problem.start.size}"
        v = self._place(problem)
        if not (np.isfinite(problem.F(v)).all() and np.isfinite(problem.F.jacobian(v).data).all()):
            return f"F or its derivative is not finite at v₀ (‖v₀‖ = {np.linalg.norm(v):.1e}); use another `at`"
        return None

    def _place(self, problem: NonlinearFrictionContact) -> Vector:
        if self.velocity:
            return np.array(self.velocity, dtype=float)
        return problem.free_motion if self.at == "free" else problem.start

    def apply(self, problem: NonlinearFrictionContact) -> tuple[GlobalFrictionContact, Trace]:
        self.require(problem)
        return problem.linearized(self._place(problem)), {}
