"""MLCP → LCP by Schur complement (equation (14) and the reduction after it).

Source  Au + Cv + a = 0,  0 ≤ v ⟂ Du + Bv + b ≥ 0,  A nonsingular.
Target  M = B − D A⁻¹C,  q = b − D A⁻¹a,  z = v.
Lift    u = −A⁻¹(Cz + a),  v = z.        Push  z = v.
Kind    equivalent while eps cond(A) <= 1e-8 (`elimination.LOSSLESS`), one-way beyond: the target may then lack
        solutions of the source, and what is lifted is as exact as rounding leaves it. Refused from cond(A) = 1e13 on.
        A is factored once and not inverted; it travels in the trace with C and a.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import elimination
from cpbench.conversions.base import Conversion, Size, conversions
from cpbench.conversions.shift import amplification
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.foundation import matrices


@conversions.register("mlcp-lcp-schur")
@dataclass(frozen=True)
class MLCPtoLCPSchur(Conversion):
    """Eliminate the free unknowns. Trace: `factor` (A), `C`, `a`, `shift`."""

    name = "mlcp-lcp-schur"
    source = "mlcp"
    target = "lcp"
    equation = "(14)"
    kind = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    cost = 1.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, MLCP)
        return elimination.kind(problem.factorization.rcond)

    def reservation(self, problem: MLCP) -> str:
        return elimination.reservation(problem.factorization.rcond, "the equality block A")

    def obstacle(self, problem: MLCP) -> str | None:
        instead = "use mlcp-lcp-split, which needs no inverse"
        return elimination.singularity(problem.factorization, "the equality block A", instead)

    def predict(self, problem: MLCP) -> Size:
        return elimination.size_bound(problem.D, problem.factorization, problem.C, matrices.nnz(problem.B))

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for more, for the terms that cancel on the way back (see `shift`)."""
        return tolerance / trace["shift"]

    def apply(self, problem: MLCP) -> tuple[LCP, Trace]:
        self.require(problem)
        factor = problem.factorization
        M = elimination.schur(problem.B, problem.D, factor, problem.C)
        q = elimination.less(problem.b, problem.D, factor, problem.a)
        shift = amplification(problem.b - q, problem.b)
        return LCP(M=M, q=q), {"factor": factor, "C": problem.C, "a": problem.a, "shift": shift}

    def lift(self, point: LCPPoint, trace: Trace) -> MLCPPoint:
        factor, C, a = trace["factor"], trace["C"], trace["a"]
        return MLCPPoint(u=-factor.solve(C @ point.z + a), v=point.z)

    def push(self, point: MLCPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.v)
