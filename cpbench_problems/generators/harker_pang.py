"""Harker and Pang's random monotone problems with a nonlinear part, d_j·arctan z_j in every component."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.expressions import Map, Operator
from cpbench.formulations.nonlinear import NCP, NCPPoint
from cpbench.formulations.variational import VI, VIPoint
from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import Instance, collection, dyadic, generator
from cpbench_problems.generators.symbols import arctan, mapped, product, unknowns

CITATION = (
    "Harker and Pang 1990, Lectures in Applied Mathematics 26:265; Taji, Fukushima, Ibaraki 1993, Math. Prog. 58:369 "
    "(arctan); planted by cpbench"
)


@collection("harker-pang", "ncp", "random monotone NCPs with arctan", CITATION)
def build() -> list[Instance]:
    return [complementarity(n) for n in (10, 50, 30)]


@collection("harker-pang-sets", "vi", "random monotone maps with arctan over a simplex and a box", CITATION)
def build_sets() -> list[Instance]:
    return [simplex(10), simplex(40), box(20)]


@collection("harker-pang-large", "ncp", "a dense random monotone NCP with arctan", CITATION, tier="standard")
def build_large() -> list[Instance]:
    return [complementarity(300)]


class _Monotone:
    """F(z) = Mz + D arctan z + q, M = AAᵀ/n + B + diag, B skew; q follows from what F is to be at z."""

    def __init__(self, n: int, seed: int) -> None:
        self.n, self.rng = n, generator(seed)
        A, B = dyadic(self.rng, (n, n), -5, 5, 1), dyadic(self.rng, (n, n), -5, 5, 1)
        diagonal = np.diag(dyadic(self.rng, n, 0, 1))
        self.M: Dense = (A @ A.T + np.triu(B, 1) - np.triu(B, 1).T) / 2.0 ** np.ceil(np.log2(n)) + diagonal
        self.d = dyadic(self.rng, n, 1, 8)

    def map(self, z: Vector, value: Vector) -> Map:
        """Return F with F(z) = value, to the last digits of arctan."""
        q = value - self.M @ z - self.d * arctan(z)
        x = unknowns(self.n)
        linear = product(self.M, x)
        parts = zip(linear, self.d.tolist(), x, q.tolist(), strict=True)
        return mapped(x, [row + d * s.apply(Operator.ATAN) + c for row, d, s, c in parts])


def complementarity(n: int) -> Instance:
    """Build 0 ≤ z ⟂ F(z) ≥ 0; a tenth of the components is degenerate, zᵢ = Fᵢ = 0."""
    drawn = _Monotone(n, n)
    size = dyadic(drawn.rng, n, 1, 8)
    kind = drawn.rng.integers(0, 10, n)
    z, w = np.where(kind < 5, size, 0.0), np.where(kind > 5, size, 0.0)
    problem = NCP(F=drawn.map(z, w), name=f"harker-pang-{n}")
    facts = {"class": "strongly monotone", "degenerate": int((kind == 5).sum())}
    return Instance(problem, NCPPoint(z=z), "planted to rounding", properties=facts)


def simplex(n: int) -> Instance:
    """Build the VI over {z ≥ 0, Σz = d}, from the barycentre: F(z) = w + μ, 0 ≤ z ⟂ w ≥ 0."""
    drawn = _Monotone(n, 1000 + n)
    size = dyadic(drawn.rng, n, 1, 4)
    used = drawn.rng.integers(0, 3, n) > 0
    z, w = np.where(used, size, 0.0), np.where(used, 0.0, size)
    problem = VI(
        F=drawn.map(z, w - 2.5), lb=np.zeros(n), C=np.ones((1, n)), d=np.array([z.sum()]),
        start=np.full(n, z.sum() / n), name=f"harker-pang-simplex-{n}",
    )  # fmt: skip
    point = VIPoint(z=z, mu=np.array([-2.5]))
    return Instance(problem, point, "planted to rounding", properties={"class": "strongly monotone"})


def box(n: int) -> Instance:
    """Build the VI over [−2, 3]ⁿ: a third of the components at either bound."""
    drawn = _Monotone(n, 2000 + n)
    size = dyadic(drawn.rng, n, 1, 2)
    side = drawn.rng.integers(-1, 2, n)
    z = np.select([side < 0, side > 0], [-2.0, 3.0], size - 1.5)
    problem = VI(
        F=drawn.map(z, -side * size), lb=np.full(n, -2.0), ub=np.full(n, 3.0), name=f"harker-pang-box-{n}"
    )  # fmt: skip
    return Instance(problem, VIPoint(z=z), "planted to rounding", properties={"class": "strongly monotone"})
