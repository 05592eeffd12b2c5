"""Problems over a product K of closed convex factors, stored as four vectors: complementarity over a cone (17), linear
or not, and quadratic programs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cpbench.errors import ProblemError
from cpbench.formulations.base import (
    Point,
    Problem,
    Residuals,
    Term,
    formulations,
    map_field,
    matrix_field,
    point_field,
    scaled,
    vector_field,
)
from cpbench.formulations.expressions import Map
from cpbench.formulations.linear import AffineProblem
from cpbench.formulations.nonlinear import NonlinearProblem
from cpbench.formulations.sizes import group_max, least, ratio, row_sizes
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Dense, Matrix, Vector, freeze, max_abs, norm

COMPARABLE = 1e-3
"""Parts of x and w of a factor whose sizes differ by less lose no digits that matter; 0 loses none at all."""


def cone_defect(K: ProductCone, x: Vector, w: Vector) -> Vector:
    """Return the natural map x − P_K(x − w), shape (rows,), without forming x − w where that would lose x or w.

    A tiny reaction beside a huge force, or the other way round, is gone in x − w. Each component is therefore written
    as x less its part of the projection, or as w plus what is cut off, whichever changes it less; and how far y = x − w
    is outside of K is summed from the largest terms on, with ‖y_T‖ = L + ΔL, L the larger of ‖x_T‖ and ‖w_T‖ and
    ΔL = (‖y_T‖² − L²)/(‖y_T‖ + L).
    """
    result = x - K.project(x - w)
    for kind, rows, mu, mu_r in K.groups:
        a, b = x[rows], w[rows]
        if kind in (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE):
            result[rows] = _factor(kind, a, b, mu, mu_r)
            continue
        sizes = np.abs(a).max(axis=1, initial=0.0), np.abs(b).max(axis=1, initial=0.0)
        least = np.minimum(*sizes)
        apart = (least < COMPARABLE * np.maximum(*sizes)) & (least > 0)
        if apart.any():
            result[rows[apart]] = _factor(kind, a[apart], b[apart], mu[apart], mu_r[apart])
    return result


def _factor(kind: Cone, x: Dense, w: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """Return x − P(x − w) of the factors of one kind and size, shape (count, size)."""
    match kind:
        case Cone.ZERO:
            return x
        case Cone.FREE:
            return w
        case Cone.NONNEGATIVE:
            return np.minimum(x, w)
        case Cone.SECOND_ORDER:
            half_space = np.isinf(mu)
            result = _clipped(x, w, [(slice(1, None), np.where(half_space, 1.0, mu))])
            result[half_space, 0] = np.minimum(x[half_space, 0], w[half_space, 0])
            result[half_space, 1:] = w[half_space, 1:]
            return result
        case Cone.ROLLING:
            return _clipped(x, w, _moments(x, mu, mu_r))
        case Cone.ROLLING_DUAL:  # Moreau: x − P_K*(x − w) = w − P_K(w − x)
            return _clipped(w, x, _moments(x, mu, mu_r))
        case Cone.CYLINDER:
            return np.column_stack([np.minimum(x[:, 0], w[:, 0]), _disk(x[:, 1:], w[:, 1:], mu)])
        case Cone.BALL:
            return _disk(x, w, mu)


def _moments(x: Dense, mu: Vector, mu_r: Vector) -> list[tuple[slice, Vector]]:
    k = (x.shape[1] - 1) // 2
    return [(slice(1, 1 + k), mu), (slice(1 + k, None), mu_r)]


@dataclass(frozen=True)
class _Part:
    """Columns c of x − w, at most μ r_N long in K: their direction and ‖y_c‖ = L + ΔL, each shape (count,)."""

    columns: slice
    mu: Vector
    direction: Dense
    L: Vector
    gain: Vector

    @classmethod
    def of(cls, x: Dense, w: Dense, columns: slice, mu: Vector) -> _Part:
        a, b = x[:, columns], w[:, columns]
        y = a - b
        sizes = [np.sqrt(np.einsum("ij,ij->i", part, part)) for part in (a, b, y)]
        swap = sizes[1] > sizes[0]
        L, other = np.where(swap, sizes[1], sizes[0]), np.where(swap[:, None], a, b)
        # ‖y‖² − L² = o·(o − 2·the longer), o the shorter one
        change = np.einsum("ij,ij->i", other, other - 2.0 * np.where(swap[:, None], b, a))
        total = sizes[2] + L
        direction = y / np.where(sizes[2] > 0, sizes[2], 1.0)[:, None]
        return cls(columns, mu, direction, L, np.divide(change, total, out=np.zeros_like(L), where=total > 0))

    def defect(self, x: Dense, w: Dense, length: Vector, over: Vector) -> Dense:
        """Return where y_c is longer than `length` by `over`; w where over ≤ 0."""
        cut = w + np.maximum(over, 0.0)[:, None] * self.direction
        return np.where((length < over)[:, None], x - length[:, None] * self.direction, cut)


def _clipped(x: Dense, w: Dense, groups: list[tuple[slice, Vector]]) -> Dense:
    """Return {r : ‖r_c‖ ≤ μ_c r_N for one or two groups c}, as `cones.project_rolling_cone`.

    With e_c = ‖y_c‖ − μ_c y_N the projection raises y_N by g, the root of g = Σ μ_c(e_c − μ_c g)₊.
    """
    parts = [_Part.of(x, w, columns, mu) for columns, mu in groups]
    xn, wn = x[:, 0], w[:, 0]
    e = [_sum(p.L, p.gain, -p.mu * xn, p.mu * wn) for p in parts]
    active = _active([p.mu for p in parts], e)
    mus = [np.where(on, p.mu, 0.0) for p, on in zip(parts, active, strict=True)]
    D = 1.0 + sum(mu**2 for mu in mus)
    raised = sum(mu * e_c for mu, e_c in zip(mus, e, strict=True)) / D
    terms = [term for mu, p in zip(mus, parts, strict=True) for term in (mu * p.L, mu * p.gain)]
    rn = _sum(xn, -wn, *terms) / D
    result = np.empty_like(x)
    result[:, 0] = np.where(rn < raised, xn - rn, wn - raised)
    for c, p in enumerate(parts):
        others = [k for k in range(len(parts)) if k != c]
        over = e[c] * (1.0 + sum(mus[k] ** 2 for k in others)) - p.mu * sum(mus[k] * e[k] for k in others)
        # what is not active may be too long by rounding only
        over = np.where(active[c], over / (1.0 + p.mu**2 + sum(mus[k] ** 2 for k in others)), 0.0)
        result[:, p.columns] = p.defect(x[:, p.columns], w[:, p.columns], p.mu * rn, over)
    return np.where((rn <= 0.0)[:, None], x, result)


def _active(mus: list[Vector], e: list[Vector]) -> list[NDArray[np.bool_]]:
    """Return which groups the projection shortens."""
    if len(mus) == 1:
        return [e[0] > 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        kinks = [np.where(e_c > 0, e_c / mu, -np.inf) for mu, e_c in zip(mus, e, strict=True)]
    both = (mus[0] * e[0] + mus[1] * e[1]) / (1.0 + mus[0] ** 2 + mus[1] ** 2)
    low = np.minimum(*kinks)
    first = kinks[0] >= kinks[1]
    return [(e_c > 0) & ((both <= low) | own) for e_c, own in zip(e, (first, ~first), strict=True)]


def _disk(x: Dense, w: Dense, radius: Vector) -> Dense:
    part = _Part.of(x, w, slice(None), radius)
    return part.defect(x, w, radius, _sum(part.L, part.gain, -radius))


def _sum(*terms: Vector) -> Vector:
    """Sum from the largest term on: what cancels does so before small ones are added."""
    stacked = np.stack(terms)
    order = np.argsort(-np.abs(stacked), axis=0, kind="stable")
    total = np.zeros_like(terms[0])
    for row in np.take_along_axis(stacked, order, axis=0):
        total = total + row
    return total


class _HasCone:
    """The four vectors are declared by the nodes, after their matrices."""

    cone_kind: Vector
    cone_size: Vector
    cone_mu: Vector
    cone_mu_r: Vector


@dataclass(frozen=True, eq=False, kw_only=True)
class ConicProblem(_HasCone, Problem):
    """A problem over K = K₁ × … × K_k; factor i has kind `cone_kind[i]` (numbers of `Cone`) and `cone_size[i]` rows."""

    cone_rows: ClassVar[str]
    """Name of the vector with one number a row of K."""
    cone_kinds: ClassVar[tuple[Cone, ...]] = tuple(c for c in Cone if c is not Cone.BALL)

    def check(self) -> None:
        kind, size = self.cone_kind, self.cone_size
        kinds = ", ".join(f"{c.value} {c.name.lower()}" for c in self.cone_kinds)
        rolling = np.isin(kind, (Cone.ROLLING, Cone.ROLLING_DUAL))
        pointed = np.isin(kind, (Cone.SECOND_ORDER, Cone.CYLINDER))
        for name, bad, expected in (
            ("cone_kind", ~np.isin(kind, self.cone_kinds), f"one of {kinds}"),
            ("cone_size", (size < 0) | (size != np.floor(size)), "a number of rows"),
            ("cone_size", rolling & ~np.isin(size, (3, 5)), "3 or 5 rows of a rolling cone"),
            ("cone_size", pointed & (size < 1), "a normal component at least"),
            ("cone_mu", self.cone_mu < 0, "a coefficient of at least 0"),
            ("cone_mu_r", self.cone_mu_r < 0, "a coefficient of at least 0"),
        ):
            if bad.any():
                i = int(np.flatnonzero(bad)[0])
                value = getattr(self, name)[i]
                raise ProblemError(f"{self.node}.{name}", f"is {value:g} at factor {i}, expected {expected}")
        rows = getattr(self, self.cone_rows).size
        if size.sum() != rows:
            raise ProblemError(f"{self.node}.cone_size", f"adds up to {size.sum():g}, {self.cone_rows} has {rows}")

    @cached_property
    def K(self) -> ProductCone:
        """The product of the factors."""
        return ProductCone(self.cone_kind, self.cone_size, self.cone_mu, self.cone_mu_r)


def cone_fields(K: ProductCone) -> Mapping[str, Vector]:
    """Return K as the four data vectors of a conic node: kind, size, μ and μ_r of its runs of equal factors."""
    return {"cone_kind": K.kind, "cone_size": K.size, "cone_mu": K.mu, "cone_mu_r": K.mu_r}


def cone_residuals(K: ProductCone, s: Vector, y: Vector, s_scale: float | Vector, y_scale: float | Vector) -> float:
    """Return ‖(s − P_K(s − ρy))/σ_s‖ with ρ = σ_s/σ_y, which does not change with the units of s and y.

    The scales are numbers, or vectors that are constant on every factor, positive.
    """
    return norm(cone_defect(K, s, (s_scale / y_scale) * y) / s_scale)


@dataclass(frozen=True, eq=False)
class CPPoint(Point):
    """x (n,), λ ≥ 0 of the rows of the polyhedral cone Ax ≥ 0 (m,)."""

    x: Vector = point_field("n")
    lam: Vector = point_field("m", optional=True)


@formulations.register("cp")
@dataclass(frozen=True, eq=False, kw_only=True)
class CP(NonlinearProblem, ConicProblem):
    """C ∋ x ⟂ F(x) ∈ C* with C = {x ∈ K : Ax ≥ 0}, so that C* = K* + Aᵀℝ₊ᵐ (closed where K is polyhedral, or where
    some x inside K has Ax > 0).

    K is a product of {0}, ℝ, ℝ₊, second-order and rolling cones and their duals. With G = F(x) − Aᵀλ: x = P_K(x − G)
    and 0 ≤ λ ⟂ Ax ≥ 0. Measured: `natural`, the norm of both over `scale`.
    """

    node: ClassVar[str] = "cp"
    title: ClassVar[str] = "cone complementarity problem"
    equation: ClassVar[str] = "(17)"
    relations: ClassVar[tuple[str, ...]] = ("C ∋ x ⟂ F(x) ∈ C*", "C = {x ∈ K : Ax ≥ 0}")
    point_type: ClassVar[type[Point]] = CPPoint
    cone_rows: ClassVar[str] = "start"

    F: Map = map_field("n", "n")
    A: Matrix = matrix_field("m", "n", optional=True)
    cone_kind: Vector = vector_field("c")
    cone_size: Vector = vector_field("c")
    cone_mu: Vector = vector_field("c", finite=False)
    cone_mu_r: Vector = vector_field("c", fill=0.0)
    start: Vector = vector_field("n", fill=0.0)

    def check(self) -> None:
        super().check()
        if not self.K.conical:
            raise ProblemError("cp.cone_kind", "has a disk or a ball, which is not a cone; use vi")

    def project(self, z: Vector) -> Vector:
        return self.K.project(z)

    def slacks(self, point: CPPoint) -> dict[str, Vector]:
        return {"y": self.F(point.x)}

    def measure(self, point: CPPoint, tolerance: float) -> Residuals:
        x, y = point.x, self.F(point.x)
        defect = [cone_defect(self.K, x, y - self.A.T @ point.lam), np.minimum(point.lam, self.A @ x)]
        return self.natural(
            np.concatenate(defect),
            point.finite,
            cone_violation=norm(x - self.K.project(x)),
            complementarity=abs(float(x @ y)),
        )


@dataclass(frozen=True, eq=False)
class SOCLCPPoint(Point):
    """x, shape (n,)."""

    x: Vector = point_field("n")


@formulations.register("soclcp")
@dataclass(frozen=True, eq=False, kw_only=True)
class SOCLCP(AffineProblem, ConicProblem):
    """K ∋ x ⟂ w = Mx + q ∈ K*, K a product of cones: {0}, ℝ, ℝ₊, second-order, rolling and their duals.

    Measured: `natural` = ‖x − P_K(x − w)‖/‖q‖, and `unit_free`, the same with x over max(‖x‖∞, ‖q‖∞/max|M|) and
    w over max(‖q‖∞, ‖Mx‖∞), both over components where K is more than {0}: elsewhere w may be anything.
    """

    node: ClassVar[str] = "soclcp"
    title: ClassVar[str] = "second-order cone linear complementarity problem"
    equation: ClassVar[str] = "(17)"
    relations: ClassVar[tuple[str, ...]] = ("K ∋ x ⟂ w = Mx + q ∈ K*",)
    point_type: ClassVar[type[Point]] = SOCLCPPoint
    terms: ClassVar[tuple[Term, ...]] = (("q", 1, "M", "x"),)
    cone_rows: ClassVar[str] = "q"

    M: Matrix = matrix_field("n", "n")
    q: Vector = vector_field("n")
    cone_kind: Vector = vector_field("k")
    cone_size: Vector = vector_field("k")
    cone_mu: Vector = vector_field("k", finite=False)
    cone_mu_r: Vector = vector_field("k", fill=0.0)

    def check(self) -> None:
        super().check()
        if not self.K.conical:
            raise ProblemError("soclcp.cone_kind", "has a cylinder ℝ₊ × disk, which is not a cone; use coneqp")

    def slacks(self, point: SOCLCPPoint) -> dict[str, Vector]:
        return {"w": self.M @ point.x + self.q}

    def measure(self, point: SOCLCPPoint, tolerance: float) -> Residuals:
        x, Mx = point.x, self.M @ point.x
        w = Mx + self.q
        natural = norm(cone_defect(self.K, x, w))
        measured = {"natural": scaled(natural, norm(self.q))}
        active = self.K.extended
        q_size = max_abs(self.q[active])
        if q_size > 0:
            x_scale = max(max_abs(x), q_size / (max_abs(self.M) or 1.0))
            measured["unit_free"] = cone_residuals(self.K, x, w, x_scale, max(q_size, max_abs(Mx[active])))
        return Residuals(
            measured=measured,
            parts={
                "natural_absolute": natural,
                "cone_violation": norm(x - self.K.project(x)),
                "dual_violation": norm(w - self.K.project_dual(w)),
                "complementarity": abs(float(x @ w)),
            },
            flags=() if self.q.any() else ("absolute",),
        )


@dataclass(frozen=True, eq=False)
class ConeQPPoint(Point):
    """x, shape (n,), and the multiplier y of Ax + b ∈ K, shape (m,)."""

    x: Vector = point_field("n")
    y: Vector = point_field("m")


@formulations.register("coneqp")
@dataclass(frozen=True, eq=False, kw_only=True)
class ConeQP(ConicProblem):
    """min ½xᵀQx + pᵀx subject to s = Ax + b ∈ K, Q symmetric; Qx + p = Aᵀy, K ∋ s ⟂ y ∈ K*.

    K may have factors ℝ₊ × disk, which are convex and no cones; there the conditions are −y ∈ N_K(s), of which
    s = P_K(s − y) is the general form. Measured: `natural` = ‖(Qx + p − Aᵀy, s − P_K(s − y))‖/‖(p, b)‖; `stationarity`
    = ‖Qx + p − Aᵀy‖/max(‖Qx‖, ‖p‖, ‖Aᵀy‖, max|Q| x_unit); `unit_free`, the cone part with every factor (every row
    of ℝ₊) divided by its largest entry in A, then s over max(|b|, ‖x‖∞, x_unit) of the factor and y over forces =
    max(‖p‖∞, ‖Qx‖∞, max|Q| x_unit): neither a large b of an idle factor nor large multipliers that cancel may set a
    scale. When Q
    is not positive semidefinite, the flag `stationary` says that these conditions are not sufficient.
    """

    node: ClassVar[str] = "coneqp"
    title: ClassVar[str] = "cone quadratic program"
    equation: ClassVar[str] = "(1) over a cone"
    relations: ClassVar[tuple[str, ...]] = ("min ½xᵀQx + pᵀx", "Ax + b ∈ K")
    point_type: ClassVar[type[Point]] = ConeQPPoint
    primal: ClassVar[str] = "x"
    terms: ClassVar[tuple[Term, ...]] = (("p", 1, "Q", "x"), ("p", -1, "Aᵀ", "y"), ("b", 1, "A", "x"))
    cone_rows: ClassVar[str] = "b"

    Q: Matrix = matrix_field("n", "n")
    p: Vector = vector_field("n")
    A: Matrix = matrix_field("m", "n")
    b: Vector = vector_field("m", fill=0.0)
    cone_kind: Vector = vector_field("k")
    cone_size: Vector = vector_field("k")
    cone_mu: Vector = vector_field("k", finite=False)
    cone_mu_r: Vector = vector_field("k", fill=0.0)

    @classmethod
    def over(cls, Q: Matrix, p: Vector, K: ProductCone, A: Matrix | None = None, b: Vector | None = None) -> ConeQP:
        """Return the program with K given as a product; A = I and b = 0 unless given."""
        if A is None:
            A = matrices.identity(np.size(p), Q)
        return cls(Q=Q, p=p, A=A, b=b, **cone_fields(K))  # pyright: ignore[reportArgumentType]

    def check(self) -> None:
        super().check()
        if not matrices.is_symmetric(self.Q, 1e-10):
            raise ProblemError(
                "coneqp.Q", f"is not symmetric, asymmetry = {matrices.asymmetry(self.Q):.1e}; use soclcp"
            )

    @cached_property
    def convex(self) -> bool:
        """Q positive semidefinite (matrices.is_psd)."""
        return matrices.is_psd(self.Q)

    @cached_property
    def plain(self) -> bool:
        """A = I and b = 0: x itself is in K."""
        if self.A.shape[0] != self.A.shape[1] or self.b.any():
            return False
        return matrices.max_abs(self.A - matrices.identity(self.p.size, self.A)) == 0.0

    @cached_property
    def block_sizes(self) -> Vector:
        """max|A| over the rows of each factor, 1 where that is 0; shape (m,)."""
        return freeze(row_sizes(self.A, self.K.blocks))

    @cached_property
    def block_data(self) -> Vector:
        """max|b| over each factor and its size: the x that it asks for; shape (m,)."""
        if not self.b.size:
            return self.b
        return freeze(group_max(self.b, self.K.blocks)[self.K.blocks] / self.block_sizes)

    @cached_property
    def x_unit(self) -> float:
        """The lesser of ‖p‖∞/max|Q|, an x that balances p, and the x that b asks for; 0 without any."""
        bounded = np.repeat(self.K.kind != Cone.FREE, self.K.size.astype(np.int64))
        return least(ratio(max_abs(self.p), max_abs(self.Q)), max_abs(self.block_data[bounded]))

    def objective(self, x: Vector) -> float:
        return float(0.5 * x @ (self.Q @ x) + self.p @ x)

    def slacks(self, point: ConeQPPoint) -> dict[str, Vector]:
        return {"s": self.A @ point.x + self.b}

    def measure(self, point: ConeQPPoint, tolerance: float) -> Residuals:
        x, y = point.x, point.y
        Qx, Aty = self.Q @ x, self.A.T @ y
        s = self.A @ x + self.b
        stationarity = Qx + self.p - Aty
        cone_part = norm(cone_defect(self.K, s, y))
        natural = norm(np.array([norm(stationarity), cone_part]))
        if not point.finite:  # which a projection would clip
            natural = np.inf
        data = norm(np.concatenate([self.p, self.b]))
        measured = {"natural": scaled(natural, data)}
        balance = max(norm(self.p), max_abs(self.Q) * self.x_unit)
        if balance > 0:
            measured["stationarity"] = norm(stationarity) / max(norm(Qx), norm(Aty), balance)
        if self.x_unit > 0:
            forces = max(max_abs(self.p), max_abs(Qx), max_abs(self.Q) * self.x_unit) or 1.0
            s_scale = np.maximum(self.block_data, max(max_abs(x), self.x_unit)) * self.block_sizes
            measured["unit_free"] = cone_residuals(self.K, s, y, s_scale, forces / self.block_sizes)
        return Residuals(
            measured=measured,
            parts={
                "natural_absolute": natural,
                "stationarity_absolute": norm(stationarity),
                "cone_violation": norm(s - self.K.project(s)),
                "complementarity": abs(float(s @ y)),
                "objective": self.objective(x),
            },
            flags=(("absolute",) if data == 0 else ()) + (() if self.convex else ("stationary",)),
        )
