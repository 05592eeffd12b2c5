"""Duals of support vector machines: a dense quadratic program with one equation."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.programs import QP
from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import Instance, collection, dyadic, generator

CITATION = "Cortes and Vapnik 1995, Machine Learning 20:273; points drawn by cpbench"
COST = 1.0
"""Price of a point on the wrong side."""


@collection("support-vectors", "qp", "duals of linear support vector machines", CITATION)
def build() -> list[Instance]:
    return [machine(points, features) for points, features in ((30, 4), (60, 20))]


@collection("support-vectors-large", "qp", "duals of linear support vector machines of 2000 points", CITATION,
            tier="standard")  # fmt: skip
def build_large() -> list[Instance]:
    return [machine(points, features) for points, features in ((500, 30), (2000, 100))]


def data(points: int, features: int) -> tuple[Dense, Vector]:
    """Draw X (points, features) and labels ±1 that a plane separates but for a tenth."""
    rng = generator(1000 + points)
    X, plane = dyadic(rng, (points, features), -1, 1), dyadic(rng, features, -1, 1)
    side = np.where(X @ plane + 0.0625 > 0, 1.0, -1.0)
    return X, np.where(rng.integers(0, 10, points) == 0, -side, side)


def machine(points: int, features: int) -> Instance:
    """Minimise ½|Xᵀ(y∘α)|² − Σα over 0 ≤ α ≤ COST, yᵀα = 0; the matrix has rank `features`."""
    X, y = data(points, features)
    Z = y[:, None] * X
    problem = QP.build(
        Z @ Z.T, -np.ones(points), C=y[None, :], d=np.zeros(1), lb=np.zeros(points), ub=np.full(points, COST),
        name=f"svm-{points}-{features}",
    )  # fmt: skip
    return Instance(problem, properties={"class": "PSD singular", "bounds": True, "rank": features})
