"""Siconos' solvers of nonlinear complementarity problems (NCP_Solvers.h).

Left out, for Debian's library cannot run it: SICONOS_NCP_PATH (without PATH).
"""

from __future__ import annotations

from cpbench.solvers.adapters.siconos import SiconosEntry, register_family
from cpbench.solvers.adapters.siconos_nonlinear import SiconosNonlinear
from cpbench.solvers.adapters.siconos_tolerances import Bound

FISCHER = "De Luca, Facchinei and Kanzow, A semismooth equation approach, Math. Programming 75 (1996)"


class SiconosNCP(SiconosNonlinear):
    """A solver of Siconos for an NCP."""

    node = "ncp"


register_family(
    SiconosNCP,
    SiconosEntry(
        name="siconos-ncp-newton-fb",
        constant="SICONOS_NCP_NEWTON_FB_FBLSA",
        summary="semismooth Newton on the Fischer–Burmeister function, line search on its square",
        method="semismooth Newton",
        citation=FISCHER,
        warm=True,
        bound=Bound.NEWTON,
        by_default=True,
    ),
    SiconosEntry(
        name="siconos-ncp-newton-min-fb",
        constant="SICONOS_NCP_NEWTON_MIN_FBLSA",
        summary="semismooth Newton on the minimum function, line search on Fischer–Burmeister",
        method="semismooth Newton",
        citation=FISCHER,
        warm=True,
        bound=Bound.NEWTON,
    ),
    SiconosEntry(
        name="siconos-ncp-pathsearch",
        constant="SICONOS_NCP_PATHSEARCH",
        summary="path search on the normal map, nonmonotone, with pivoting inside",
        method="path search",
        citation="Ralph, Global convergence of damped Newton's method via the path search, MOR 19 (1994)",
        warm=False,  # it takes a start, and may fail from its own answer (info 2), by rounding: not on every machine
        bound=Bound.OUTER,
    ),
)
