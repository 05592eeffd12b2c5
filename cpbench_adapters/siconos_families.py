"""Siconos' solvers: for each family its node and the problems that Siconos can hold.

The solvers of each family, and what is known of them, stand in `siconos_families.toml`.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from cpbench.foundation.cones import Cone
from cpbench.solvers.base import Budget, Record, SolverOutput, solvers
from cpbench.solvers.external.served import HandedOver
from cpbench_adapters.siconos import SiconosEntry, SiconosSolver, index_sets
from cpbench_adapters.siconos_tolerances import MAP, Bound, ErrorTest

CONE_ROWS = 3
"""Rows of every second-order cone: soclcp_compute_error ends the process on others."""
LARGEST = 1000
"""Unknowns: Siconos' Jacobians are dense, a solve with one of 1000 takes a third of a second."""

FAMILIES: dict[str, type[SiconosSolver]] = {}
"""Class by name of the family in the table."""
Family = TypeVar("Family", bound=type[SiconosSolver])


def family(*names: str) -> Callable[[Family], Family]:
    """Return a decorator that enters the class of some families."""

    def enter(kind: Family) -> Family:
        FAMILIES.update(dict.fromkeys(names, kind))
        return kind

    return enter


@family("lcp")
class SiconosLCP(SiconosSolver):
    """A solver of Siconos for an LCP in dense storage, or in blocks of as many rows as divide n, at most 4."""

    node = "lcp"
    test = ErrorTest("‖min(z, w)‖/‖q‖")

    def obstacle(self, problem: Any) -> str | None:
        return super().obstacle(problem) or (index_sets(problem.q.size) if self.row.enumerates else None)


@family("mlcp")
class SiconosMLCP(SiconosSolver):
    """A solver of Siconos for an MLCP in dense storage."""

    node = "mlcp"
    test = ErrorTest("Σ|Au + Cv + a|, Σ of violations and of products v·w, each over 2 + norms", constants=("a", "b"))

    def obstacle(self, problem: Any) -> str | None:
        return super().obstacle(problem) or (index_sets(problem.b.size) if self.row.enumerates else None)


@family("relay")
class SiconosRelay(SiconosSolver):
    """A solver of Siconos for a relay problem in dense storage."""

    node = "relay"
    test = ErrorTest("‖z − P(z − w)‖/(1 + ‖q‖)", constants=("q",))

    def obstacle(self, problem: Any) -> str | None:
        return super().obstacle(problem) or (index_sets(2 * problem.q.size) if self.row.enumerates else None)


@family("soclcp")
class SiconosSOCLCP(SiconosSolver):
    """A solver of Siconos for a product of second-order cones of three rows each."""

    node = "soclcp"
    test = ErrorTest("‖x − P_K(x − w)‖/(1 + ‖q‖)", constants=("q",))

    def obstacle(self, problem: Any) -> str | None:
        others = int(((problem.cone_kind != Cone.SECOND_ORDER) | (problem.cone_size != CONE_ROWS)).sum())
        if others:
            return f"{others} of {problem.cone_kind.size} factors are no second-order cones of {CONE_ROWS} rows"
        return super().obstacle(problem)


class SiconosNonlinear(SiconosSolver):
    """A solver that calls F back, and F′ unless it only projects.

    The guest evaluates F and its Jacobian from their operations, by NumPy: an evaluation takes about 2 µs for every
    depth and operator, which on small problems is most of the time. Where F is not a number they mostly end with info
    2; but Siconos' error of a component is |z − max(0, z − w)|, and its max of 0 and NaN is 0, so that z = 0 passes
    there (siconos-mcp-newton-min-fb on a Walras problem): a claim like any.

    Siconos' errors are absolute there (the norm of F(0) of its variational inequalities is set to 1), and so is its
    tolerance: no size of F at a start enters, which beside a pole may be anything. All start at the start that is
    given, else at the problem's own, projected on its simple set.
    """

    test = ErrorTest("norm of the solver's own function of (z, F), absolute", MAP)

    def obstacle(self, problem: Any) -> str | None:
        n = problem.start.size
        if n > LARGEST:
            return f"n = {n}: Siconos' Jacobians are dense, at most {LARGEST} unknowns are handed over"
        return super().obstacle(problem)

    def solve(
        self, prepared: HandedOver, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        problem: Any = prepared.problem
        zero = problem.zero_point()
        first = dataclasses.replace(zero, z=problem.project(problem.start if start is None else start.z))
        return super().solve(prepared, budget, options, first, record)


@family("ncp")
class SiconosNCP(SiconosNonlinear):
    """A solver of Siconos for an NCP."""

    node = "ncp"


@family("vi")
class SiconosVI(SiconosNonlinear):
    """A solver of Siconos for a VI without rows: the guest projects on a product of cones, disks and balls, and on
    bounds."""

    node = "vi"
    test = ErrorTest("‖z − P(z − F)‖, absolute", MAP)

    def obstacle(self, problem: Any) -> str | None:
        rows = problem.b.size + problem.d.size + problem.g.rows
        if rows:
            return f"has {rows} rows (A, C, g) in its set, on which nothing projects in closed form"
        return super().obstacle(problem)


@family("vi-box")
class SiconosBox(SiconosNonlinear):
    """A solver of Siconos for variational inequalities over bounded boxes: it computes with the bounds."""

    node = "micp"

    def obstacle(self, problem: Any) -> str | None:
        open_ended = int((np.isinf(problem.lb) | np.isinf(problem.ub)).sum())
        if open_ended:
            return f"{open_ended} unknowns have an infinite bound, with which Siconos computes NaN and claims solved"
        return super().obstacle(problem)


@family("mcp")
class SiconosMCP(SiconosNonlinear):
    """A solver of Siconos for an MCP."""

    node = "micp"

    def obstacle(self, problem: Any) -> str | None:
        both = int((np.isfinite(problem.lb) & np.isfinite(problem.ub)).sum())
        if both:
            return f"{both} unknowns have two bounds, an MCP of Siconos has one for each at most"
        return super().obstacle(problem)


@family("fc2d", "fc3d")
class SiconosContact(SiconosSolver):
    """A solver of Siconos for contacts of as many rows as `dimension` says, local form."""

    node = "fc"
    test = ErrorTest("‖r − P_K(r − û)‖/max(‖q‖, ‖r‖, ‖u‖)")

    def obstacle(self, problem: Any) -> str | None:
        if problem.dimension != self.row.dimension:
            return f"is for contacts of {self.row.dimension} rows, these have {problem.dimension}"
        return super().obstacle(problem) or (index_sets(3 * problem.nc) if self.row.enumerates else None)


@family("rolling")
class SiconosRolling(SiconosContact):
    """A solver of Siconos for contact with rolling friction, local form."""

    node = "rfc"


@family("gfc3d")
class SiconosGlobal(SiconosContact):
    """A solver of Siconos for frictional contact, global form, no joints."""

    node = "gfc"
    test = ErrorTest("as for fc, plus ‖Mv − Hr − f‖/max of its terms")

    def obstacle(self, problem: Any) -> str | None:
        if problem.dimension == self.row.dimension and problem.b.size:
            return f"has {problem.b.size} rows of joints, which Siconos has not in this form"
        if problem.dimension == self.row.dimension and not problem.nc:
            return "has no contacts: Siconos asserts that there are some and aborts"
        return super().obstacle(problem)


@family("global-rolling")
class SiconosGlobalRolling(SiconosGlobal):
    """A solver of Siconos for contact with rolling friction, global form, no joints."""

    node = "grfc"
    test = ErrorTest("as for rfc, plus ‖Mv − Hr − f‖/max of its terms")


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
