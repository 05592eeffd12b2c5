"""Frictional contact in global form → with nonlinear dynamics, which the linear ones are a case of.

Source  Mv = Hr + f,  u = Hᵀv + w, contact law on (u, r).
Target  F(v) = Hr with F(v) = Mv − f, the same H, w and law.
Lift    v, r.        Push  v, r.
Kind    equivalent. The target has no joints: a problem with some is refused.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.expressions.recording import product, recorded
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.global_contact import GFCPoint
from cpbench.formulations.nfc import NFCPoint, NonlinearFrictionContact


@conversions.register("gfc-nfc")
@dataclass(frozen=True)
class GFCtoNFC(Conversion):
    """The affine map as a map. Trace: empty."""

    name = "gfc-nfc"
    source = "gfc"
    target = "nfc"
    equation = "P_LM in P"
    kind = Kind.EQUIVALENT
    cost = 2.0

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        if problem.b.size:
            return f"G has {problem.b.size} joints, and nfc none; eliminate them by gfc-fc"
        return None

    def apply(self, problem: GlobalFrictionContact) -> tuple[NonlinearFrictionContact, Trace]:
        self.require(problem)
        F = recorded(problem.f.size, lambda v: product(problem.M, v) - problem.f)
        target = NonlinearFrictionContact(F=F, H=problem.H, w=problem.w, mu=problem.mu, dimension=problem.dimension)
        return target, {}

    def lift(self, point: NFCPoint, trace: Trace) -> GFCPoint:
        return GFCPoint(v=point.v, r=point.r)

    def push(self, point: GFCPoint, trace: Trace) -> NFCPoint:
        return NFCPoint(v=point.v, r=point.r)
