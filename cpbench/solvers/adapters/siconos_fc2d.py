"""Siconos' solvers of frictional contact in the plane (fc2d_Solvers.h), for `fc` of dimension 2.

W is dense where the problem's is, else in 2 x 2 blocks: in sparse storage each of them ends in an abort.
"""

from __future__ import annotations

from typing import Any

from cpbench.solvers.adapters.siconos import SiconosEntry, SiconosSolver, index_sets, register_family

JEAN = "Jean, The non-smooth contact dynamics method, CMAME 177 (1999)"
BOOK = "Cottle, Pang and Stone, The Linear Complementarity Problem (1992)"


class SiconosFC2D(SiconosSolver):
    """A solver of Siconos for frictional contact in the plane."""

    node = "fc"

    def obstacle(self, problem: Any) -> str | None:
        if problem.dimension != 2:
            return f"is for contacts of 2 rows, these have {problem.dimension}"
        return super().obstacle(problem) or (index_sets(3 * problem.nc) if self.row.enumerates else None)


register_family(
    SiconosFC2D,
    SiconosEntry(
        name="siconos-fc2d-nsgs",
        constant="SICONOS_FRICTION_2D_NSGS",
        summary="Gauss–Seidel over the contacts, each solved in closed form",
        method="block Gauss–Seidel",
        citation=JEAN,
        storage="given",
        by_default=True,
    ),
    SiconosEntry(
        name="siconos-fc2d-cpg",
        constant="SICONOS_FRICTION_2D_CPG",
        summary="projected conjugate gradient, for symmetric W",
        method="conjugate gradient",
        citation="Renouf and Alart, Conjugate gradient type algorithms for frictional contact, CMAME 194 (2005)",
        storage="given",
        false={"monotone-2d": 5.1e-01, "nonsymmetric-2d": 6.9e-01},
    ),
    SiconosEntry(
        name="siconos-fc2d-lemke",
        constant="SICONOS_FRICTION_2D_LEMKE",
        summary="as an LCP of three rows a contact, by Lemke's method; its last test compares with the bound on pivots",
        method="Lemke pivoting",
        citation=f"{BOOK}, section 4.4",
        false={
            "positive-definite-2d": 1.9e-01,
            "singular-semidefinite-2d": 2.1e-01,
            "monotone-2d": 5.7e-02,
            "impulse-unit-1e-08-2d": 1.6e-01,
            "velocity-unit-1e-08-2d": 1.5e-01,
            "impulse-unit-1e+08-2d": 1.5e-01,
            "velocity-unit-1e+08-2d": 1.6e-01,
            "nonsymmetric-2d": 1.7e01,
        },
        failures={"check_some_case_is_solved": "none of those that are not excused"},
    ),
    SiconosEntry(
        name="siconos-fc2d-enum",
        constant="SICONOS_FRICTION_2D_ENUM",
        summary="as an LCP of three rows a contact, tries all index sets",
        method="enumeration",
        citation=BOOK,
        enumerates=True,
        false={"velocity-unit-1e-08-2d": 4.0e-01, "impulse-unit-1e+08-2d": 1.5e-01},
        failures={"check_some_case_is_solved": "none of those that are not excused"},
    ),
)
