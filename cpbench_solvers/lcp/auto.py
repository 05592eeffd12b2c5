"""Automatic choice on LCPs: pivoting where it is quick, faces and Newton where M is large and sparse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import is_sparse, nnz
from cpbench.solvers.base import Budget, SolverSpec, StackCall, register
from cpbench_solvers.automatic import Plan, SolverPhase, automatic_spec, ready
from cpbench_solvers.avi.apart import ByParts
from cpbench_solvers.lcp.claims import error_of
from cpbench_solvers.stacks import solve_lcp

SMALL = 200
"""Up to this many unknowns Lemke's method is done before others have factored M_FF a few times."""
LARGE = 2000
"""Beyond, what takes M apart in dense storage is asked last."""
FEW = 0.1
"""A larger share of nonzeros counts as dense."""
STEPS, PRODUCTS = 2000, 4
"""At most, of conjugate gradients on faces or of projected SOR, a product with a sparse M each; and times n² over the
entries of M, which takes about as long as block pivoting on M in dense storage."""
PIVOTS = 10
"""Times n, of Lemke's method in its first turn: on games whose paths are not long it takes about 2n."""
EXCHANGES = 50
"""Of bases on a small problem on which Lemke's method has failed: more are those of the least index."""
NEWTON = SolverPhase("newton-min"), SolverPhase("newton-fb"), SolverPhase("newton-pfb")
ON_SMALL = SolverPhase("lemke"), SolverPhase("bpp", EXCHANGES), *NEWTON, SolverPhase("enumeration-lcp")


@register
class AutoLCP(ByParts):
    """Lemke's method on small problems and block principal pivoting on larger ones, then Newton's on equations whose
    stationary points lie elsewhere; where M is sparse a few sweeps and, if it is symmetric, conjugate gradients first.

    Of at most 20 unknowns, all complementary bases are tried in the end: a solution is found if there is one.
    """

    spec: ClassVar[SolverSpec] = automatic_spec(
        "lcp", "auto-lcp", "Lemke, block pivoting, conjugate gradients or Newton, by size and structure"
    )
    stack_call: ClassVar[StackCall | None] = StackCall(solve_lcp)
    few: ClassVar[int] = SMALL
    members: ClassVar[tuple[str, ...]] = (
        "lemke",
        "bpp",
        "psor",
        "mprgp",
        "newton-min",
        "newton-fb",
        "newton-pfb",
        "enumeration-lcp",
    )

    def error(self, problem: LCP, point: LCPPoint, tolerance: float) -> float:
        return error_of(problem, point.z, tolerance)

    def setup(self, problem: LCP, budget: Budget, options: Any) -> Plan:
        if not 0 < problem.q.size <= SMALL:
            return super().setup(problem, budget, options)
        # no question of the general way has another answer here, and to ask them all takes as long as such a problem
        solver, own = ready(ON_SMALL[0])
        return Plan(problem, ON_SMALL, solver.setup(problem, budget, own), own, solver)

    def phases(self, problem: LCP) -> Sequence[SolverPhase]:
        n = problem.q.size
        if n <= SMALL:
            return ON_SMALL
        positive = bool(np.all(problem.M.diagonal() > 0))
        entries = nnz(problem.M)
        few = is_sparse(problem.M) and entries < FEW * n * n
        products: list[SolverPhase] = []
        if few and positive:
            most = min(STEPS, PRODUCTS * n * n // entries)
            faces = SolverPhase("mprgp", most, {"projected": True})
            products = [faces if problem.symmetric else SolverPhase("psor", most)]
        bordered, pivoting = SolverPhase("bpp"), SolverPhase("lemke", PIVOTS * n)
        if n > LARGE and few:
            return [*products, *NEWTON, bordered, pivoting]
        if positive:
            return [*products, bordered, NEWTON[0], pivoting, *NEWTON[1:]]
        return [pivoting, bordered, *NEWTON]
