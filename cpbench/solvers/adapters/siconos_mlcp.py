"""Siconos' solvers of mixed linear complementarity problems (MLCP_Solvers.h). All matrices are dense.

The guest hands over both storages that Siconos has, M with q and A, B, C, D with a, b, as Siconos' own files do, and
calls mlcp_driver_init before mlcp_driver: without it FB and DIRECT_FB end in a segmentation fault.

Left out, for Debian's library cannot run them: SICONOS_MLCP_PATH and _DIRECT_PATH (without PATH: info 1 at once),
_PATH_ENUM (without PATH it is ENUM), _DIRECT_PATH_ENUM (abort), _SIMPLEX and _DIRECT_SIMPLEX (without a simplex
solver: info -1 and 1 at once), _PGS_SBM (mlcp_driver refuses block storage, the solver all else: abort).
"""

from __future__ import annotations

import math
from typing import Any

from cpbench.solvers.adapters.siconos import SiconosEntry, SiconosSolver, index_sets, register_family
from cpbench.solvers.adapters.siconos_tolerances import Bound

BOOK = "Cottle, Pang and Stone, The Linear Complementarity Problem (1992)"
MANUAL = "Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008), section 12.4"


class SiconosMLCP(SiconosSolver):
    """A solver of Siconos for an MLCP in dense storage."""

    node = "mlcp"

    def obstacle(self, problem: Any) -> str | None:
        return super().obstacle(problem) or (index_sets(problem.b.size) if self.row.enumerates else None)


register_family(
    SiconosMLCP,
    SiconosEntry(
        name="siconos-mlcp-fb",
        constant="SICONOS_MLCP_FB",
        summary="nonsmooth Newton on the Fischer–Burmeister function, with line search",
        method="semismooth Newton",
        citation="De Luca, Facchinei and Kanzow, A semismooth equation approach, Math. Programming 75 (1996)",
        bound=Bound.NEWTON,
        by_default=True,
        impossible=(
            "no-row",
            "negative",
        ),
        false={"both-units-1e-08": 1.2e00},
    ),
    SiconosEntry(
        name="siconos-mlcp-direct-fb",
        constant="SICONOS_MLCP_DIRECT_FB",
        summary="the last index sets that were right, then nonsmooth Newton on Fischer–Burmeister",
        method="semismooth Newton",
        citation=MANUAL,
        bound=Bound.NEWTON,
        impossible=(
            "no-row",
            "negative",
        ),
        false={"both-units-1e-08": 1.2e00},
    ),
    SiconosEntry(
        name="siconos-mlcp-lcp-lemke",
        constant="SICONOS_MLCP_LCP_LEMKE",
        summary="elimination of the equalities (A must have an inverse), then Lemke's method",
        method="Lemke pivoting",
        citation=f"{BOOK}, section 4.4",
        ends={"no-equality": "signal 6", "equalities-only": "signal 6"},
    ),
    SiconosEntry(
        name="siconos-mlcp-pgs",
        constant="SICONOS_MLCP_PGS",
        summary="projected Gauss–Seidel over equalities and complementarities",
        method="projected Gauss–Seidel",
        citation=f"{BOOK}, section 5.2",
        warm=True,
        false={"both-units-1e-08": 1.2e00},
    ),
    SiconosEntry(
        name="siconos-mlcp-rpgs",
        constant="SICONOS_MLCP_RPGS",
        summary="projected Gauss–Seidel with ρI added, ρ = 1 by Siconos' default",
        method="regularised projected Gauss–Seidel",
        citation=f"{BOOK}, section 5.2",
        warm=True,
        false={"both-units-1e-08": 1.2e00, "u-unit-1e+08": 7.0e-01},
    ),
    SiconosEntry(
        name="siconos-mlcp-psor",
        constant="SICONOS_MLCP_PSOR",
        summary="projected successive over-relaxation, ω = 1.2 by Siconos' default",
        method="projected SOR",
        citation=f"{BOOK}, section 5.2",
        warm=True,
        false={
            "monotone": math.inf,
            "positive-definite": math.inf,
            "sparse": math.inf,
            "no-equality": math.inf,
            "equalities-only": math.inf,
            "u-unit-1e-08": math.inf,
            "both-units-1e-08": 1.2e00,
            "u-unit-1e+08": math.inf,
            "both-units-1e+08": math.inf,
        },
        failures={"check_some_case_is_solved": "none of those that are not excused"},
    ),
    SiconosEntry(
        name="siconos-mlcp-rpsor",
        constant="SICONOS_MLCP_RPSOR",
        summary="projected successive over-relaxation with ρI added, ω = 2, ρ = 0.5 by Siconos' default",
        method="regularised projected SOR",
        citation=f"{BOOK}, section 5.2",
        warm=True,
        impossible=("no-row",),
        false={
            "monotone": math.inf,
            "positive-definite": math.inf,
            "sparse": math.inf,
            "no-equality": math.inf,
            "equalities-only": math.inf,
            "u-unit-1e-08": math.inf,
            "both-units-1e-08": math.inf,
            "u-unit-1e+08": math.inf,
            "both-units-1e+08": math.inf,
            "one": math.inf,
            "zero-A-and-B": math.inf,
        },
        failures={"check_some_case_is_solved": "none of those that are not excused"},
    ),
    SiconosEntry(
        name="siconos-mlcp-enum",
        constant="SICONOS_MLCP_ENUM",
        summary="tries all 2ᵐ index sets",
        method="enumeration",
        citation=MANUAL,
        enumerates=True,
        false={"both-units-1e-08": 9.6e-01},
    ),
    SiconosEntry(
        name="siconos-mlcp-direct-enum",
        constant="SICONOS_MLCP_DIRECT_ENUM",
        summary="the last index sets that were right, then all 2ᵐ",
        method="enumeration",
        citation=MANUAL,
        enumerates=True,
        false={"both-units-1e-08": 9.6e-01},
    ),
)
