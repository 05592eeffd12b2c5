"""Automatic choices between bounds and on polyhedra: pivoting, then Newton's method and projections."""

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


@register
class AutoAVI(_Affine):
    """Lemke's method from a vertex of the polyhedron, then extragradients where the polyhedron is a box."""

    spec: ClassVar[SolverSpec] = automatic_spec("avi", "auto-avi", "pivoting from a vertex, then extragradients")
    members: ClassVar[tuple[str, ...]] = ("lemke-avi", "extragradient-avi")


@register
class AutoRelay(_Affine):
    """Lemke's method between bounds up to 1000 unknowns, Newton's beyond; then extragradients."""

    spec: ClassVar[SolverSpec] = automatic_spec("relay", "auto-relay", "pivoting or Newton by size, then projections")
    members: ClassVar[tuple[str, ...]] = ("lemke-relay", "newton-relay", "extragradient-relay")

    def phases(self, problem: Relay) -> Sequence[SolverPhase]:
        first = list(self.members[:2])
        if problem.q.size > LARGE:
            first.reverse()
        return [SolverPhase(name) for name in (*first, self.members[2])]
