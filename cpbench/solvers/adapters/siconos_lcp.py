"""Siconos' solvers of linear complementarity problems (LCP_Solvers.h). M is dense; NSGS_SBM takes it in blocks.

Left out, for Debian's library cannot run them: SICONOS_LCP_QP and _NSQP (built without QL0001: abort), _PATH (without
PATH: info 1 at once), _GAMS (without GAMS: abort).
"""

from __future__ import annotations

import math
from typing import Any

from cpbench.solvers.adapters.siconos import SiconosEntry, SiconosSolver, index_sets, register_family
from cpbench.solvers.adapters.siconos_tolerances import Bound

BOOK = "Cottle, Pang and Stone, The Linear Complementarity Problem (1992)"
FISCHER = "De Luca, Facchinei and Kanzow, A semismooth equation approach, Math. Programming 75 (1996)"


class SiconosLCP(SiconosSolver):
    """A solver of Siconos for an LCP in dense storage, or in blocks of as many rows as divide n, at most 4."""

    node = "lcp"

    def obstacle(self, problem: Any) -> str | None:
        return super().obstacle(problem) or (index_sets(problem.q.size) if self.row.enumerates else None)


register_family(
    SiconosLCP,
    SiconosEntry(
        name="siconos-lcp-lemke",
        constant="SICONOS_LCP_LEMKE",
        summary="Lemke's pivoting method with lexicographic ratio test",
        method="Lemke pivoting",
        citation=f"{BOOK}, section 4.4",
        by_default=True,
    ),
    SiconosEntry(
        name="siconos-lcp-newton-fb",
        constant="SICONOS_LCP_NEWTON_FB_FBLSA",
        summary="semismooth Newton on the Fischer–Burmeister function, line search on its square",
        method="semismooth Newton",
        citation=FISCHER,
        warm=True,
        bound=Bound.NEWTON,
        by_default=True,
        false={"impulse-unit-1e-08": 4.7e-01, "velocity-unit-1e+08": 4.7e-01},
    ),
    SiconosEntry(
        name="siconos-lcp-newton-min-fb",
        constant="SICONOS_LCP_NEWTON_MIN_FBLSA",
        summary="semismooth Newton on the minimum function, line search on Fischer–Burmeister",
        method="semismooth Newton",
        citation=FISCHER,
        warm=True,
        bound=Bound.NEWTON,
    ),
    SiconosEntry(
        name="siconos-lcp-newtonmin",
        constant="SICONOS_LCP_NEWTONMIN",
        summary="Newton on the minimum function, without line search",
        method="semismooth Newton",
        citation="Alart and Curnier, CMAME 92 (1991)",
        bound=Bound.NEWTON,
        impossible=("pang",),
    ),
    SiconosEntry(
        name="siconos-lcp-pgs",
        constant="SICONOS_LCP_PGS",
        summary="projected Gauss–Seidel",
        method="projected Gauss–Seidel",
        citation=f"{BOOK}, section 5.2",
        warm=True,
        false={"any": math.inf, "all-ties": math.inf},
    ),
    SiconosEntry(
        name="siconos-lcp-psor",
        constant="SICONOS_LCP_PSOR",
        summary="projected successive over-relaxation, ω = 0.1 by Siconos' default",
        method="projected SOR",
        citation=f"{BOOK}, section 5.2",
        warm=True,
        false={"any": math.inf},
    ),
    SiconosEntry(
        name="siconos-lcp-rpgs",
        constant="SICONOS_LCP_RPGS",
        summary="projected Gauss–Seidel on M + ρI, ρ = 1 by Siconos' default",
        method="regularised projected Gauss–Seidel",
        citation=f"{BOOK}, section 5.2",
        warm=True,
    ),
    SiconosEntry(
        name="siconos-lcp-nsgs-sbm",
        constant="SICONOS_LCP_NSGS_SBM",
        summary="block Gauss–Seidel, projected SOR in every block",
        method="block Gauss–Seidel",
        citation=f"{BOOK}, section 5.2",
        warm=True,
        storage="blocks",
        false={"any": math.inf},
    ),
    SiconosEntry(
        name="siconos-lcp-cpg",
        constant="SICONOS_LCP_CPG",
        summary="projected conjugate gradient, for symmetric positive semidefinite M",
        method="conjugate gradient",
        citation="Renouf and Alart, Conjugate gradient type algorithms for frictional contact, CMAME 194 (2005)",
        warm=True,
    ),
    SiconosEntry(
        name="siconos-lcp-convexqp-pg",
        constant="SICONOS_LCP_CONVEXQP_PG",
        summary="projected gradient on the QP of a symmetric M",
        method="projected gradient",
        citation="Bertsekas, Nonlinear Programming (1999), section 2.3",
        warm=True,
    ),
    SiconosEntry(
        name="siconos-lcp-latin",
        constant="SICONOS_LCP_LATIN",
        summary="LATIN: large time increments, alternating between two search directions",
        method="splitting",
        citation="Ladevèze, Nonlinear Computational Structural Mechanics (1999)",
    ),
    SiconosEntry(
        name="siconos-lcp-latin-w",
        constant="SICONOS_LCP_LATIN_W",
        summary="LATIN with relaxation",
        method="splitting",
        citation="Ladevèze, Nonlinear Computational Structural Mechanics (1999)",
    ),
    SiconosEntry(
        name="siconos-lcp-pivot",
        constant="SICONOS_LCP_PIVOT",
        summary="Lemke-type pivoting on a dense tableau",
        method="Lemke pivoting",
        citation=f"{BOOK}, section 4.4",
    ),
    SiconosEntry(
        name="siconos-lcp-pivot-lumod",
        constant="SICONOS_LCP_PIVOT_LUMOD",
        summary="Lemke-type pivoting with updates of an LU factorization",
        method="Lemke pivoting",
        citation=f"{BOOK}, section 4.4",
    ),
    SiconosEntry(
        name="siconos-lcp-bard",
        constant="SICONOS_LCP_BARD",
        summary="principal pivoting by Bard's rule, which may cycle",
        method="principal pivoting",
        citation=f"{BOOK}, section 4.2",
    ),
    SiconosEntry(
        name="siconos-lcp-murty",
        constant="SICONOS_LCP_MURTY",
        summary="principal pivoting by Murty's least index, finite for P matrices",
        method="principal pivoting",
        citation=f"{BOOK}, section 4.2",
    ),
    SiconosEntry(
        name="siconos-lcp-pathsearch",
        constant="SICONOS_LCP_PATHSEARCH",
        summary="pivoting along the path of the normal map",
        method="path following",
        citation="Ralph, Global convergence of damped Newton's method via the path search, MOR 19 (1994)",
    ),
    SiconosEntry(
        name="siconos-lcp-avi-caoferris",
        constant="SICONOS_LCP_AVI_CAOFERRIS",
        summary="Cao and Ferris' pivoting for affine variational inequalities, on the orthant",
        method="Lemke pivoting",
        citation="Cao and Ferris, A pivotal method for affine variational inequalities, MOR 21 (1996)",
    ),
    SiconosEntry(
        name="siconos-lcp-enum",
        constant="SICONOS_LCP_ENUM",
        summary="tries all 2ⁿ index sets",
        method="enumeration",
        citation=BOOK,
        enumerates=True,
        false={"impulse-unit-1e-08": 6.1e-01},
    ),
)
