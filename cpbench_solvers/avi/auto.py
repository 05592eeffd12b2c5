"""Automatic choices between bounds and on polyhedra: pivoting, then Newton's method and projections."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from cpbench.formulations.avi import AVI
from cpbench.formulations.relay import Relay
from cpbench.solvers.base import Budget, Record, SolverOutput, SolverSpec, register
from cpbench_solvers.automatic import AutomaticChoice, SolverPhase, automatic_spec
from cpbench_solvers.avi.apart import PartedAffine, parted, solve_apart
from cpbench_solvers.avi.claims import error_of

LARGE = 1000
"""Unknowns beyond which a tableau is asked last."""


class _ByParts(AutomaticChoice):
    """Base of the choices for the two nodes: connected parts are solved one after the other."""

    kernels: ClassVar[tuple[str, ...]] = ("affine_parts", "affine_rows")

    def error(self, problem: AVI | Relay, point: Any, tolerance: float) -> float:
        return error_of(problem, point, tolerance)

    def setup(self, problem: Any, budget: Budget, options: Any) -> Any:
        """Return a `Plan`, or a `PartedAffine`."""
        parts = parted(problem)
        return super().setup(problem, budget, options) if parts is None else parts

    def solve(
        self, prepared: Any, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        if not isinstance(prepared, PartedAffine):
            return super().solve(prepared, budget, options, start, record)

        def run(part: AVI | Relay, share: Budget, begin: Any) -> SolverOutput:
            return self.run(part, share, options, begin)

        output, problem = solve_apart(prepared, budget, start, run), prepared.problem
        if record is not None and output.point is not None:
            ends = (0, problem.zero_point()), (max(1, output.counters.get("iterations", 0)), output.point)
            for iteration, point in ends:
                record(iteration, error_of(problem, point, budget.tolerance), lambda point=point: point)
        return output


@register
class AutoAVI(_ByParts):
    """Lemke's method from a vertex of the polyhedron, then extragradients where the polyhedron is a box."""

    spec: ClassVar[SolverSpec] = automatic_spec("avi", "auto-avi", "pivoting from a vertex, then extragradients")
    members: ClassVar[tuple[str, ...]] = ("lemke-avi", "extragradient-avi")


@register
class AutoRelay(_ByParts):
    """Lemke's method between bounds up to 1000 unknowns, Newton's beyond; then extragradients."""

    spec: ClassVar[SolverSpec] = automatic_spec("relay", "auto-relay", "pivoting or Newton by size, then projections")
    members: ClassVar[tuple[str, ...]] = ("lemke-relay", "newton-relay", "extragradient-relay")

    def phases(self, problem: Relay) -> Sequence[SolverPhase]:
        first = list(self.members[:2])
        if problem.q.size > LARGE:
            first.reverse()
        return [SolverPhase(name) for name in (*first, self.members[2])]
