"""Nonlinear programs of any size: convex ones made for their solution and multipliers, and chained Rosenbrock
functions."""

from __future__ import annotations

import itertools

import numpy as np

from cpbench.formulations.programs import NLP, NLPPoint
from cpbench.generators.base import Instance, collection, dyadic, generator
from cpbench_problems.generators.symbols import mapped, product, total, unknowns

CITATION = "Toint 1978, Math. Comp. 32:839 (chained Rosenbrock); planted by cpbench"

INSIDE = np.array([[2.0, -1, -2], [1, 2, 2], [-2, 2, 1], [2, 2, -1]])
"""Points of length 3, for the centres of blocks of three unknowns."""


@collection(
    "nlp-planted",
    "nlp",
    "convex programs with quartic objective, balls and equations, and chained Rosenbrock functions",
    "Toint 1978, Math. Comp. 32:839 (chained Rosenbrock); planted by cpbench",
)
def build() -> list[Instance]:
    return [*(balls(count) for count in (10, 14, 20, 30)), *(rosenbrock(n) for n in (30, 60))]


@collection("nlp-planted-large", "nlp", "the same with up to 10⁴ unknowns", CITATION, tier="standard")
def build_large() -> list[Instance]:
    convex = [balls(count) for count in (400, 700, 1000, 2000, 3000)]
    return [*convex, *(rosenbrock(n) for n in (1000, 2000, 5000, 10_000))]


def balls(count: int) -> Instance:
    """Minimise ½zᵀTz + ¼Σz⁴ + pᵀz, T = tridiag(−1, 3, −1), over `count` balls in ℝ³ (9 − |z|² ≥ 0), with an equation
    for every fifth pair of neighbours; half of the balls are active."""
    rng = generator(2900 + count)
    n = 3 * count
    z = INSIDE[rng.integers(0, 4, count)]
    active = np.arange(count) % 2 == 0
    z = np.where(active[:, None], z, z / 2.0).ravel()
    lam = np.where(active, dyadic(rng, count, 0, 2) + 0.125, 0.0)
    pairs = range(2, n - 1, 15)
    mu = dyadic(rng, len(pairs), -2, 2)
    beside = np.pad(z, 1)
    slope = 3.0 * z - beside[:-2] - beside[2:] + z**3
    p = -2.0 * np.repeat(lam, 3) * z - slope
    for k, i in enumerate(pairs):
        p[[i, i + 1]] += mu[k]
    x = unknowns(n)
    squares = total(1.5 * s**2 + 0.25 * s**4 for s in x)
    f = squares - total(a * b for a, b in itertools.pairwise(x)) + product(p[None, :], x)[0]
    y, v = unknowns(n), unknowns(n)
    problem = NLP(
        f=mapped(x, [f]),
        g=mapped(y, [9.0 - total(s**2 for s in y[k : k + 3]) for k in range(0, n, 3)]),
        h=mapped(v, [v[i] + v[i + 1] - float(z[i] + z[i + 1]) for i in pairs]),
        convex=True,
        name=f"balls-{count}",
    )
    point = NLPPoint(z=z, lam=lam, mu=mu, nu=np.zeros(n))
    value = float(1.5 * (z**2).sum() + 0.25 * (z**4).sum() - z[:-1] @ z[1:] + p @ z)
    return Instance(problem, point, "planted", properties={"class": "convex", "objective": value})


def rosenbrock(n: int) -> Instance:
    """Minimise Σ 100(zᵢ₊₁ − zᵢ²)² + (1 − zᵢ)² from (−1.2, 1, −1.2, …): the minimum is 0, at (1, …, 1)."""
    x = unknowns(n)
    f = total(100.0 * (b - a**2) ** 2 + (1.0 - a) ** 2 for a, b in itertools.pairwise(x))
    start = np.where(np.arange(n) % 2 == 0, -1.2, 1.0)
    problem = NLP(f=mapped(x, [f]), start=start, name=f"chained-rosenbrock-{n}")
    none = np.zeros(0)
    points = [NLPPoint(z=z, lam=none, mu=none, nu=np.zeros(n)) for z in (np.ones(n), start)]
    facts = {"class": "not known to be convex", "objective": 0.0}
    return Instance(problem, points[0], "closed form", None, facts, (points[1],))
