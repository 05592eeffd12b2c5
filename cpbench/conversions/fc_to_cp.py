"""Frictional contact → cone complementarity problem (equation (17)).

Source  u = Wr + q,  K*_μ ∋ û = u + μ‖u_T‖e_N ⟂ r ∈ K_μ at every contact.
Target  K_μ ∋ x ⟂ F(x) ∈ K*_μ with F(x) = û in units of the problem, r = Dx (`contact_maps`).
Lift    Dx.        Push  D⁻¹r.
Kind    equivalent. F is not differentiable where a tangential velocity is 0; the derivative given there is that of
        no slip. It is not monotone either, whatever W is.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import conversions
from cpbench.conversions.contact_cones import ToCP


@conversions.register("fc-cp")
@dataclass(frozen=True)
class FCtoCP(ToCP):
    """De Saxcé's law as it stands. Trace: `unit`, `size`, `steepness`."""

    name = "fc-cp"
    source = "fc"
