"""Rolling frictional contact → cone complementarity problem (equation (17)).

Source  u = Wr + q,  K* ∋ û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N ⟂ r ∈ K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}.
Target  K ∋ x ⟂ F(x) ∈ K* with F(x) = û in units of the problem, r = Dx, where μ_r has units too (`contact_maps`).
Lift    Dx.        Push  D⁻¹r.
Kind    equivalent. F is not differentiable where u_T or ω is 0, and not monotone.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import conversions
from cpbench.conversions.contact_cones import ToCP


@conversions.register("rfc-cp")
@dataclass(frozen=True)
class RFCtoCP(ToCP):
    """The law of Acary and Bourrier as it stands. Trace: `unit`, `size`, `steepness`."""

    name = "rfc-cp"
    source = "rfc"
