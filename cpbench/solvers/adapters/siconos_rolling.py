"""Siconos' solvers of contact with rolling friction (rolling_fc_Solvers.h, global_rolling_fc_Solvers.h).

For `rfc` of dimension 5 and of dimension 3 (the plane), and for `grfc` of dimension 5 without joints. In space W is
dense, or sparse where the problem's is: in blocks, Siconos finds no diagonal block of 5 rows and aborts.
"""

from __future__ import annotations

from typing import Any

from cpbench.solvers.adapters.siconos import SiconosEntry, SiconosSolver, register_family

ROLLING = "Acary and Bourrier, Coulomb friction with rolling resistance as a cone complementarity problem (2021)"


class SiconosRolling(SiconosSolver):
    """A solver of Siconos for contact with rolling friction, local form."""

    node = "rfc"

    def obstacle(self, problem: Any) -> str | None:
        if problem.dimension != self.row.dimension:
            return f"is for contacts of {self.row.dimension} rows, these have {problem.dimension}"
        return super().obstacle(problem)


class SiconosGlobalRolling(SiconosSolver):
    """A solver of Siconos for contact with rolling friction in space, global form, no joints."""

    node = "grfc"

    def obstacle(self, problem: Any) -> str | None:
        if problem.dimension != self.row.dimension:
            return f"is for contacts of {self.row.dimension} rows, these have {problem.dimension}"
        if problem.b.size:
            return f"has {problem.b.size} rows of joints, which Siconos has not in this form"
        if not problem.nc:
            return "has no contacts: Siconos asserts that there are some and aborts"
        return super().obstacle(problem)


register_family(
    SiconosRolling,
    SiconosEntry(
        name="siconos-rfc3d-nsgs",
        constant="SICONOS_ROLLING_FRICTION_3D_NSGS",
        summary="Gauss–Seidel over the contacts, projections with local iterations in each",
        method="block Gauss–Seidel",
        citation=ROLLING,
        warm=True,
        storage="given",
        dimension=5,
        by_default=True,
        early={"velocity-unit-1e-08-5": 1.3e-01, "impulse-unit-1e+08-5": 1.3e-01, "velocity-unit-1e+08-5": 1.3e-01},
        false={"length-unit-1e-08-5": 4.5e-01, "length-unit-1e+08-5": 2.8e-01},
    ),
    SiconosEntry(
        name="siconos-rfc3d-admm",
        constant="SICONOS_ROLLING_FRICTION_3D_ADMM",
        summary="alternating direction method of multipliers on the rolling cone",
        method="ADMM",
        citation=ROLLING,
        dimension=5,
        false={
            "impulse-unit-1e-08-5": 2.0e-01,
            "length-unit-1e-08-5": 1.0e-01,
            "velocity-unit-1e+08-5": 2.0e-01,
            "length-unit-1e+08-5": 2.9e-01,
        },
    ),
    SiconosEntry(
        name="siconos-rfc2d-nsgs",
        constant="SICONOS_ROLLING_FRICTION_2D_NSGS",
        summary="Gauss–Seidel over the contacts of the plane, projections with local iterations in each",
        method="block Gauss–Seidel",
        citation=ROLLING,
        warm=True,
        storage="given",
        dimension=3,
        by_default=True,
        early={"impulse-unit-1e-08-3": 1.3e-01, "velocity-unit-1e+08-3": 1.3e-01},
        false={"length-unit-1e-08-3": 3.8e-01, "length-unit-1e+08-3": 1.2e-01},
    ),
)
register_family(
    SiconosGlobalRolling,
    SiconosEntry(
        name="siconos-grfc3d-nsgs-wr",
        constant="SICONOS_GLOBAL_ROLLING_FRICTION_3D_NSGS_WR",
        summary="condensed; Gauss–Seidel over the contacts",
        method="block Gauss–Seidel",
        citation=ROLLING,
        warm=True,
        storage="sparse",
        dimension=5,
        by_default=True,
    ),
)
