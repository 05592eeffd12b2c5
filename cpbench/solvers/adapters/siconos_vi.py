"""Siconos' projection methods for variational inequalities (VI_Solvers), on sets with a projection in closed form.

Those over boxes stand with the mixed complementarity problems (`siconos_mcp`); `vi` has an edge there.
"""

from __future__ import annotations

from typing import Any

from cpbench.solvers.adapters.siconos import SiconosEntry, register_family
from cpbench.solvers.adapters.siconos_nonlinear import SiconosNonlinear
from cpbench.solvers.adapters.siconos_tolerances import Bound


class SiconosVI(SiconosNonlinear):
    """A solver of Siconos for a VI without rows: the guest projects on a product of cones, disks and balls, and on
    bounds."""

    node = "vi"

    def obstacle(self, problem: Any) -> str | None:
        rows = problem.b.size + problem.d.size + problem.g.rows
        if rows:
            return f"has {rows} rows (A, C, g) in its set, on which nothing projects in closed form"
        return super().obstacle(problem)


register_family(
    SiconosVI,
    SiconosEntry(
        name="siconos-vi-eg",
        constant="SICONOS_VI_EG",
        summary="extragradient with Khobotov's step",
        method="extragradient",
        citation="Korpelevich (1976); Khobotov, USSR Comput. Math. Math. Phys. 27 (1987)",
        warm=True,
        bound=Bound.SWEEPS,
        by_default=True,
    ),
    SiconosEntry(
        name="siconos-vi-fpp",
        constant="SICONOS_VI_FPP",
        summary="fixed-point projection with Khobotov's step",
        method="projection",
        citation="Facchinei and Pang, Finite-Dimensional Variational Inequalities (2003), section 12.1",
        warm=True,
        bound=Bound.SWEEPS,
    ),
    SiconosEntry(
        name="siconos-vi-hp",
        constant="SICONOS_VI_HP",
        summary="hyperplane projection of Konnov, step 1",
        method="hyperplane projection",
        citation="Facchinei and Pang, Finite-Dimensional Variational Inequalities (2003), section 12.3",
        warm=True,
        bound=Bound.OUTER,  # each iteration may search its line by a hundred evaluations, and it goes by 1/k
    ),
)
