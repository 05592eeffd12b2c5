"""Drake's Moby: Lemke's pivoting, and where it fails again on M + 10ᵏ·I, k = −20, −19, ..., 0."""

from __future__ import annotations

from typing import Any

from cpbench.solvers.adapters.drake_lcp import CITATION, LICENCE, DrakeLCP
from cpbench.solvers.base import SolverSpec, Trait, register


@register
class DrakeMoby(DrakeLCP):
    """Drake's `MobyLcpSolver`. It tests an answer of a regularized problem on that problem, not on the one that was
    asked: its success is passed on as its claim, true or not. Ties are broken by the first index, which may cycle."""

    spec = SolverSpec(
        name="drake-moby",
        node="lcp",
        summary="Drake's MobyLcpSolver: Lemke, then Lemke on M + λI with growing λ, dense",
        method="pivoting",
        citation=f"Drumwright: Moby, a rigid body dynamics library; {CITATION}",
        requires=("pydrake",),
        install="pip install drake",
        licence=LICENCE,
        traits=frozenset({Trait.DETERMINISTIC}),
        known_failures={
            "check_infeasibility_is_proved_or_not_claimed_solved": "kSolutionFound where w₁ = −z₂ − z₃ − δ < 0, "
            "Pang's problem, at residual δ: 1e-4 here, 1.0 for δ = 1",
            "case-any": "kSolutionFound for a nonsymmetric M of no class, n = 12, at error 0.47",
        },
    )

    def guest(self) -> Any:
        from pydrake.solvers import MobyLcpSolver

        return MobyLcpSolver()
