"""Siconos' solvers of relay problems (Relay_Solvers.h). M is dense.

Left out, for Debian's library cannot run them: SICONOS_RELAY_PATH (without PATH: info 1 at once),
_AVI_CAOFERRIS_TEST (without lp_solve: exit 1).
"""

from __future__ import annotations

from typing import Any

from cpbench.solvers.adapters.siconos import SiconosEntry, SiconosSolver, index_sets, register_family

BOOK = "Cottle, Pang and Stone, The Linear Complementarity Problem (1992)"


class SiconosRelay(SiconosSolver):
    """A solver of Siconos for a relay problem in dense storage."""

    node = "relay"

    def obstacle(self, problem: Any) -> str | None:
        return super().obstacle(problem) or (index_sets(2 * problem.q.size) if self.row.enumerates else None)


register_family(
    SiconosRelay,
    SiconosEntry(
        name="siconos-relay-lemke",
        constant="SICONOS_RELAY_LEMKE",
        summary="as an LCP of twice the size, by Lemke's method with lexicographic ratio test",
        method="Lemke pivoting",
        citation=f"{BOOK}, section 4.4",
        by_default=True,
        early={"z-unit-1e-08": 3.9e-01, "w-unit-1e-08": 3.9e-01, "w-unit-1e+08": 3.9e-01, "zero-q-small-box": 1.7e00},
    ),
    SiconosEntry(
        name="siconos-relay-avi-caoferris",
        constant="SICONOS_RELAY_AVI_CAOFERRIS",
        summary="Cao and Ferris' pivoting for affine variational inequalities, on the box",
        method="Lemke pivoting",
        citation="Cao and Ferris, A pivotal method for affine variational inequalities, MOR 21 (1996)",
        early={"z-unit-1e-08": 3.9e-01, "w-unit-1e-08": 3.9e-01, "w-unit-1e+08": 3.9e-01, "zero-q-small-box": 1.7e00},
    ),
    SiconosEntry(
        name="siconos-relay-pgs",
        constant="SICONOS_RELAY_PGS",
        summary="projected Gauss–Seidel on the box",
        method="projected Gauss–Seidel",
        citation=f"{BOOK}, section 5.2",
        warm=True,
        false={"z-unit-1e-08": 3.5e-01, "w-unit-1e-08": 3.5e-01, "w-unit-1e+08": 3.5e-01},
    ),
    SiconosEntry(
        name="siconos-relay-enum",
        constant="SICONOS_RELAY_ENUM",
        summary="as an LCP of twice the size, tries all 4ⁿ index sets",
        method="enumeration",
        citation=BOOK,
        enumerates=True,
        false={"z-unit-1e-08": 3.5e-01, "w-unit-1e-08": 3.5e-01, "zero-q-small-box": 1.7e00},
    ),
)
