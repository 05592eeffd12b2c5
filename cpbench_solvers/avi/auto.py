"""Automatic choices between bounds and on polyhedra: pivoting and Newton's method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from cpbench.formulations.linear import AVI, Relay
from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.automatic import SolverPhase, automatic_spec
from cpbench_solvers.avi.apart import ByParts
from cpbench_solvers.avi.claims import error_of

LARGE = 1000
"""Unknowns beyond which a tableau is asked last."""


class _Affine(ByParts):
    """Base of the choices for the two nodes."""

    def error(self, problem: AVI | Relay, point: Any, tolerance: float) -> float:
        return error_of(problem, point, tolerance)

    def phases(self, problem: AVI | Relay) -> Sequence[SolverPhase]:
        return [SolverPhase(name) for name in (reversed(self.members) if problem.q.size > LARGE else self.members)]


@register
class AutoAVI(_Affine):
    """Lemke's method from a vertex of the polyhedron, then Newton's where the polyhedron is a box; beyond 1000 unknowns
    the other way round."""

    spec: ClassVar[SolverSpec] = automatic_spec("avi", "auto-avi", "pivoting from a vertex, then Newton on boxes")
    members: ClassVar[tuple[str, ...]] = ("lemke-avi", "newton-avi")


@register
class AutoRelay(_Affine):
    """Lemke's method between bounds, then Newton's; beyond 1000 unknowns the other way round."""

    spec: ClassVar[SolverSpec] = automatic_spec("relay", "auto-relay", "pivoting or Newton by size")
    members: ClassVar[tuple[str, ...]] = ("lemke-relay", "newton-relay")
