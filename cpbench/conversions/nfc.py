"""Conversions of nfc."""

from __future__ import annotations

import numpy as np

from cpbench.conversions.base import SameUnknowns, edge
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.global_contact import GlobalFrictionContact, NonlinearFrictionContact
from cpbench.foundation.matrices import Vector

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
