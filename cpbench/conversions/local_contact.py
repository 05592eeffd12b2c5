"""Conversions of contact in terms of reactions: fc (those by facets stand in `fc_facets`), rfc, afc and fcm."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.conversions import contact_laws, elimination
from cpbench.conversions import facets as polygon
from cpbench.conversions.base import Conversion, SameUnknowns, Size, edge
from cpbench.conversions.contact_laws import Frozen, FrozenConeQP, InUnits, OverCones, ToConeQP, Units
from cpbench.conversions.elimination import Elimination
from cpbench.conversions.facets import InscribedEdge, PolygonEdge
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import SOCLCP, ConeQP, cone_fields
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.formulations.local_contact import (
    AnisotropicFrictionContact,
    FCMPoint,
    FrictionContact,
    MixedFrictionContact,
    RollingFrictionContact,
)
from cpbench.formulations.nonlinear import MiCP, MiCPPoint
from cpbench.formulations.variational import QVI
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Dense, Vector, max_abs, with_diagonal


@edge("fc-coneqp")
class FCtoConeQP(FrozenConeQP):
    """Frictional contact → cone QP, De Saxcé's shift contact_laws.

    Source  u = Wr + q,  K*_μ ∋ u + μ‖u_T‖e_N ⟂ r ∈ K_μ,  W symmetric.
    Target  min ½rᵀWr + (q + s e_N)ᵀr over r ∈ ΠK_μ, with s_c given for μ_c‖u_Tc‖ (0 by default).
    Lift    r.        Push  r, y = Wr + q + s e_N.
    Kind    relaxation: with s = 0 that of Anitescu and Tasora, exact where no contact moves along, open ones included
            (W = I, q = (0.1, 1, 0), μ = 0.5: the law has r = 0, the relaxation r_N = 0.32); one step of the fixed point
            on s (Haslinger; Acary and Cadoux) otherwise.

    `slip`: s_c [m/s], one number a contact, none for s = 0. Trace: `W`, `q` (shifted).
    """

    instead = "use fc-soclcp"


@edge("fc-coneqp-compliant", equation="Todorov 2014", cost=3.5)
class FCtoCompliantConeQP(ToConeQP):
    """Frictional contact → strictly convex cone QP: contacts that give way, and dilate where they slide.

    Source  u = Wr + q,  K*_μ ∋ u + μ‖u_T‖e_N ⟂ r ∈ K_μ,  W symmetric.
    Target  min ½rᵀ(W + R)r + qᵀr over r ∈ ΠK_μ, R = κ diag(1/ρ_c), ρ_c = d/tr W_cc: every contact has κ times the mean
            of its own mobilities in series with them.
    Lift    r.        Push  r, y = (W + R)r + q.
    Kind    relaxation: MuJoCo's model of contact (Todorov 2014), whose forces are unique where the rigid law's are not.
            It drops De Saxcé's term, as `fc-coneqp` does, and lets a contact sink with the velocity (Rr)_N.

    The default κ is that of MuJoCo's hardest contact, impedance d = 0.9999: κ = (1 − d)/d.

    `compliance`: κ, relative to the contact's own. Trace: `W` (with R), `q`.
    """

    compliance: float = 1e-4

    def obstacle(self, problem: FrictionContact) -> str | None:
        if not 0 < self.compliance < math.inf:
            return f"compliance is {self.compliance:g}, expected a number > 0; use fc-coneqp for none"
        return contact_laws.asymmetric("W", problem.W, "use fc-soclcp")

    def apply(self, problem: FrictionContact) -> tuple[ConeQP, Trace]:
        self.require(problem)
        R = np.repeat(self.compliance / problem.rho, problem.dimension)
        W = with_diagonal(problem.W, R)
        target = ConeQP.over(W, problem.q, contact_laws.cones(problem))
        return target, {"W": target.Q, "q": problem.q}


@edge("fc-coneqp-tresca", equation="Tresca", cost=4.0)
class FCtoConeQPTresca(ToConeQP):
    """Frictional contact → convex QP over cylinders, friction thresholds frozen (Tresca).

    Source  u = Wr + q, contact law with −u_T ∈ N_{D(μ r_N)}(r_T),  W symmetric.
    Target  min ½rᵀWr + qᵀr over r ∈ Π ℝ₊ × D(g_c), with g_c given for μ_c r_Nc.
    Lift    r.        Push  r, y = Wr + q.
    Kind    relaxation: the threshold no longer follows the normal reaction; one step of the fixed point g_c = μ_c r_Nc
            (Nečas, Jarušek, Haslinger 1980). Not given, g_c is μ_c max(−q_N, 0)/W_NN, the threshold of a contact alone.

    `threshold`: g_c [N s], one number a contact. Trace: `W`, `q`.
    """

    threshold: tuple[float, ...] = ()

    def obstacle(self, problem: FrictionContact) -> str | None:
        instead = "no conversion without a gradient leads to coneqp"
        return contact_laws.wrong_count("threshold", self.threshold, problem) or contact_laws.asymmetric(
            "W", problem.W, instead
        )

    def apply(self, problem: FrictionContact) -> tuple[ConeQP, Trace]:
        self.require(problem)
        g = np.array(self.threshold) if self.threshold else _alone(problem)
        K = ProductCone.of((Cone.CYLINDER, problem.nc, problem.dimension, g))
        return ConeQP.over(problem.W, problem.q, K), {"W": problem.W, "q": problem.q}


def _alone(problem: FrictionContact) -> Vector:
    """Return μ_c times the normal reaction that stops contact c without the others; 0 where W_NN is not positive."""
    normal = problem.diagonal_blocks[:, 0, 0]
    closing = np.maximum(-problem.q[:: problem.dimension], 0.0)
    return problem.mu * np.divide(closing, normal, out=np.zeros_like(closing), where=normal > 0)


@edge("fc-cp", equation="(17)")
class FCtoCP(OverCones):
    """Frictional contact → cone complementarity problem (equation (17)).

    Source  u = Wr + q,  K*_μ ∋ û = u + μ‖u_T‖e_N ⟂ r ∈ K_μ at every contact.
    Target  K_μ ∋ x ⟂ F(x) ∈ K*_μ with F(x) = û in units of the problem, r = Dx (`contact_laws`).
    Lift    Dx.        Push  D⁻¹r.
    Kind    equivalent. F is not differentiable where a tangential velocity is 0; the derivative given there is that of
            no slip. It is not monotone either, whatever W is.

    Trace: `unit`, `size`, `steepness`.
    """

    unknown = "x"


NOTHING = 1e-8
"""x_N (y_N) at most this times the largest component of x (y) counts as 0."""


@edge("fc-micp", equation="(49)", kind=Kind.EQUIVALENT, cost=4.0)
class FCtoMiCP(Conversion):
    """Frictional contact → mixed complementarity problem (equation (49)).

    Source  u = Wr + q,  0 ≤ u_N ⟂ r_N ≥ 0,  −u_T ∈ N_D(μ r_N)(r_T).
    Target  z = (x_N, x_T, ξ) a contact, in units of the problem with r_N = D x_N, r_T = μD x_T and y the velocities
            that go with them (`contact_laws`), so that μ is 1:

                0 ≤ x_N ⟂ y_N ≥ 0,   x_N y_T + (ξ + y_N) x_T = 0 (x_T free),   0 ≤ ξ ⟂ x_N − ‖x_T‖ + y_N ≥ 0.

            (49) itself has ‖r_T‖u_T + ξ r_T = 0 and 0 ≤ ξ ⟂ μr_N − ‖r_T‖ ≥ 0 for the last two rows. With ‖r_T‖ in place
            of μr_N the middle one lets r_T = 0, r_N > 0, u_T ≠ 0, ξ = 0 through, which is no friction. Without y_N the
            rows are the same where x_N > 0, for then y_N = 0, and singular where x_N = 0: ξ may be anything. With it
            they say x_T = 0, ξ = 0 where x_N = 0 < y_N, and are regular (were ‖x_T‖ = y_N, the first would say x_T =
            0). Where μ = 0: 0 ≤ x_N ⟂ y_N ≥ 0, x_T = 0, ξ = 0.
    Lift    r = Dx, its x_T shortened to x_N where the last row leaves it longer.
    Push    x = D⁻¹r, ξ = ‖y_T‖, 0 where y_N > 0.
    Kind    equivalent in r. Singular where x_N = 0 = y_N, 0 < μ; `singular` tells these contacts.

    Trace: `unit`, `size`, `mu`, and `W`, `q` for the velocities.
    """

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for three digits more: the middle row is a product, small where x_N is whatever y_T may be."""
        return 1e-3 * tolerance

    def apply(self, problem: FrictionContact) -> tuple[MiCP, Trace]:
        """Convert, with the result of a few projections as start (`contact_laws.approached`): at 0 the derivative is
        singular.
        """
        nc, d = problem.nc, problem.dimension
        chosen = _units(problem)
        trace = {**chosen.trace, "mu": problem.mu, "W": problem.W, "q": problem.q}
        lb = np.full((nc, d + 1), -np.inf)
        lb[:, [0, d]] = 0.0
        start = self.push(contact_laws.approached(problem, contact_laws.units(problem)), trace)
        F = _map(problem, chosen)
        return MiCP(F=F, lb=lb.ravel(), ub=np.full(lb.size, np.inf), start=start.z), trace

    def lift(self, point: MiCPPoint, trace: Trace) -> FCPoint:
        chosen, mu = Units.of_trace(trace), np.asarray(trace["mu"])
        x = contact_laws.by_contact(point.z, mu.size)[:, :-1]
        return chosen.reactions(contact_laws.clipped(x, np.where(mu > 0, 1.0, 0.0)).ravel())

    def push(self, point: FCPoint, trace: Trace) -> MiCPPoint:
        mu = np.asarray(trace["mu"])
        x, y = _states(point, trace)
        slides = (mu > 0) & ((x[:, 0] > 0) | (y[:, 0] <= 0))
        xi = np.where(slides, np.linalg.norm(y[:, 1:], axis=1), 0.0)
        return MiCPPoint(z=np.column_stack([x, xi]).ravel() if mu.size else np.zeros(0))

    def remark(self, point: MiCPPoint, trace: Trace) -> str:
        contacts = self.singular(point, trace)
        if not contacts.size:
            return ""
        first = ", ".join(map(str, contacts[:5])) + (", ..." if contacts.size > 5 else "")
        return (
            f"(49) is singular at {contacts.size} of {np.asarray(trace['mu']).size} contacts ({first}): there its "
            "error bounds that of the reactions by a root only"
        )

    def singular(self, point: MiCPPoint, trace: Trace) -> NDArray[np.intp]:
        """Return contacts at which the rows are singular in this answer: friction, but nothing to carry it."""
        x, y = _states(self.lift(point, trace), trace)
        still = np.asarray(trace["mu"]) > 0
        for part in (x, y):
            still = still & (part[:, 0] <= NOTHING * max_abs(part))
        return np.flatnonzero(still)


def _states(point: FCPoint, trace: Trace) -> tuple[Dense, Dense]:
    """Return x and y, a row a contact."""
    chosen, nc = Units.of_trace(trace), np.asarray(trace["mu"]).size
    y = chosen.unit * (trace["W"] @ point.r + trace["q"]) / chosen.size**2
    return contact_laws.by_contact(chosen.own(point), nc), contact_laws.by_contact(y, nc)


def _units(problem: FrictionContact) -> Units:
    """Return units as `contact_laws.units`, with μ among the tangential ones where it is positive."""
    chosen = contact_laws.units(problem)
    factor = np.ones((problem.nc, problem.dimension))
    factor[:, 1:] = np.where(problem.mu > 0, problem.mu, 1.0)[:, None]
    return Units(chosen.unit * factor.ravel(), chosen.size)


def _map(problem: FrictionContact, chosen: Units) -> Map:
    nc, d = problem.nc, problem.dimension
    record = MapRecorder((d + 1) * nc)
    Z = record.z.reshape(nc, d + 1)
    x, xi = Z[:, :d], Z[:, d]
    y = contact_laws.velocities(problem, chosen, x.ravel())
    rows: list[Any] = []
    for c in range(nc):
        xn, xt, gap = x[c, 0], x[c, 1:], y[c, 0]
        rubs = [xn * y[c, 1:] + (xi[c] + gap) * xt, xn - contact_laws.row_norms(xt) + gap]
        rows += [y[c, 0], *(rubs if problem.mu[c] > 0 else [xt, xi[c]])]
    return record.map(*rows)


@edge("fc-qvi", equation="(22) with X(z)")
class FCtoQVI(InUnits):
    """Frictional contact → quasi-variational inequality: the disk of friction moves with the normal reaction.

    Source  u = Wr + q,  0 ≤ u_N ⟂ r_N ≥ 0,  −u_T ∈ N_D(μ r_N)(r_T), D(ρ) the disk (the interval in the plane) of radius
            ρ.
    Target  F(x)ᵀ(y − x) ≥ 0 for all y ∈ X(x) = Π ℝ₊ × D(μ x_N), F(x) = u in units of the problem, r = Dx
            (`contact_laws`). F is affine: what is not linear is the set.
    Lift    Dx.        Push  D⁻¹r.
    Kind    equivalent: N_X(x)(x) is the product of N_ℝ₊(x_N) and N_D(μ x_N)(x_T), which is Signorini's and Coulomb's
            law.

    Trace: `unit`, `size`.
    """

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for a digit more, as `fc-cp`."""
        return 0.1 * tolerance

    def apply(self, problem: FrictionContact) -> tuple[QVI, Trace]:
        chosen = contact_laws.units(problem)
        K = ProductCone.of((Cone.CYLINDER, problem.nc, problem.dimension, problem.mu))
        F = contact_laws.plain(problem, chosen)
        return QVI(F=F, **cone_fields(K)), chosen.trace  # pyright: ignore[reportArgumentType]


@edge("fc-soclcp")
class FCtoSOCLCP(Frozen, SameUnknowns):
    """Frictional contact → cone LCP, De Saxcé's shift frozen; W need not be symmetric.

    Source  u = Wr + q,  K*_μ ∋ u + μ‖u_T‖e_N ⟂ r ∈ K_μ.
    Target  K*_μ ∋ Wr + q + s e_N ⟂ r ∈ K_μ, with s_c given for μ_c‖u_Tc‖ (0 by default).
    Lift    r.        Push  r.
    Kind    relaxation: exact where no contact moves along, open ones included (see fc-coneqp), one step of the fixed
            point on s otherwise.

    `slip`: s_c [m/s], one number a contact, none for s = 0.
    """

    renamed = {"r": "x"}

    def apply(self, problem: FrictionContact) -> tuple[SOCLCP, Trace]:
        self.require(problem)
        q = self.shifted(problem.q, problem)
        return SOCLCP(M=problem.W, q=q, **cone_fields(contact_laws.cones(problem))), {}  # pyright: ignore[reportArgumentType]


@edge("fc-vi", equation="(22)")
class FCtoVI(OverCones):
    """Frictional contact → variational inequality (equation (22)).

    Source  u = Wr + q,  K*_μ ∋ û = u + μ‖u_T‖e_N ⟂ r ∈ K_μ at every contact.
    Target  F(x)ᵀ(y − x) ≥ 0 for all y ∈ ΠK_μ with F(x) = û in units of the problem, r = Dx (`contact_laws`).
    Lift    Dx.        Push  D⁻¹r.
    Kind    equivalent: a variational inequality over a cone is its complementarity problem. F is not monotone.

    Trace: `unit`, `size`, `steepness`.
    """


@edge("rfc-coneqp")
class RFCtoConeQP(FrozenConeQP):
    """Rolling frictional contact → cone QP, De Saxcé's shift frozen.

    Source  u = Wr + q,  K* ∋ u + (μ‖u_T‖ + μ_r‖ω‖)e_N ⟂ r ∈ K, K the rolling cone,  W symmetric.
    Target  min ½rᵀWr + (q + s e_N)ᵀr over r ∈ ΠK, with s_c given for μ_c‖u_Tc‖ + μ_rc‖ω_c‖ (0 by default).
    Lift    r.        Push  r, y = Wr + q + s e_N.
    Kind    relaxation: exact where no contact moves along or turns, open ones included; one step of the fixed point on
            s otherwise.

    `slip`: s_c [m/s], one number a contact, none for s = 0. Trace: `W`, `q` (shifted).
    """

    instead = "no conversion without a gradient leads to coneqp"


@edge("rfc-cp", equation="(17)")
class RFCtoCP(OverCones):
    """Rolling frictional contact → cone complementarity problem (equation (17)).

    Source  u = Wr + q,  K* ∋ û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N ⟂ r ∈ K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}.
    Target  K ∋ x ⟂ F(x) ∈ K* with F(x) = û in units of the problem, r = Dx, where μ_r has units too (`contact_laws`).
    Lift    Dx.        Push  D⁻¹r.
    Kind    equivalent. F is not differentiable where u_T or ω is 0, and not monotone.

    Trace: `unit`, `size`, `steepness`.
    """

    unknown = "x"


@edge("rfc-lcp-2d", equation="(47)-(48), rolling", kind=Kind.EQUIVALENT, cost=2.0)
class RFCtoLCP2D(PolygonEdge):
    """Rolling frictional contact → LCP in the plane, where the rolling cone is a polyhedron.

    Source  u = Wr + q, rolling contact law with r = (r_N, r_T, m).
    Target  x = (r_N, β₁, β₂, λ, γ₁, γ₂, κ) a contact, r_T = β₁ − β₂,  m = γ₁ − γ₂:
            0 ≤ r_N ⟂ u_N ≥ 0,  0 ≤ β ⟂ λ + (u_T, −u_T) ≥ 0,  0 ≤ λ ⟂ μ r_N − β₁ − β₂ ≥ 0,
                                0 ≤ γ ⟂ κ + (ω, −ω) ≥ 0,      0 ≤ κ ⟂ μ_r r_N − γ₁ − γ₂ ≥ 0.
    Lift    r = (r_N, β₁ − β₂, γ₁ − γ₂).        Push  positive and negative parts,  λ = |u_T|,  κ = |ω|.
    Kind    equivalent.

    Trace: `W`, `q`, `mu`, `mu_r`, for the multipliers of `push`.
    """

    def obstacle(self, problem: RollingFrictionContact) -> str | None:
        if problem.dimension == 3:
            return None
        return f"a contact has {problem.dimension} rows, where the cone has no facets; use rfc-lcp-facets"


@edge("rfc-lcp-facets", equation="(47)-(48), rolling", kind=Kind.APPROXIMATE, cost=4.0)
class RFCtoLCPFacets(InscribedEdge):
    """Rolling frictional contact → LCP by inscribed polygons for forces and moments.

    Source  u = Wr + q, rolling contact law with disks of radius μ r_N and μ_r r_N.
    Target  x = (r_N, β ∈ ℝ^ν, λ, γ ∈ ℝ^ν, κ) a contact, r_T = Dβ,  m = Dγ, d_i at angle + 2πi/ν:
            0 ≤ r_N ⟂ u_N ≥ 0,  0 ≤ β ⟂ λe + Dᵀu_T ≥ 0,  0 ≤ λ ⟂ μ r_N − eᵀβ ≥ 0,
                                0 ≤ γ ⟂ κe + Dᵀω ≥ 0,    0 ≤ κ ⟂ μ_r r_N − eᵀγ ≥ 0.
    Lift    r = (r_N, Dβ, Dγ).
    Push    r_T and m projected on their polygons, λ = max_i(−d_iᵀu_T), κ = max_i(−d_iᵀω).
    Kind    approximate: radii too small by up to 1 − cos(π/ν), directions off by up to 180°/ν whatever the speed.

    `facets` vertices on both circles, the first at `angle` [rad]. Trace: `W`, `q`, `mu`, `mu_r`, for `push`.
    """

    def obstacle(self, problem: RollingFrictionContact) -> str | None:
        wrong = polygon.wrong_knobs(self.facets, self.angle)
        if wrong is None and problem.dimension != 5:
            return f"a contact has {problem.dimension} rows, where the law is an LCP exactly; use rfc-lcp-2d"
        return wrong


@edge("rfc-vi", equation="(22)")
class RFCtoVI(OverCones):
    """Rolling frictional contact → variational inequality (equation (22)).

    Source  u = Wr + q,  K* ∋ û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N ⟂ r ∈ K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}.
    Target  F(x)ᵀ(y − x) ≥ 0 for all y ∈ ΠK with F(x) = û in units of the problem, r = Dx (`contact_laws`).
    Lift    Dx.        Push  D⁻¹r.
    Kind    equivalent: a variational inequality over a cone is its complementarity problem. F is not monotone.

    Trace: `unit`, `size`, `steepness`.
    """


@edge("afc-fc", equation="P_L, elliptic cone", kind=Kind.EQUIVALENT, cost=1.0)
class AFCtoFC(Conversion):
    """Anisotropic → isotropic frictional contact by scaling the tangents.

    Source  u = Wr + q, elliptic cone {‖(r₁/μ₁, r₂/μ₂)‖ ≤ r_N}, associated slip.
    Target  S = diag(1, μ₁, μ₂) a contact:  W′ = SWS,  q′ = Sq,  μ′ = 1.
    Lift    r = Sr′ (and u = S⁻¹u′).        Push  r′ = S⁻¹r.
    Kind    equivalent: where μ_i is 0, W′ and q′ have a row of 0, r_i is 0 and any r′_i in the cone will do.

    Trace: `S` and `divisor` (vectors).
    """

    def apply(self, problem: AnisotropicFrictionContact) -> tuple[FrictionContact, Trace]:
        S = problem.scaling
        W = matrices.scaled_both(problem.W, S)
        return FrictionContact(W=W, q=S * problem.q, mu=np.ones(problem.nc), dimension=3), {
            "S": S,
            "divisor": problem.divisor,
        }

    def lift(self, point: FCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=trace["S"] * point.r)

    def push(self, point: FCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.r / trace["divisor"])


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
