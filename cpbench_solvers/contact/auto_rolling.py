"""Automatic choice with rolling friction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import RollingFrictionContact
from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.automatic import AutomaticChoice, SolverPhase, automatic_spec
from cpbench_solvers.contact.by_parts import SURE
from cpbench_solvers.contact.parts import error_or_rounding

ITERATIONS = 200
"""Iterations of ADMM in its first turn."""
SWEEPS, CONTACTS = 2.5, 100
"""Sweeps, or contacts swept where that is more (below 40 contacts), that take as long as an iteration of ADMM."""


@register
class AutoRolling(AutomaticChoice):
    """Sweeps and ADMM by turns of equal work."""

    spec: ClassVar[SolverSpec] = automatic_spec("rfc", "auto-rfc", "Gauss-Seidel and ADMM by turns")
    members: ClassVar[tuple[str, ...]] = ("nsgs-rfc", "admm-rfc")

    def error(self, problem: RollingFrictionContact, point: FCPoint, tolerance: float) -> float:
        norms = super().error(problem, point, tolerance)
        return max(norms, error_or_rounding(problem, point.r, SURE * tolerance))

    def phases(self, problem: RollingFrictionContact) -> Sequence[SolverPhase]:
        a_turn = max(SWEEPS, CONTACTS / max(problem.nc, 1))
        sweeps, admm = self.members
        return [SolverPhase(sweeps, int(a_turn * ITERATIONS)), SolverPhase(admm, ITERATIONS)]
