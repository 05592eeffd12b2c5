"""Variational inequalities over every kind of set: those that carry a name, and planted ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations.conic import cone_fields
from cpbench.formulations.expressions import Map
from cpbench.formulations.variational import VI, VIPoint
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import Instance, collection, dyadic, generator
from cpbench_problems.generators.affine_inequalities import tridiagonal
from cpbench_problems.generators.ncp_classics import formula_map, kojima_shindo_map
from cpbench_problems.generators.symbols import Symbol, mapped, product, total, unknowns

BASIN = (21.14479601540966, 16.027853447025258, 2.7259627008817033)
"""Normalized equilibrium of the river basin, published as 21.149, 16.028, 2.722; digits by exact fractions."""
BASIN_PRICE = 0.5743599993552443
"""Of the first limit, published as 0.574."""


@collection(
    "vi-classics",
    "vi",
    "VIs that carry a name, over simplices, a polyhedron and an ellipsoid",
    "Solodov and Svaiter 1999, SIAM J. Control Optim. 37:765 (Kojima–Shindo and Mathiesen over polyhedra); Fukushima "
    "1986, Math. Prog. 35:58; Krawczyk and Uryasev 2000, Environ. Model. Assess. 5:63 (river basin)",
)
def build() -> list[Instance]:
    return [kojima_shindo_simplex(), mathiesen_polyhedron(), fukushima(), river_basin()]


@collection(
    "vi-planted",
    "vi",
    "cubic monotone VIs over boxes, polyhedra, balls, second-order cones and products of them",
    "planted by cpbench",
)
def build_planted() -> list[Instance]:
    first = [box(12), polyhedron(20, 8, 3), balls(5), cones(6), product_set(4)]
    more = [box(30), polyhedron(30, 12, 4), balls(10), cones(10), product_set(8)]
    return [*first, *more]


@collection("vi-planted-large", "vi", "cubic monotone VIs of up to 10⁵ unknowns", "planted by cpbench", tier="standard")
def build_planted_large() -> list[Instance]:
    dense = [box(150), box(300), polyhedron(150, 40, 10), balls(60), cones(60), product_set(60)]
    middle = [box(1000, sparse=True), balls(500, sparse=True), cones(700, sparse=True), product_set(900, sparse=True)]
    large = [box(6000, sparse=True), balls(2000, sparse=True), cones(3000, sparse=True), box(100_000, sparse=True)]
    return [*dense, *middle, *large]


def kojima_shindo_simplex() -> Instance:
    """Build the VI over {z ≥ 0, Σz = 4}, which holds the regular solution (1, 0, 3, 0) of the complementarity
    problem.
    """
    starts = tuple(VIPoint(z=np.array(z, dtype=float), mu=np.zeros(1)) for z in ((1, 1, 1, 1), (0, 0, 0, 4)))
    problem = VI(
        F=kojima_shindo_map(), lb=np.zeros(4), C=np.ones((1, 4)), d=np.array([4.0]), start=starts[0].z,
        name="kojima-shindo-simplex",
    )  # fmt: skip
    solution = VIPoint(z=np.array([1.0, 0, 3, 0]), mu=np.zeros(1))
    return Instance(problem, solution, "published", None, {"class": "not monotone"}, starts)


def mathiesen_polyhedron() -> Instance:
    """Build Mathiesen's market over {p ≥ 0, Σp = 1, p₁ ≤ p₂ + p₃}: the multiplier of the last is the activity, 3."""

    def F(p: list[Symbol]) -> list[Any]:
        income = 5.0 * p[1] + 3.0 * p[2]
        return [0.0 - 0.9 * income / p[0], 5.0 - 0.1 * income / p[1], 3.0]

    problem = VI(
        F=formula_map(3, F), lb=np.zeros(3), A=np.array([[-1.0, 1, 1]]), b=np.zeros(1), C=np.ones((1, 3)), d=np.ones(1),
        start=np.array([0.25, 0.5, 0.25]), name="mathiesen-polyhedron",
    )  # fmt: skip
    solution = VIPoint(z=np.array([6.0, 1, 5]) / 12.0, lam=np.array([3.0]), mu=np.zeros(1))
    return Instance(problem, solution, "published", properties={"class": "not defined at p1 = 0 or p2 = 0"})


def fukushima() -> Instance:
    """Build the VI over {1 − z₁² − 0.4z₂² − 0.6z₃² ≥ 0}: z = (1, 0, 0), ν = 0.9."""

    def F(z: list[Symbol]) -> list[Symbol]:
        a, b, c = z
        return [
            2.0 * a + 0.2 * a**3 - 0.5 * b + 0.1 * c - 4.0,
            b + 0.1 * b**3 - 0.5 * a + 0.5,
            0.5 * a - 0.2 * b + 2.0 * c - 0.5,
        ]

    g = formula_map(3, lambda z: [1.0 - z[0] ** 2 - 0.4 * z[1] ** 2 - 0.6 * z[2] ** 2])
    problem = VI(F=formula_map(3, F), g=g, name="fukushima")
    return Instance(
        problem, VIPoint(z=[1.0, 0, 0], nu=[0.9]), "published", properties={"class": "strongly monotone", "set": "g"}
    )


def river_basin() -> Instance:
    """Build three polluters with two common limits: the equilibrium at which the limits have one price for all."""
    linear, square = (0.10, 0.12, 0.15), (0.01, 0.05, 0.01)
    emission = np.array([0.5, 0.25, 0.75])
    reach = np.array([[6.5, 5.0, 5.5], [4.583, 6.25, 3.75]])

    def F(z: list[Symbol]) -> list[Symbol]:
        all_of_them = 0.01 * total(z)
        return [all_of_them + 0.01 * x + (2.0 * s) * x + (c - 3.0) for x, c, s in zip(z, linear, square, strict=True)]

    problem = VI(F=formula_map(3, F), lb=np.zeros(3), A=-reach * emission, b=np.full(2, -100.0), name="river-basin")
    solution = VIPoint(z=BASIN, lam=[BASIN_PRICE, 0.0])
    return Instance(problem, solution, "published", properties={"class": "affine, strongly monotone"})


# ------------------------------------------------------------------------------------------- planted


def planted_map(z: Vector, value: Vector, rng: np.random.Generator, *, sparse: bool = False) -> Map:
    """Build F(x) = Mx + D x³ + q with F(z) = value, M = LLᵀ/8 + I + skew: strongly monotone, and exact at z.

    `sparse` : M is that of `tridiagonal`.
    """
    n = z.size
    M = tridiagonal(rng, n) if sparse else _dense(rng, n)
    d = dyadic(rng, n, 0, 1, 4) / 8.0
    q = value - M @ z - d * z**3
    x = unknowns(n)
    parts = zip(product(M, x), d.tolist(), x, q.tolist(), strict=True)
    return mapped(x, [row + k * s**3 + c if k else row + c for row, k, s, c in parts])


def _dense(rng: np.random.Generator, n: int) -> Dense:
    L, B = dyadic(rng, (n, n), -1, 1, 2), np.triu(dyadic(rng, (n, n), -1, 1, 4), 1)
    return L @ L.T / 8.0 + np.eye(n) + B - B.T


def sized_name(kind: str, count: int, *, sparse: bool) -> str:
    """Return the name of a problem; those with a sparse map begin with `sparse`."""
    return f"sparse-{kind}-{count}" if sparse else f"{kind}-{count}"


def _planted(problem: VI, solution: VIPoint, kind: str) -> Instance:
    return Instance(problem, solution, "planted", properties={"class": "strongly monotone", "set": kind})


def sides(rng: np.random.Generator, n: int) -> tuple[Vector, Vector]:
    """Draw z in [−1, 2]ⁿ and the value of F there: positive at the lower bound, negative at the upper, 0 between."""
    side, size = rng.integers(-1, 2, n), dyadic(rng, n, 1, 2)
    return np.select([side < 0, side > 0], [-1.0, 2.0], size - 1.0), -side * size


def box(n: int, *, sparse: bool = False) -> Instance:
    rng = generator(n)
    z, w = sides(rng, n)
    F = planted_map(z, w, rng, sparse=sparse)
    problem = VI(F=F, lb=np.full(n, -1.0), ub=np.full(n, 2.0), name=sized_name("box", n, sparse=sparse))
    return _planted(problem, VIPoint(z=z), "box")


def polyhedron(n: int, m: int, k: int) -> Instance:
    """Build n unknowns in a box, m inequalities, half of them active, and k equations."""
    rng = generator(100 + n)
    z, w = sides(rng, n)
    A, C = dyadic(rng, (m, n), -1, 1, 2), dyadic(rng, (k, n), -1, 1, 2)
    active = np.arange(m) % 2 == 0
    lam, slack = np.where(active, dyadic(rng, m, 1, 2), 0.0), np.where(active, 0.0, dyadic(rng, m, 1, 2))
    mu = dyadic(rng, k, -2, 2)
    problem = VI(
        F=planted_map(z, w + A.T @ lam + C.T @ mu, rng), lb=np.full(n, -1.0), ub=np.full(n, 2.0), A=A, b=A @ z - slack,
        C=C, d=C @ z, name=f"polyhedron-{n}-{m}-{k}",
    )  # fmt: skip
    return _planted(problem, VIPoint(z=z, lam=lam, mu=mu), "polyhedron")


BOUNDARY = np.array([[3.0, 4, 0], [0, -3, 4], [-4, 0, 3], [2, -1, -2], [-1, 2, 2]])
"""Vectors of whole length: 5, 5, 5, 3, 3."""


def balls(count: int, *, sparse: bool = False) -> Instance:
    """Build balls in ℝ³, every third solution inside."""
    rng = generator(200 + count)
    z = BOUNDARY[np.arange(count) % 5]
    inside = np.arange(count) % 3 == 2
    radius = np.sqrt((z**2).sum(axis=1)) * np.where(inside, 2.0, 1.0)
    w = -z * np.where(inside, 0.0, dyadic(rng, count, 1, 2))[:, None]
    K = ProductCone.of((Cone.BALL, count, 3, radius))
    F = planted_map(z.ravel(), w.ravel(), rng, sparse=sparse)
    problem = VI(F=F, **cone_fields(K), name=sized_name("balls", count, sparse=sparse))
    return _planted(problem, VIPoint(z=z.ravel()), "balls")


def on_cones(rng: np.random.Generator, count: int) -> tuple[Vector, Vector, Vector]:
    """Draw (x, y, μ) with K_μ ∋ x ⟂ y ∈ K*_μ in ℝ³: both on the boundary, x inside, x = 0 and y inside, by turns."""
    T = np.array([[3.0, 4], [-4, 3], [4, -3], [-3, -4]])[np.arange(count) % 4]
    mu = np.array([0.5, 1.0, 2.0])[rng.integers(0, 3, count)]
    scale = dyadic(rng, (2, count), 1, 2)
    x = np.column_stack([5.0 / mu * scale[0], T * scale[0][:, None]])
    y = np.column_stack([5.0 * mu * scale[1], -T * scale[1][:, None]])
    kind = np.arange(count) % 3
    x[kind == 1, 0] *= 2.0
    y[kind == 1] = 0.0
    x[kind == 2] = 0.0
    y[kind == 2, 0] *= 2.0
    return x.ravel(), y.ravel(), mu


def cones(count: int, *, sparse: bool = False) -> Instance:
    """Build second-order cones in ℝ³ with μ = ½, 1 or 2."""
    rng = generator(300 + count)
    x, y, mu = on_cones(rng, count)
    K = ProductCone.of((Cone.SECOND_ORDER, count, 3, mu))
    problem = VI(
        F=planted_map(x, y, rng, sparse=sparse), **cone_fields(K), name=sized_name("cones", count, sparse=sparse)
    )
    return _planted(problem, VIPoint(z=x), "second-order cones")


def product_set(count: int, *, sparse: bool = False) -> Instance:
    """Build bounded free components beside an orthant, second-order cones and a ball, with one equation through all."""
    rng = generator(400 + count)
    z, w = sides(rng, 4)
    positive, size = np.arange(4) % 2 == 0, dyadic(rng, 4, 1, 2)
    x, y, mu = on_cones(rng, count)
    at = np.concatenate([z, np.where(positive, size, 0.0), x, BOUNDARY[3]])
    value = np.concatenate([w, np.where(positive, 0.0, size), y, -0.5 * BOUNDARY[3]])
    K = ProductCone.of(
        (Cone.FREE, 1, 4), (Cone.NONNEGATIVE, 1, 4), (Cone.SECOND_ORDER, count, 3, mu), (Cone.BALL, 1, 3, 3.0)
    )
    C = dyadic(rng, (1, at.size), -1, 1, 2)
    free = np.arange(at.size) < 4
    problem = VI(
        F=planted_map(at, value + 0.5 * C[0], rng, sparse=sparse), C=C, d=C @ at, lb=np.where(free, -1.0, -np.inf),
        ub=np.where(free, 2.0, np.inf), **cone_fields(K), name=sized_name("product", count, sparse=sparse),
    )  # fmt: skip
    return _planted(problem, VIPoint(z=at, mu=[0.5]), "product")
