"""Conversions of problems with an affine map: lcp, mlcp, relay and avi."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.conversions import elimination, kkt, maps
from cpbench.conversions.base import Conversion, SameUnknowns, Size, edge
from cpbench.conversions.bounds import FromBounds, amplification
from cpbench.conversions.elimination import Elimination
from cpbench.conversions.qualification import WhereConvex
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.linear import AVI, LCP, MLCP, AVIPoint, LCPPoint, MLCPPoint, Relay
from cpbench.formulations.nonlinear import NCP, MiCP, MiCPPoint
from cpbench.formulations.programs import QP, QPPoint
from cpbench.formulations.variational import VI
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Matrix, Sparse, Vector


@edge("lcp-avi", equation="(13) → (22)", kind=Kind.EQUIVALENT, cost=1.0)
class LCPtoAVI(SameUnknowns):
    """LCP → AVI over the orthant (equations (13) and (22)).

    Source  0 ≤ z ⟂ Mz + q ≥ 0.
    Target  −(Mz + q) ∈ N_X(z),  X = {z ≥ 0}.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def apply(self, problem: LCP) -> tuple[AVI, Trace]:
        return AVI(M=problem.M, q=problem.q, lb=np.zeros(problem.q.size)), {}


@edge("lcp-mlcp", equation="(14)", kind=Kind.EQUIVALENT, cost=1.0)
class LCPtoMLCP(SameUnknowns):
    """LCP → MLCP without free unknowns (equations (13) and (14)).

    Source  0 ≤ z ⟂ Mz + q ≥ 0.
    Target  B = M,  b = q,  v = z;  A, C, D and a are empty (n = 0).
    Lift    z = v.        Push  v = z, u empty.
    Kind    equivalent.
    """

    renamed = {"z": "v"}

    def apply(self, problem: LCP) -> tuple[MLCP, Trace]:
        M, m = problem.M, problem.q.size
        target = MLCP(
            A=matrices.zeros(0, 0, M),
            B=M,
            C=matrices.zeros(0, m, M),
            D=matrices.zeros(m, 0, M),
            a=np.zeros(0),
            b=problem.q,
        )
        return target, {}


@edge("lcp-ncp", equation="(13) → (19)", kind=Kind.EQUIVALENT, cost=4.0)
class LCPtoNCP(SameUnknowns):
    """LCP → NCP, the affine one (equations (13) and (19)).

    Source  0 ≤ z ⟂ Mz + q ≥ 0.
    Target  0 ≤ z ⟂ F(z) ≥ 0,  F(z) = Mz + q.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def obstacle(self, problem: LCP) -> str | None:
        return maps.too_large(problem.M)

    def apply(self, problem: LCP) -> tuple[NCP, Trace]:
        self.require(problem)
        return NCP(F=maps.affine(problem.M, problem.q)), {}


@edge("lcp-qp", equation="(1)", kind=Kind.EQUIVALENT, cost=1.0)
class LCPtoQP(Conversion):
    """LCP → QP, M symmetric positive semidefinite (equations (1) and (13)).

    Source  0 ≤ z ⟂ w = Mz + q ≥ 0.
    Target  min ½zᵀMz + qᵀz over z ≥ 0; stationarity Mz + q − ν = 0, with 0 ≤ z ⟂ ν ≥ 0: ν is w.
            z ≥ 0 is the QP's box (lb = 0), which every QP solver treats better than rows A = I, b = 0.
    Lift    z.        Push  z, ν = Mz + q.
    Kind    equivalent: the QP is convex, so its minimisers are its stationary points.

    Trace: `M`, `q`, for the multipliers of `push`.
    """

    def obstacle(self, problem: LCP) -> str | None:
        if not problem.symmetric:
            return f"M is not symmetric, asymmetry = {matrices.asymmetry(problem.M):.1e}; use lcp-qp-nonsymmetric"
        if not problem.monotone:
            least = matrices.least_eigenvalue(problem.M)
            return (
                f"M is not positive semidefinite, least eigenvalue at unit diagonal {least:.1e} or less, so a "
                "minimiser need not exist; use lcp-mlcp, or lcp-qp-nonsymmetric, which is necessary only"
            )
        return None

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for three digits more: a duality gap δ may leave a natural residual min(zᵢ, wᵢ) between δ and √δ.

        A guarantee would take ε², which methods of first order do not reach; three digits cost no measurable time.
        """
        return 1e-3 * tolerance

    def apply(self, problem: LCP) -> tuple[QP, Trace]:
        self.require(problem)
        target = QP.build(problem.M, problem.q, lb=np.zeros(problem.q.size))
        return target, {"M": problem.M, "q": problem.q}

    def lift(self, point: QPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)

    def push(self, point: LCPPoint, trace: Trace) -> QPPoint:
        none = np.zeros(0)
        return QPPoint(z=point.z, lam=none, mu=none, nu=trace["M"] @ point.z + trace["q"])


@edge("lcp-qp-nonsymmetric", equation="(15)", kind=Kind.NECESSARY, cost=3.0)
class LCPtoQPNonsymmetric(WhereConvex):
    """LCP → QP for any M: minimise zᵀw over the feasible set (equation (15)).

    Source  0 ≤ z ⟂ w = Mz + q ≥ 0.
    Target  min ½zᵀ(M + Mᵀ)z + qᵀz = zᵀw  subject to  Mz ≥ −q,  z ≥ 0 (as bounds, multiplier ν).
            z solves the LCP if and only if the objective is 0; then λ = z and ν = w are multipliers.
    Lift    z.        Push  z, λ = z, ν = Mz + q.
    Kind    equivalent when M + Mᵀ is positive semidefinite (feasible implies solvable). Otherwise necessary: a solution
            of the LCP is a global minimiser, but a stationary point need not be one.

    Trace: `M`, `q`, for the multipliers of `push`.
    """

    matrix = "M"

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for ε²: a gap δ = Σ zᵢwᵢ may be one product √δ·√δ, whose natural residual min(zᵢ, wᵢ) is √δ."""
        return min(tolerance, tolerance * tolerance)

    def apply(self, problem: LCP) -> tuple[QP, Trace]:
        M, q = problem.M, problem.q
        target = QP.build(M + matrices.transpose(M), q, A=M, b=-q, lb=np.zeros(q.size))
        return target, {"M": M, "q": q}

    def lift(self, point: QPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)

    def push(self, point: LCPPoint, trace: Trace) -> QPPoint:
        w = trace["M"] @ point.z + trace["q"]
        return QPPoint(z=point.z, lam=point.z, mu=np.zeros(0), nu=w)


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
        rows, positions = np.array(groups[0][key]), np.array(groups[1][key])
        block = matrices.dense(A[rows][:, positions])
        if key == _ZERO:
            factor, score = _free_scales(A, block, rows, positions, scale, source)
        else:
            factor = _leading(wanted, positions)[None, :] / _leading(C, rows)[:, None]
            score = factor * block
        from scipy.optimize import linear_sum_assignment  # slow to import

        chosen, at = linear_sum_assignment(score, maximize=True)
        source[positions[at]] = rows[chosen]
        scale[positions[at]] = factor[chosen, at]
    return sp.csr_array((scale, (np.arange(n), source)), shape=(n, n))


def _free_scales(
    A: Sparse, block: Dense, rows: NDArray[Any], positions: NDArray[Any], scale: Vector, source: NDArray[Any]
) -> tuple[Dense, Dense]:
    """Return scales and scores of the pairs (row, place) of rows that v does not enter.

    A nonzero diagonal entry becomes positive; a zero one in a semidefinite matrix has a skew row and column. Over
    the places filled before, the row should be what stands in its own column there, or minus it (`alignment` 1).
    """
    placed = np.flatnonzero(source >= 0)
    across = matrices.dense(A[rows][:, placed])
    down = scale[placed][:, None] * matrices.dense(A[source[placed]][:, positions])
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
        return maps.too_large(problem.A, problem.B, problem.C, problem.D)

    def apply(self, problem: MLCP) -> tuple[MiCP, Trace]:
        self.require(problem)
        n, m = problem.a.size, problem.b.size
        whole = matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
        F = maps.affine(whole, np.concatenate([problem.a, problem.b]))
        lb = np.concatenate([np.full(n, -np.inf), np.zeros(m)])
        return MiCP(F=F, lb=lb, ub=np.full(n + m, np.inf)), {"n": n}

    def lift(self, point: MiCPPoint, trace: Trace) -> MLCPPoint:
        return MLCPPoint(u=point.z[: trace["n"]], v=point.z[trace["n"] :])

    def push(self, point: MLCPPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=np.concatenate([point.u, point.v]))


@edge("relay-avi", equation="(22)", kind=Kind.EQUIVALENT, cost=1.0)
class RelayToAVI(SameUnknowns):
    """Relay → AVI: the box is a polyhedron.

    Source  −(Mz + q) ∈ N_[lb,ub](z).
    Target  the same, with no rows beside the bounds.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def apply(self, problem: Relay) -> tuple[AVI, Trace]:
        return AVI(M=problem.M, q=problem.q, lb=problem.lb, ub=problem.ub), {}


@edge("relay-lcp", equation="(22) → (13)", kind=Kind.EQUIVALENT, cost=1.0)
class RelayToLCP(FromBounds):
    """Relay → LCP with a multiplier for every upper bound.

    Source  −(Mz + q) ∈ N_[lb,ub](z), bounds finite.
    Target  z = lb + x:  0 ≤ x ⟂ Mx + y + q + M lb ≥ 0,  0 ≤ y ⟂ ub − lb − x ≥ 0;  matrix [[M, I], [−I, 0]].
            A variable whose ub is nearer to 0 is turned round, z = ub − x, which loses no digits to a far lb.
    Lift    z = lb + x.        Push  x = z − lb,  y = max(−(Mz + q), 0).
    Kind    equivalent. M + Mᵀ positive semidefinite stays so.

    Trace: see `bounds`.
    """


@edge("avi-lcp-bounds", equation="(22) → (13)", kind=Kind.EQUIVALENT, cost=1.0)
class AVItoLCPBounds(FromBounds):
    """AVI over a box → LCP; bounds may be missing on one side.

    Source  −(Mz + q) ∈ N_[lb,ub](z), every variable bounded on one side at least, no rows beside.
    Target  z = c + Sx, c the bound nearer to 0, S = 1 for lb and −1 for ub; y ≥ 0 where both bounds are finite:
            0 ≤ x ⟂ SMSx + Jᵀy + S(q + Mc) ≥ 0,  0 ≤ y ⟂ ub − lb − Jx ≥ 0.
    Lift    z = c + Sx.        Push  x = S(z − c),  y = max(−S(Mz + q), 0).
    Kind    equivalent.

    Trace: see `bounds`.
    """

    def obstacle(self, problem: AVI | Relay) -> str | None:
        assert isinstance(problem, AVI)
        if not problem.only_box:
            rows = problem.b.size + problem.d.size
            return f"the set has {rows} rows beside its bounds; use avi-mlcp"
        free = np.flatnonzero(np.isinf(problem.lb) & np.isinf(problem.ub))
        if free.size:
            return f"{free.size} variables have no bound, the first is {free[0]}; use avi-mlcp"
        return super().obstacle(problem)


@edge("avi-mlcp", equation="(22) → (14)", kind=Kind.EQUIVALENT, cost=1.0)
class AVItoMLCP(Conversion):
    """AVI → MLCP by multipliers of the polyhedron.

    Source  −(Mz + q) ∈ N_X(z),  X = {Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
    Target  with finite bounds among the rows E, e and F, g (as in qp-mlcp), u = (z, μ) free, v = λ:
            Mz + q − Fᵀμ − Eᵀλ = 0,  Fz − g = 0,  0 ≤ λ ⟂ Ez − e ≥ 0.
    Lift    z, λ and μ of A and C.        Push  the same, with ν = Mz + q − Aᵀλ − Cᵀμ for the bounds that are
            pressed.
    Kind    equivalent: X is a polyhedron, so the multipliers exist for every M.

    Trace: sizes and indices as qp-mlcp; `M`, `q` and the set for the multipliers of `push`.
    """

    def apply(self, problem: AVI) -> tuple[MLCP, Trace]:
        constraints = kkt.rows(problem, problem.M)
        kept = {"M": problem.M, "q": problem.q, **kkt.polyhedron(problem)}
        return kkt.conditions(problem.M, problem.q, constraints), {**constraints.sizes, **kept}

    def lift(self, point: MLCPPoint, trace: Trace) -> AVIPoint:
        z, equality = np.split(point.u, [trace["n"]])
        lam, mu, _ = kkt.split(point.v, equality, trace)
        return AVIPoint(z=z, lam=lam, mu=mu)

    def push(self, point: AVIPoint, trace: Trace) -> MLCPPoint:
        z, lam, mu = point.z, point.lam, point.mu
        nu = kkt.pressing(trace, z, lam, mu)
        inequality, equality = kkt.join(lam, mu, nu, trace)
        return MLCPPoint(u=np.concatenate([z, equality]), v=inequality)


@edge("avi-qp", equation="(22) → (1)", kind=Kind.ONE_WAY, cost=1.0)
class AVItoQP(WhereConvex):
    """AVI → QP, M symmetric: the objective whose gradient is Mz + q.

    Source  −(Mz + q) ∈ N_X(z),  X = {Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
    Target  min ½zᵀMz + qᵀz over X.
    Lift    z, λ, μ.        Push  z, λ, μ;  ν = Mz + q − Aᵀλ − Cᵀμ where a bound is pressed, else 0.
    Kind    equivalent when M is positive semidefinite, otherwise one-way. What a verdict on the QP accepts are its
            stationary points, with the flag `stationary` where M is indefinite, and they are the solutions, one for
            one. What the QP asks for are its minima: each is a solution, but there may be fewer of them (M = −1, q = 0
            on [−1, 1] has the solution 0 too) or none (M = −1, q = 1 on z ≥ 0), which says nothing of the source.

    Trace: `M`, `q` and the set, for `push`.
    """

    matrix = "M"

    def obstacle(self, problem: AVI) -> str | None:
        if problem.symmetric:
            return None
        return f"M is not symmetric, asymmetry = {matrices.asymmetry(problem.M):.1e}: it is no gradient; use avi-mlcp"

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for three digits more, as lcp-qp: a duality gap δ may leave a natural residual between δ and √δ."""
        return 1e-3 * tolerance

    def apply(self, problem: AVI) -> tuple[QP, Trace]:
        self.require(problem)
        polyhedron = kkt.polyhedron(problem)
        return QP(Q=problem.M, p=problem.q, **polyhedron), {"M": problem.M, "q": problem.q, **polyhedron}

    def lift(self, point: QPPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z, lam=point.lam, mu=point.mu)

    def push(self, point: AVIPoint, trace: Trace) -> QPPoint:
        z, lam, mu = point.z, point.lam, point.mu
        return QPPoint(z=z, lam=lam, mu=mu, nu=kkt.pressing(trace, z, lam, mu))


@edge("avi-relay", equation="(22)", kind=Kind.EQUIVALENT, cost=1.0)
class AVItoRelay(SameUnknowns):
    """AVI over a finite box → relay.

    Source  −(Mz + q) ∈ N_[lb,ub](z), bounds finite, no rows beside.
    Target  the same.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def obstacle(self, problem: AVI) -> str | None:
        if not problem.only_box:
            rows = problem.b.size + problem.d.size
            return f"the set has {rows} rows beside its bounds, a relay has a box; use avi-mlcp"
        infinite = int(np.isinf(problem.lb).sum() + np.isinf(problem.ub).sum())
        if infinite:
            return f"{infinite} bounds are infinite, those of a relay are finite; use avi-lcp-bounds or avi-mlcp"
        return None

    def apply(self, problem: AVI) -> tuple[Relay, Trace]:
        self.require(problem)
        return Relay(M=problem.M, q=problem.q, lb=problem.lb, ub=problem.ub), {}


@edge("avi-vi", equation="(22)", kind=Kind.EQUIVALENT, cost=4.0)
class AVItoVI(SameUnknowns):
    """AVI → VI (equation (22)).

    Source  −(Mz + q) ∈ N_X(z),  X = {z : Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
    Target  −F(z) ∈ N_X(z),  F(z) = Mz + q.
    Lift    z, λ, μ.        Push  the same.
    Kind    equivalent.
    """

    def obstacle(self, problem: AVI) -> str | None:
        return maps.too_large(problem.M)

    def apply(self, problem: AVI) -> tuple[VI, Trace]:
        self.require(problem)
        return VI(F=maps.affine(problem.M, problem.q), **kkt.polyhedron(problem)), {}
