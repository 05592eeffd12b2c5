"""Siconos' solvers of mixed complementarity problems (MCP_Solvers.h, and those of boxes in VI_Solvers).

An MCP of Siconos has free unknowns and unknowns v ≥ 0: bounds below or above are shifted and turned to it, two at once
(0 ≤ z ≤ 1, fixed unknowns) are for its solvers of variational inequalities over boxes, which need them everywhere.

SICONOS_MCP_OLD_FB takes its error from row n₂ on (mcp_old_compute_error), n₂ the number of unknowns with a bound: where
there are no others it looks at no row and says solved whatever came out.

Left out, for Debian's library cannot run it: SICONOS_VI_BOX_PATH (without PATH).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.solvers.adapters.siconos import SiconosEntry, register_family
from cpbench.solvers.adapters.siconos_ncp import FISCHER
from cpbench.solvers.adapters.siconos_nonlinear import SiconosNonlinear
from cpbench.solvers.adapters.siconos_tolerances import Bound


class SiconosBox(SiconosNonlinear):
    """A solver of Siconos for variational inequalities over bounded boxes: it computes with the bounds."""

    node = "micp"

    def obstacle(self, problem: Any) -> str | None:
        open_ended = int((np.isinf(problem.lb) | np.isinf(problem.ub)).sum())
        if open_ended:
            return f"{open_ended} unknowns have an infinite bound, with which Siconos computes NaN and claims solved"
        return super().obstacle(problem)


class SiconosMCP(SiconosNonlinear):
    """A solver of Siconos for an MCP."""

    node = "micp"

    def obstacle(self, problem: Any) -> str | None:
        both = int((np.isfinite(problem.lb) & np.isfinite(problem.ub)).sum())
        if both:
            return f"{both} unknowns have two bounds, an MCP of Siconos has one for each at most"
        return super().obstacle(problem)


register_family(
    SiconosMCP,
    SiconosEntry(
        name="siconos-mcp-newton-fb",
        constant="SICONOS_MCP_NEWTON_FB_FBLSA",
        summary="semismooth Newton on the Fischer–Burmeister function, line search on its square",
        method="semismooth Newton",
        citation=FISCHER,
        warm=True,
        bound=Bound.NEWTON,
        by_default=True,
    ),
    SiconosEntry(
        name="siconos-mcp-newton-min-fb",
        constant="SICONOS_MCP_NEWTON_MIN_FBLSA",
        summary="semismooth Newton on the minimum function, line search on Fischer–Burmeister",
        method="semismooth Newton",
        citation=FISCHER,
        warm=True,
        bound=Bound.NEWTON,
        failures={"check_warm_starts_are_taken": "the cases that it takes are solved by one iteration from 0 too"},
    ),
    SiconosEntry(
        name="siconos-mcp-old-fb",
        constant="SICONOS_MCP_OLD_FB",
        summary="semismooth Newton on the Fischer–Burmeister function, Siconos' first",
        method="semismooth Newton",
        citation=FISCHER,
        warm=True,
        bound=Bound.NEWTON,
    ),
)

register_family(
    SiconosBox,
    SiconosEntry(
        name="siconos-vi-box-qi",
        constant="SICONOS_VI_BOX_QI",
        summary="semismooth Newton on Qi's function of a box, line search along the projection",
        method="semismooth Newton",
        citation="Qi, Regular pseudo-smooth NCP and BVIP functions, MOR 24 (1999)",
        warm=True,
        bound=Bound.NEWTON,
    ),
    SiconosEntry(
        name="siconos-vi-box-avi",
        constant="SICONOS_VI_BOX_AVI_LSA",
        summary="Josephy–Newton, Cao and Ferris' pivoting inside, line search on Qi's function",
        method="Josephy–Newton",
        citation="Cao and Ferris, A pivotal method for affine variational inequalities, MOR 21 (1996)",
        warm=True,
        bound=Bound.OUTER,
    ),
)
