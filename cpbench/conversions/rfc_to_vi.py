"""Rolling frictional contact → variational inequality (equation (22)).

Source  u = Wr + q,  K* ∋ û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N ⟂ r ∈ K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}.
Target  F(x)ᵀ(y − x) ≥ 0 for all y ∈ ΠK with F(x) = û in units of the problem, r = Dx (`contact_maps`).
Lift    Dx.        Push  D⁻¹r.
Kind    equivalent: a variational inequality over a cone is its complementarity problem. F is not monotone.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import conversions
from cpbench.conversions.contact_cones import ToVI


@conversions.register("rfc-vi")
@dataclass(frozen=True)
class RFCtoVI(ToVI):
    """The law of Acary and Bourrier over the product of the rolling cones. Trace: `unit`, `size`, `steepness`."""

    name = "rfc-vi"
    source = "rfc"
