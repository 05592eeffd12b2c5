"""Frictional contact → variational inequality (equation (22)).

Source  u = Wr + q,  K*_μ ∋ û = u + μ‖u_T‖e_N ⟂ r ∈ K_μ at every contact.
Target  F(x)ᵀ(y − x) ≥ 0 for all y ∈ ΠK_μ with F(x) = û in units of the problem, r = Dx (`contact_maps`).
Lift    Dx.        Push  D⁻¹r.
Kind    equivalent: a variational inequality over a cone is its complementarity problem. F is not monotone.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import conversions
from cpbench.conversions.contact_cones import ToVI


@conversions.register("fc-vi")
@dataclass(frozen=True)
class FCtoVI(ToVI):
    """De Saxcé's law over the product of the friction cones. Trace: `unit`, `size`, `steepness`."""

    name = "fc-vi"
    source = "fc"
