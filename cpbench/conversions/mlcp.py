"""Conversions of mlcp."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.conversions import elimination, nonlinear
from cpbench.conversions.base import Conversion, Size, edge
from cpbench.conversions.bounds import amplification
from cpbench.conversions.elimination import Elimination
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.linear import LCP, MLCP, LCPPoint, MLCPPoint
from cpbench.formulations.nonlinear import MiCP, MiCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Matrix, Sparse, Vector


@edge("mlcp-lcp-schur", equation="(14)", cost=1.0)
class MLCPtoLCPSchur(Elimination):
    """MLCP → LCP by Schur complement (equation (14) and the reduction after it).

    Source  Au + Cv + a = 0,  0 ≤ v ⟂ Du + Bv + b ≥ 0,  A nonsingular.
    Target  M = B − D A⁻¹C,  q = b − D A⁻¹a,  z = v.
    Lift    u = −A⁻¹(Cz + a),  v = z.        Push  z = v.
    Kind    equivalent while eps cond(A) <= 1e-8 (`elimination.LOSSLESS`), one-way beyond: the target may then lack
            solutions of the source, and what is lifted is as exact as rounding leaves it. Refused from cond(A) = 1e13
            on. A is factored once and not inverted; it travels in the trace with C and a.

    Trace: `factor` (A), `C`, `a`, `shift`.
    """

    eliminated = "the equality block A"

    def obstacle(self, problem: MLCP) -> str | None:
        instead = "use mlcp-lcp-split, which needs no inverse"
        return elimination.singularity(problem.factorization, "the equality block A", instead)

    def predict(self, problem: MLCP) -> Size:
        return elimination.size_bound(problem.D, problem.factorization, problem.C, matrices.nnz(problem.B))

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


@edge("mlcp-lcp-split", equation="(14)", kind=Kind.EQUIVALENT, cost=3.0)
class MLCPtoLCPSplit(Conversion):
    """MLCP → LCP by splitting the free unknowns, for any A (equation (14)).

    Source  Au + Cv + a = 0,  0 ≤ v ⟂ Du + Bv + b ≥ 0.
    Target  z = (u⁺, u⁻, v),  M = [[A, −A, C], [−A, A, −C], [D, −D, B]],  q = (a, −a, b).
            M is positive semidefinite, which pivoting and interior methods want, when [[A, C], [D, B]] is. The order
            and the signs of the equalities are arbitrary, so they are replaced by P times them first, P monomial (a
            permutation with scales), where PC = −Dᵀ or PC = Dᵀ makes the whole semidefinite.
    Lift    u = u⁺ − u⁻,  v.        Push  u⁺ = max(u, 0), u⁻ = max(−u, 0), v.
    Kind    equivalent; P changes the equalities, not their solutions. The solutions of the target form rays along
            u⁺ = u⁻, its matrix is singular: no target for an interior point or a plain Newton method. With t more in
            both, the terms of the rows are 2|A|t larger, and what is ε of these may be (1 + 2t/|u|) ε of the source:
            `lost`. No tolerance can make up for it, t being the answer's. A method that leaves one of both at 0 has t =
            0.

    Trace: `n`, their number.
    """

    def apply(self, problem: MLCP) -> tuple[LCP, Trace]:
        P = semidefinite_transform(problem)
        A, C, a = problem.A, problem.C, problem.a
        if P is not None:
            A, C, a = P @ A, P @ C, P @ a
        B, D, b = problem.B, problem.D, problem.b
        M = matrices.block([[A, -A, C], [-A, A, -C], [D, -D, B]])
        return LCP(M=M, q=np.concatenate([a, -a, b])), {"n": problem.a.size}

    def lift(self, point: LCPPoint, trace: Trace) -> MLCPPoint:
        n = trace["n"]
        return MLCPPoint(u=point.z[:n] - point.z[n : 2 * n], v=point.z[2 * n :])

    def push(self, point: MLCPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=np.concatenate([np.maximum(point.u, 0.0), np.maximum(-point.u, 0.0), point.v]))


def semidefinite_transform(problem: MLCP) -> Sparse | None:
    """Return a monomial P for which [[PA, PC], [D, B]] is positive semidefinite; None when none is needed or none is
    found.

    Row i of the equalities may stand at place j when it is a multiple p of −(Dᵀ)_j (or of (Dᵀ)_j) on v. Where
    several may, those are taken that give PA the largest diagonal: a semidefinite matrix has no negative one.
    """
    A, B, C, D = problem.A, problem.B, problem.C, problem.D
    if problem.a.size == 0 or not matrices.is_psd(B) or matrices.is_psd(matrices.block([[A, C], [D, B]])):
        return None
    equalities, wanted = matrices.sparse(C), matrices.sparse(matrices.transpose(D))
    for sign in (-1.0, 1.0):  # skew first: it leaves PA and B to be semidefinite each for itself
        P = _match(matrices.sparse(A), equalities, matrices.sparse(wanted * sign))
        if P is not None and matrices.is_psd(matrices.block([[P @ A, P @ C], [D, B]])):
            return P
    return None


def _match(A: Sparse, C: Sparse, wanted: Sparse) -> Sparse | None:
    """Find P with PC = wanted, row by row, from groups of parallel rows; None when the rows cannot be paired."""
    groups = _parallel_rows(C), _parallel_rows(wanted)
    if {k: len(v) for k, v in groups[0].items()} != {k: len(v) for k, v in groups[1].items()}:
        return None
    n = A.shape[0]
    scale, source = np.ones(n), np.full(n, -1)
    # rows that v does not enter come last: their scale is free, and is read off from the rows placed before them
    for key in sorted(groups[0], key=lambda k: k == _ZERO):
        rows, places = np.array(groups[0][key]), np.array(groups[1][key])
        block = matrices.dense(A[rows][:, places])
        if key == _ZERO:
            factor, score = _free_scales(A, block, rows, places, scale, source)
        else:
            factor = _leading(wanted, places)[None, :] / _leading(C, rows)[:, None]
            score = factor * block
        from scipy.optimize import linear_sum_assignment  # slow to import

        chosen, at = linear_sum_assignment(score, maximize=True)
        source[places[at]] = rows[chosen]
        scale[places[at]] = factor[chosen, at]
    return sp.csr_array((scale, (np.arange(n), source)), shape=(n, n))


def _free_scales(
    A: Sparse, block: Dense, rows: NDArray[Any], places: NDArray[Any], scale: Vector, source: NDArray[Any]
) -> tuple[Dense, Dense]:
    """Return scales and scores of the pairs (row, place) of rows that v does not enter.

    A nonzero diagonal entry becomes positive; a zero one in a semidefinite matrix has a skew row and column. Over
    the places filled before, the row should be what stands in its own column there, or minus it (`alignment` 1).
    """
    placed = np.flatnonzero(source >= 0)
    across = matrices.dense(A[rows][:, placed])
    down = scale[placed][:, None] * matrices.dense(A[source[placed]][:, places])
    product = across @ down
    row_norm, column_norm = np.linalg.norm(across, axis=1)[:, None], np.linalg.norm(down, axis=0)[None, :]
    both = (row_norm > 0.0) & (column_norm > 0.0)
    alignment = np.where(row_norm + column_norm > 0.0, 0.0, 1.0)
    np.divide(np.abs(product), row_norm * column_norm, out=alignment, where=both)
    factor = np.where(block != 0.0, np.sign(block), np.where(product > 0.0, -1.0, 1.0))
    size = np.ones_like(factor)
    np.divide(np.abs(product), row_norm**2, out=size, where=both & (product != 0.0))
    return factor * size, alignment + np.abs(block) / max(matrices.max_abs(block), np.finfo(float).tiny)


_ZERO = (b"", b"")


def _parallel_rows(M: Sparse) -> dict[tuple[bytes, bytes], list[int]]:
    """Group rows by direction: pattern, and values over the first one to ten digits."""
    groups: dict[tuple[bytes, bytes], list[int]] = defaultdict(list)
    for i, (columns, values) in enumerate(_rows(M)):
        direction = np.round(values / values[0], 10) + 0.0 if values.size else values
        groups[columns.astype(np.int64).tobytes(), direction.tobytes()].append(i)
    return dict(groups)


def _leading(M: Sparse, rows: NDArray[Any]) -> Vector:
    """Return the first nonzero entry of each of the rows."""
    parts = list(_rows(sp.csr_array(M[rows])))
    return np.array([values[0] for _, values in parts])


def _rows(M: Matrix) -> Iterator[tuple[NDArray[Any], Vector]]:
    """Yield columns and values of the nonzero entries, row by row."""
    M = sp.csr_array(M, copy=True)
    M.sum_duplicates()
    M.eliminate_zeros()
    for start, stop in zip(M.indptr[:-1], M.indptr[1:], strict=True):
        yield M.indices[start:stop], M.data[start:stop]


@edge("mlcp-micp", equation="(14) → (20)", kind=Kind.EQUIVALENT, cost=4.0)
class MLCPtoMiCP(Conversion):
    """MLCP → MiCP, the affine one (equations (14) and (20)).

    Source  Au + Cv + a = 0,  0 ≤ v ⟂ Du + Bv + b ≥ 0.
    Target  z = (u, v),  F(z) = [[A, C], [D, B]] z + (a, b),  lb = (−∞, 0),  ub = ∞.
    Lift    u and v, the parts of z.        Push  z = (u, v).
    Kind    equivalent.

    Trace: `n`, how many unknowns are free.
    """

    def obstacle(self, problem: MLCP) -> str | None:
        return nonlinear.too_large(problem.A, problem.B, problem.C, problem.D)

    def apply(self, problem: MLCP) -> tuple[MiCP, Trace]:
        self.require(problem)
        n, m = problem.a.size, problem.b.size
        whole = matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
        F = nonlinear.affine(whole, np.concatenate([problem.a, problem.b]))
        lb = np.concatenate([np.full(n, -np.inf), np.zeros(m)])
        return MiCP(F=F, lb=lb, ub=np.full(n + m, np.inf)), {"n": n}

    def lift(self, point: MiCPPoint, trace: Trace) -> MLCPPoint:
        return MLCPPoint(u=point.z[: trace["n"]], v=point.z[trace["n"] :])

    def push(self, point: MLCPPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=np.concatenate([point.u, point.v]))
