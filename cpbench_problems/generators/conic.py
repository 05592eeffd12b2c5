"""Problems over cones with solutions in closed form, and planted ones over products of every kind of factor.

Vectors on the boundary of a cone are made of Pythagorean directions (±3, ±4) and coefficients 5/8 and 5/16, so that
norms are exact.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.conic import SOCLCP, ConeQP, ConeQPPoint, SOCLCPPoint, cone_fields
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import Instance, collection, dyadic, generator
from cpbench_problems.generators.contact_planted import DIRECTIONS

CITATION = "planted by cpbench"

MU, MU_R, RADIUS = 0.625, 0.3125, 5.0


@collection(
    "cone-complementarity",
    "soclcp",
    "complementarity over second-order and rolling cones",
    "Moreau 1962 (decomposition by a cone and its polar); planted by cpbench",
)
def build_soclcp() -> list[Instance]:
    return [
        nearest_in_cone(),
        _planted_soclcp("monotone-12-factors", generator(25)),
        *(chained(k) for k in range(10, 46, 4)),
    ]


@collection(
    "cone-complementarity-large", "soclcp", "chains of up to 30,000 second-order cones", CITATION, tier="standard"
)
def build_large() -> list[Instance]:
    return [chained(k) for k in (400, 600, 1000, 2000, 3000, 30_000)]


@collection(
    "cone-programs",
    "coneqp",
    "second-order cone programs with known solutions and multipliers",
    "Lobo, Vandenberghe, Boyd, Lebret 1998, Linear Algebra Appl. 284:193; planted by cpbench",
)
def build_coneqp() -> list[Instance]:
    planted = [_planted_coneqp(f"planted-13-factors-{n}", generator(2700 + n), n) for n in range(30, 37)]
    return [least_in_ball(), enclosing_ball(), _planted_coneqp("planted-13-factors", generator(27)), *planted]


@collection(
    "cone-programs-large",
    "coneqp",
    "chains of up to 30,000 second-order cones as quadratic programs",
    "planted by cpbench",
    tier="standard",
)
def build_programs_large() -> list[Instance]:
    return [_as_program(chained(k)) for k in (200, 400, 700, 1000, 1500, 3000, 30_000)]


def _as_program(instance: Instance) -> Instance:
    """Return the program min ½xᵀMx + qᵀx over K of a problem with symmetric M: its multiplier is y = Mx + q."""
    problem, point = instance.problem, instance.solution
    assert isinstance(problem, SOCLCP)
    assert isinstance(point, SOCLCPPoint)
    n = problem.q.size
    K = ProductCone.of((Cone.SECOND_ORDER, n // 3, 3, 1.0))
    program = ConeQP.over(problem.M, problem.q, K, sp.csr_array(sp.eye_array(n)), np.zeros(n))
    y = problem.M @ point.x + problem.q
    return Instance(
        replace(program, name=problem.name), ConeQPPoint(x=point.x, y=y), "planted", properties={"class": "SPD"}
    )


def nearest_in_cone() -> Instance:
    """Find the point of {x_N ≥ ‖x_T‖} nearest to (0, 3, 4): half of ‖(3, 4)‖ along (1, 3/5, 4/5)."""
    K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0))
    problem = SOCLCP(M=np.eye(3), q=[0.0, -3.0, -4.0], **cone_fields(K), name="nearest-in-cone")
    return Instance(problem, SOCLCPPoint(x=[2.5, 1.5, 2.0]), "closed form", properties={"class": "SPD"})


def chained(k: int) -> Instance:
    """Build k second-order cones in ℝ³, chained by springs: M = tridiagonal ⊗ I; the solution is inside, at the tip and
    on the boundary by turns."""
    rng = generator(2600 + k)
    direction, size = _ways(rng, k), 2.0 ** rng.integers(-1, 2, k)[:, None]
    x, w = np.hstack([5.0 * size, direction * size]), np.hstack([5.0 * size, -direction * size]) / 4.0
    turn = np.arange(k) % 3
    x[turn == 0, 1:] /= 2.0
    w[turn == 0] = 0.0
    x[turn == 1] = 0.0
    M = sp.kron(sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(k, k)), sp.eye_array(3))
    K = ProductCone.of((Cone.SECOND_ORDER, k, 3, 1.0))
    problem = SOCLCP(M=sp.csr_array(M), q=w.ravel() - M @ x.ravel(), **cone_fields(K), name=f"chained-cones-{k}")
    return Instance(problem, SOCLCPPoint(x=x.ravel()), "planted", properties={"class": "SPD"})


def least_in_ball() -> Instance:
    """Minimise 3x₁ + 4x₂ over ‖x‖ ≤ 5: x = −(3, 4), as s = (5, x) in the cone."""
    K, A = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0)), np.array([[0.0, 0], [1, 0], [0, 1]])
    problem = ConeQP.over(np.zeros((2, 2)), np.array([3.0, 4.0]), K, A, np.array([5.0, 0, 0]))
    return _named(problem, "least-in-ball", ConeQPPoint(x=[-3.0, -4.0], y=[5.0, 3.0, 4.0]), "closed form")


def enclosing_ball() -> Instance:
    """Find the smallest disk around (−4, 0), (4, 0), (0, 3), (1, −2): unknowns (x, radius); the first two are on it."""
    points = np.array([[-4.0, 0], [4, 0], [0, 3], [1, -2]])
    K = ProductCone.of((Cone.SECOND_ORDER, 4, 3, 1.0))
    A = np.tile(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), (4, 1))
    b = np.column_stack([np.zeros(4), -points]).ravel()
    problem = ConeQP.over(np.zeros((3, 3)), np.array([0.0, 0, 1]), K, A, b)
    y = np.concatenate([[0.5, -0.5, 0.0, 0.5, 0.5, 0.0], np.zeros(6)])
    return _named(problem, "enclosing-ball", ConeQPPoint(x=[0.0, 0.0, 4.0], y=y), "closed form")


def _named(problem: ConeQP, name: str, point: ConeQPPoint, known: str, **properties: Any) -> Instance:
    kind = "LP" if not np.any(problem.Q) else "SPD"
    return Instance(replace(problem, name=name), point, known, properties={"class": kind, **properties})


def _planted_soclcp(name: str, rng: np.random.Generator) -> Instance:
    K, x, w = _factors(rng, cylinders=False)
    M = _monotone(rng, K.rows)
    problem = SOCLCP(M=M, q=w - M @ x, **cone_fields(K), name=name)
    return Instance(problem, SOCLCPPoint(x=x), "planted", properties={"class": "PD nonsymmetric"})


def _planted_coneqp(name: str, rng: np.random.Generator, n: int = 15) -> Instance:
    K, s, y = _factors(rng, cylinders=True)
    G, A = dyadic(rng, (n, n), -1, 1), dyadic(rng, (K.rows, n), -1, 1)
    Q, x = G @ G.T + np.eye(n), dyadic(rng, n, -2, 2)
    problem = ConeQP.over(Q, A.T @ y - Q @ x, K, A, s - A @ x)
    return _named(problem, name, ConeQPPoint(x=x, y=y), "planted")


def _monotone(rng: np.random.Generator, n: int) -> Dense:
    G, S = dyadic(rng, (n, n), -1, 1), dyadic(rng, (n, n), -1, 1)
    return G @ G.T + np.eye(n) + np.triu(S, 1) - np.triu(S, 1).T


def _factors(rng: np.random.Generator, *, cylinders: bool) -> tuple[ProductCone, Vector, Vector]:
    """Draw K, s ∈ K and y with −y ∈ N_K(s): inside, at the tip, on the boundary, and with neither."""
    runs: list[tuple[Any, ...]] = [(Cone.FREE, 1, 2), (Cone.ZERO, 1, 2), (Cone.NONNEGATIVE, 1, 4)]
    pairs = [(dyadic(rng, 2, -2, 2), np.zeros(2)), (np.zeros(2), dyadic(rng, 2, -2, 2))]
    pairs.append((np.array([1.5, 0.0, 0.25, 0.0]), np.array([0.0, 2.0, 0.0, 0.0])))
    runs.append((Cone.SECOND_ORDER, 4, 3, MU))
    direction, spin = _ways(rng, 2), _ways(rng, 2)
    pairs += [
        (np.array([8.0, 1.0, -2.0]), np.zeros(3)),
        (np.zeros(3), np.array([4.0, 1.0, 2.0])),
        (np.r_[8.0, direction[0]], np.r_[5 * MU, -direction[0]] / 4),
        (np.zeros(3), np.zeros(3)),
    ]
    runs.append((Cone.ROLLING, 2, 5, MU, MU_R))
    pairs += [
        (np.r_[8.0, direction[1], spin[1] / 2], np.r_[5 * MU + 2.5 * MU_R, -direction[1], -spin[1] / 2]),
        (np.r_[8.0, direction[0] / 2, spin[0] / 2], np.r_[5 * MU_R, 0.0, 0.0, -spin[0]]),
    ]
    runs.append((Cone.ROLLING_DUAL, 1, 5, MU, MU_R))
    pairs.append((np.r_[5 * MU + 5 * MU_R, spin[0], direction[0]], np.r_[8.0, -spin[0], -direction[0] / 2]))
    if cylinders:
        runs.append((Cone.CYLINDER, 2, 3, RADIUS))
        pairs += [
            (np.r_[2.0, direction[1]], np.r_[0.0, -direction[1] / 2]),
            (np.array([0.0, 1.0, -1.0]), np.array([0.5, 0.0, 0.0])),
        ]
    s, y = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return ProductCone.of(*runs), s, y


def _ways(rng: np.random.Generator, count: int) -> Dense:
    return DIRECTIONS[rng.integers(8, size=count)]
