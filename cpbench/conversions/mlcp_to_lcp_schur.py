"""MLCP → LCP by Schur complement (equation (14) and the reduction after it).

Source  Au + Cv + a = 0,  0 ≤ v ⟂ Du + Bv + b ≥ 0,  A nonsingular.
Target  M = B − D A⁻¹C,  q = b − D A⁻¹a,  z = v.
Lift    u = −A⁻¹(Cz + a),  v = z.        Push  z = v.
Kind    equivalent. A is factored once, its inverse is never formed; the factorization travels in the trace.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench import matrices
from cpbench.conversions.base import Conversion, conversions
from cpbench.errors import NotApplicable
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.matrices import Factorization


@conversions.register("mlcp-lcp-schur")
@dataclass(frozen=True)
class MLCPtoLCPSchur(Conversion):
    """Eliminate the free unknowns. Trace: `factor` (A), `C`, `a`."""

    name = "mlcp-lcp-schur"
    source = "mlcp"
    target = "lcp"
    equation = "(14)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: MLCP) -> str | None:
        return _singular(Factorization(problem.A))

    def apply(self, problem: MLCP) -> tuple[LCP, Trace]:
        factor = Factorization(problem.A)
        why = _singular(factor)
        if why is not None:
            raise NotApplicable(self.label, why)
        M = problem.B - problem.D @ factor.solve(problem.C)
        q = problem.b - problem.D @ factor.solve(problem.a)
        if matrices.is_sparse(problem.B) and matrices.nnz(matrices.sparse(M)) < 0.25 * M.size:
            M = matrices.sparse(M)
        return LCP(M=M, q=q), {"factor": factor, "C": problem.C, "a": problem.a}

    def lift(self, point: LCPPoint, trace: Trace) -> MLCPPoint:
        factor, C, a = trace["factor"], trace["C"], trace["a"]
        return MLCPPoint(u=-factor.solve(C @ point.z + a), v=point.z)

    def push(self, point: MLCPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.v)


def _singular(factor: Factorization) -> str | None:
    if not factor.singular:
        return None
    n = factor.n
    rank = f", rank {matrices.rank(factor.A)}" if n <= 500 else ""
    condition = f"{1 / factor.rcond:.1e}" if factor.rcond > 0 else "infinite"
    return (
        f"the equality block A ({n}x{n}{rank}) is numerically singular, condition number {condition}; "
        "use mlcp-lcp-split, which needs no inverse"
    )
