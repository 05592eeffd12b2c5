"""Siconos' solvers: for each family its node and the problems that Siconos can hold.

The solvers of each family, and what is known of them, stand in `siconos_families.toml`.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.foundation.product_cones import Cone
from cpbench.solvers.adapters.siconos import SiconosEntry, SiconosSolver, index_sets
from cpbench.solvers.adapters.siconos_nonlinear import SiconosNonlinear
from cpbench.solvers.adapters.siconos_tolerances import Bound
from cpbench.solvers.base import solvers

CONE_ROWS = 3
"""Rows of every second-order cone: soclcp_compute_error ends the process on others."""


class SiconosLCP(SiconosSolver):
    """A solver of Siconos for an LCP in dense storage, or in blocks of as many rows as divide n, at most 4."""

    node = "lcp"

    def obstacle(self, problem: Any) -> str | None:
        return super().obstacle(problem) or (index_sets(problem.q.size) if self.row.enumerates else None)


class SiconosMLCP(SiconosSolver):
    """A solver of Siconos for an MLCP in dense storage."""

    node = "mlcp"

    def obstacle(self, problem: Any) -> str | None:
        return super().obstacle(problem) or (index_sets(problem.b.size) if self.row.enumerates else None)


class SiconosRelay(SiconosSolver):
    """A solver of Siconos for a relay problem in dense storage."""

    node = "relay"

    def obstacle(self, problem: Any) -> str | None:
        return super().obstacle(problem) or (index_sets(2 * problem.q.size) if self.row.enumerates else None)


class SiconosSOCLCP(SiconosSolver):
    """A solver of Siconos for a product of second-order cones of three rows each."""

    node = "soclcp"

    def obstacle(self, problem: Any) -> str | None:
        others = int(((problem.cone_kind != Cone.SECOND_ORDER) | (problem.cone_size != CONE_ROWS)).sum())
        if others:
            return f"{others} of {problem.cone_kind.size} factors are no second-order cones of {CONE_ROWS} rows"
        return super().obstacle(problem)


class SiconosNCP(SiconosNonlinear):
    """A solver of Siconos for an NCP."""

    node = "ncp"


class SiconosVI(SiconosNonlinear):
    """A solver of Siconos for a VI without rows: the guest projects on a product of cones, disks and balls, and on
    bounds."""

    node = "vi"

    def obstacle(self, problem: Any) -> str | None:
        rows = problem.b.size + problem.d.size + problem.g.rows
        if rows:
            return f"has {rows} rows (A, C, g) in its set, on which nothing projects in closed form"
        return super().obstacle(problem)


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


class SiconosContact(SiconosSolver):
    """A solver of Siconos for contacts of as many rows as `dimension` says, local form."""

    node = "fc"

    def obstacle(self, problem: Any) -> str | None:
        if problem.dimension != self.row.dimension:
            return f"is for contacts of {self.row.dimension} rows, these have {problem.dimension}"
        return super().obstacle(problem) or (index_sets(3 * problem.nc) if self.row.enumerates else None)


class SiconosRolling(SiconosContact):
    """A solver of Siconos for contact with rolling friction, local form."""

    node = "rfc"


class SiconosGlobal(SiconosContact):
    """A solver of Siconos for frictional contact, global form, no joints."""

    node = "gfc"

    def obstacle(self, problem: Any) -> str | None:
        if problem.dimension == self.row.dimension and problem.b.size:
            return f"has {problem.b.size} rows of joints, which Siconos has not in this form"
        if problem.dimension == self.row.dimension and not problem.nc:
            return "has no contacts: Siconos asserts that there are some and aborts"
        return super().obstacle(problem)


class SiconosGlobalRolling(SiconosGlobal):
    """A solver of Siconos for contact with rolling friction, global form, no joints."""

    node = "grfc"


FAMILIES: dict[str, type[SiconosSolver]] = {
    "lcp": SiconosLCP,
    "mlcp": SiconosMLCP,
    "relay": SiconosRelay,
    "soclcp": SiconosSOCLCP,
    "ncp": SiconosNCP,
    "mcp": SiconosMCP,
    "vi-box": SiconosBox,
    "vi": SiconosVI,
    "fc2d": SiconosContact,
    "fc3d": SiconosContact,
    "gfc3d": SiconosGlobal,
    "rolling": SiconosRolling,
    "global-rolling": SiconosGlobalRolling,
}
"""Class by name of the family in the table."""


def register_families() -> None:
    """Put every solver of the table into the registry."""
    table: dict[str, Any] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
    citations: dict[str, str] = table.pop("citations")
    for family, entries in table.items():
        for entry in entries:
            entry["citation"] = entry["citation"].format(**citations)
            entry["bound"] = Bound[entry.get("bound", "sweeps").upper()]
            entry["impossible"] = tuple(entry.get("impossible", ()))
            solvers.add(entry["name"], FAMILIES[family](SiconosEntry(**entry)))


register_families()
