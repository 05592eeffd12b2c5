"""Automatic choices between bounds and on polyhedra: pivoting and Newton's method."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import AVI, Relay
from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.automatic import SolverPhase, automatic_spec
from cpbench_solvers.avi.apart import ByParts
from cpbench_solvers.avi.as_mlcp import as_mlcp
from cpbench_solvers.avi.claims import error_of

LARGE = 1000
"""Unknowns beyond which a tableau is asked last."""
SWEEPS = 100
"""In the first turn between bounds: what they do not solve by then takes many more."""


class _Affine(ByParts):
    """Base of the choices for the two nodes."""

    few: ClassVar[int] = 100

    def error(self, problem: AVI | Relay, point: Any, tolerance: float) -> float:
        return error_of(problem, point, tolerance)


@register
class AutoAVI(_Affine):
    """Lemke's method from a vertex of the polyhedron, Newton's where that is a box, and the mixed LCP with multipliers,
    which is first where unknowns without bounds have no positive diagonal entry: M may be singular there."""

    spec: ClassVar[SolverSpec] = automatic_spec(
        "avi", "auto-avi", "pivoting from a vertex or as an MLCP, Newton on boxes"
    )
    members: ClassVar[tuple[str, ...]] = (
        "lemke-avi",
        "lemke-mlcp",
        "newton-avi",
        "newton-fb-mlcp",
        "interior-point-mlcp",
    )

    def phases(self, problem: AVI) -> Sequence[SolverPhase]:
        made_once = cache(as_mlcp)  # for its members, and no longer than the plan
        mixed = [SolverPhase(name, via=made_once) for name in self.members if name.endswith("-mlcp")]
        own = [SolverPhase("lemke-avi"), SolverPhase("newton-avi")]
        if problem.q.size > LARGE:
            return [own[1], *reversed(mixed), own[0]]
        free = np.isinf(problem.lb) & np.isinf(problem.ub)
        if np.any(problem.M.diagonal()[free] <= 0.0):
            return [mixed[0], *own, *mixed[1:]]
        return [*own, *mixed]


@register
class AutoRelay(_Affine):
    """A few sweeps where the diagonal allows them; Lemke's method between bounds, then Newton's, beyond 1000 unknowns
    the other way round."""

    spec: ClassVar[SolverSpec] = automatic_spec("relay", "auto-relay", "pivoting or Newton by size")
    members: ClassVar[tuple[str, ...]] = ("pgs-relay", "lemke-relay", "newton-relay")

    def phases(self, problem: Relay) -> Sequence[SolverPhase]:
        sweeps = [SolverPhase("pgs-relay", SWEEPS)] if np.all(problem.M.diagonal()[problem.moving] > 0.0) else []
        rest = [SolverPhase("lemke-relay"), SolverPhase("newton-relay")]
        return [*sweeps, *(rest[::-1] if problem.q.size > LARGE else rest)]
