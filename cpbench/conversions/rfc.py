"""Conversions of rfc."""

from __future__ import annotations

from cpbench.conversions import facets as polygon
from cpbench.conversions.base import edge
from cpbench.conversions.contact_laws import FrozenConeQP, OverCones
from cpbench.conversions.facets import INTERVAL, InscribedEdge, PolygonEdge
from cpbench.formulations.base import Kind
from cpbench.formulations.local_contact import RollingFrictionContact
from cpbench.foundation.matrices import Dense


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

    @property
    def vertices(self) -> Dense:
        """[1, −1]."""
        return INTERVAL

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
