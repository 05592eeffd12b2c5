"""Automatic choice with rolling friction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.solvers.base import SolverSpec, register
from cpbench.solvers.native.automatic import AutomaticChoice, SolverPhase, automatic_spec

TURNS = (500, 200), (2_000, 800)
"""Sweeps and iterations of ADMM of the first turns; the last ones have the solvers' own limits."""


@register
class AutoRolling(AutomaticChoice):
    """Sweeps from contact to contact and ADMM by turns, each from the best point so far, then each for as long as it
    gains."""

    spec: ClassVar[SolverSpec] = automatic_spec("rfc", "auto-rfc", "Gauss-Seidel and ADMM by turns")
    members: ClassVar[tuple[str, ...]] = ("nsgs-rfc", "admm-rfc")

    def phases(self, problem: RollingFrictionContact) -> Sequence[SolverPhase]:
        sweeps, admm = self.members
        turns = [(SolverPhase(sweeps, some), SolverPhase(admm, few)) for some, few in TURNS]
        return [phase for turn in (*turns, (SolverPhase(sweeps), SolverPhase(admm))) for phase in turn]
