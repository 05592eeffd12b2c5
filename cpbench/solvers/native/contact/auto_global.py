"""Automatic choice on contact in global form, without condensation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.solvers.base import SolverSpec, register
from cpbench.solvers.native.automatic import AutomaticChoice, SolverPhase, automatic_spec

SWEEPS, ITERATIONS = 2_000, 1_000
"""Of Gauss–Seidel and of ADMM, which stand still for different reasons, before the other goes on from there."""


@register
class AutoGlobal(AutomaticChoice):
    """Sweeps over the velocities of the bodies and ADMM by turns, then each for as long as it gains; ADMM alone where
    joints hold the bodies together. Where W = HᵀM⁻¹H is affordable, `auto-fc` on it has more methods to choose
    from: the route `gfc → fc` leads there.
    """

    spec: ClassVar[SolverSpec] = automatic_spec("gfc", "auto-gfc", "Gauss-Seidel on the bodies and ADMM by turns")
    members: ClassVar[tuple[str, ...]] = ("nsgs-gfc", "admm-gfc")

    def phases(self, problem: GlobalFrictionContact) -> Sequence[SolverPhase]:
        if problem.b.size:
            return [SolverPhase("admm-gfc")]
        by_turns = [SolverPhase("nsgs-gfc", SWEEPS), SolverPhase("admm-gfc", ITERATIONS)]
        return [*by_turns, SolverPhase("nsgs-gfc", 10 * SWEEPS), SolverPhase("admm-gfc")]
