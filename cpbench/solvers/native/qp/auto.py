"""Automatic choice on QPs: active sets where matrices are small, the interior point where they are not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from cpbench.formulations.qp import QP
from cpbench.solvers.base import SolverSpec, register
from cpbench.solvers.native.automatic import AutomaticChoice, SolverPhase, automatic_spec

SMALL, LARGE = 100, 300
"""Unknowns up to which proximal steps over active sets are ahead of the interior point where Q is singular, and
beyond which the interior point is ahead of active sets."""
STEPS = 2000
"""Of conjugate gradients on faces, a product with Q each."""


@register
class AutoQP(AutomaticChoice):
    """The dual active set, or proximal steps over it where Q is singular; the interior point for more unknowns.

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
    kernels: ClassVar[tuple[str, ...]] = ("qp_dual", "qp_interior", "qp_sparse", "minimum_degree", "mprgp")

    def phases(self, problem: QP) -> Sequence[SolverPhase]:
        n, rows = problem.p.size, problem.b.size + problem.d.size
        active = [SolverPhase("dual-active-set"), SolverPhase("proximal-active-set")]
        interior, last = SolverPhase("interior-point-qp"), SolverPhase("augmented-lagrangian")
        if n > LARGE:
            return [*([] if rows else [SolverPhase("mprgp-qp", STEPS)]), interior, last, *active]
        if n > SMALL:
            active.insert(1, interior)
            return [*active, last]
        return [*active, interior, last]
