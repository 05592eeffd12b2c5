"""Siconos' solvers of linear complementarity problems over second-order cones (SOCLCP_Solvers). M is dense."""

from __future__ import annotations

from typing import Any

from cpbench.product_cones import Cone
from cpbench.solvers.adapters.siconos import SiconosEntry, SiconosSolver, register_family

ROWS = 3
"""Rows of every cone: soclcp_compute_error ends the process on others."""


class SiconosSOCLCP(SiconosSolver):
    """A solver of Siconos for a product of second-order cones of three rows each."""

    node = "soclcp"

    def obstacle(self, problem: Any) -> str | None:
        others = int(((problem.cone_kind != Cone.SECOND_ORDER) | (problem.cone_size != ROWS)).sum())
        if others:
            return f"{others} of {problem.cone_kind.size} factors are no second-order cones of {ROWS} rows"
        return super().obstacle(problem)


register_family(
    SiconosSOCLCP,
    SiconosEntry(
        name="siconos-soclcp-nsgs",
        constant="SICONOS_SOCLCP_NSGS",
        summary="Gauss–Seidel over the cones, projection with local iterations in each",
        method="block Gauss–Seidel",
        citation="Jourdan, Alart and Jean, A Gauss–Seidel like algorithm, CMAME 155 (1998)",
        warm=True,
        by_default=True,
    ),
    SiconosEntry(
        name="siconos-soclcp-vi-fpp",
        constant="SICONOS_SOCLCP_VI_FPP",
        summary="fixed point of the projection, step size by itself",
        method="projection",
        citation="Facchinei and Pang, Finite-Dimensional Variational Inequalities (2003), section 12.1",
        warm=True,
    ),
    SiconosEntry(
        name="siconos-soclcp-vi-eg",
        constant="SICONOS_SOCLCP_VI_EG",
        summary="extragradient, step size by itself",
        method="extragradient",
        citation="Khobotov, A modification of the extragradient method, USSR Comp. Math. 27 (1987)",
        warm=True,
    ),
)
