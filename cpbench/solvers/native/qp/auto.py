"""Automatic choice on QPs: active sets where matrices are small, the interior point where they are not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

from cpbench.formulations.qp import QP
from cpbench.solvers import warming
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench.solvers.native.automatic import AutomaticChoice, Plan, SolverPhase, automatic_spec
from cpbench.solvers.native.qp.proximal_active_set import SMALL

LARGE = 300
"""Unknowns beyond which conjugate gradients on faces are ahead of factorizations where there are no rows."""
STEPS = 5
"""Of conjugate gradients on faces, times √n, a product with Q each: on a grid in the plane one face takes about √n."""


@register
class AutoQP(AutomaticChoice):
    """Proximal steps over the dual active set in one compiled call for few unknowns; the interior point for more.

    Conjugate gradients on faces first where there are many unknowns and bounds alone.
    """

    spec: ClassVar[SolverSpec] = automatic_spec("qp", "auto-qp", "active set or interior point, by size")
    members: ClassVar[tuple[str, ...]] = (
        "dual-active-set",
        "proximal-active-set",
        "interior-point-qp",
        "mprgp-qp",
        "augmented-lagrangian",
    )
    kernels: ClassVar[tuple[str, ...]] = ("qp_small", "qp_interior", "qp_sparse", "minimum_degree", "mprgp")

    def setup(self, problem: QP, budget: Budget, options: Any) -> Plan:
        if not 0 < problem.p.size <= SMALL:
            return super().setup(problem, budget, options)
        # one compiled call, which finds out by itself whether Q is convex
        phases = tuple(self.phases(problem))
        solver = warming.ready(phases[0].solver, quickly=True)
        return Plan(problem, phases, problem, solver.spec.options(), solver)

    def phases(self, problem: QP) -> Sequence[SolverPhase]:
        n, rows = problem.p.size, problem.b.size + problem.d.size
        interior, last = SolverPhase("interior-point-qp"), SolverPhase("augmented-lagrangian")
        active = [SolverPhase("proximal-active-set"), SolverPhase("dual-active-set")]
        if n <= SMALL:
            return [active[0], interior, last]
        faces = [SolverPhase("mprgp-qp", int(STEPS * math.sqrt(n)))] if n > LARGE and not rows else []
        return [*faces, interior, last, *active]
