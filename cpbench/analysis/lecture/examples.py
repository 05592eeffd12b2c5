"""The small problems of the lecture page, two to six unknowns each, so that every one can be written out.

The QP, NLP and contact problems keep their letters over several sections: what one section solves, the next converts.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cpbench.formulations.afc import AnisotropicFrictionContact
from cpbench.formulations.avi import AVI
from cpbench.formulations.base import Problem
from cpbench.formulations.coneqp import ConeQP
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.grfc import GlobalRollingFrictionContact
from cpbench.formulations.lcp import LCP
from cpbench.formulations.mlcp import MLCP
from cpbench.formulations.qp import QP
from cpbench.formulations.relay import Relay
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.formulations.soclcp import SOCLCP
from cpbench.matrices import Dense, Vector
from cpbench.product_cones import Cone, ProductCone

GRAVITY, STEP = 9.81, 0.01
"""Acceleration [m/s²] and time step [s] of the dumbbell."""


def problems() -> dict[str, Problem]:
    """Every problem by its name in the file that goes with the page."""
    made = {
        "qp": quadratic(),
        "qp-repeated": repeated_row(),
        "lcp": symmetric(),
        "lcp-nonsymmetric": nonsymmetric(),
        "lcp-three": three_solutions(),
        "mlcp": mixed(),
        "mlcp-singular": singular(),
        "soclcp": over_cone(),
        "coneqp": program_over_cone(),
        "avi": triangle(),
        "avi-box": box(),
        "relay": relay(),
        "sliding": sliding(),
        "plane": plane(),
        "dumbbell": dumbbell(),
        "frictionless": frictionless(),
        "frictionless-local": frictionless_local(),
        "anisotropic": anisotropic(),
        "rolling": rolling(),
        "rolling-plane": rolling_plane(),
        "rolling-global": rolling_global(),
    }
    return {name: dataclasses.replace(problem, name=name) for name, problem in made.items()}


def quadratic() -> QP:
    """Two unknowns, two inequalities of which one is active, one equality."""
    return QP.build(
        np.array([[3.0, 1.0], [1.0, 2.0]]),
        np.array([-6.0, -5.0]),
        np.array([[-1.0, -1.0], [1.0, 0.0]]),
        np.array([-2.0, 0.0]),
        np.array([[1.0, -0.5]]),
        np.array([0.25]),
    )


def repeated_row() -> QP:
    """The same, its active inequality written twice: A has not full rank."""
    qp = quadratic()
    return QP.build(qp.Q, qp.p, np.array([[-1.0, -1.0], [-1.0, -1.0]]), np.array([-2.0, -2.0]), qp.C, qp.d)


def symmetric() -> LCP:
    """M symmetric positive definite; one of Cottle, Pang and Stone's first examples."""
    return LCP(M=np.array([[2.0, 1.0], [1.0, 2.0]]), q=np.array([-5.0, -6.0]))


def nonsymmetric() -> LCP:
    """M positive definite, not symmetric."""
    return LCP(M=np.array([[2.0, -1.0], [3.0, 2.0]]), q=np.array([-2.0, 1.0]))


def three_solutions() -> LCP:
    """M symmetric, copositive and no P-matrix: det M < 0."""
    return LCP(M=np.array([[1.0, 2.0], [2.0, 1.0]]), q=np.array([-1.0, -1.0]))


def mixed() -> MLCP:
    """Two free unknowns, two complementary ones, A nonsingular."""
    return MLCP(
        A=np.array([[2.0, 1.0], [-1.0, 2.0]]),
        B=np.array([[3.0, 0.0], [1.0, 2.0]]),
        C=np.array([[-1.0, 0.0], [0.0, 1.0]]),
        D=np.array([[1.0, 0.0], [0.0, -1.0]]),
        a=np.array([-1.0, 2.0]),
        b=np.array([-4.0, 1.0]),
    )


def singular() -> MLCP:
    """A resistor between two nodes, a diode from the first one to ground, a current source at each.

    u are the potentials, v the current of the diode, which conducts at 0.7 V. Without the diode nothing fixes the
    potentials: A is singular.
    """
    return MLCP(
        A=np.array([[1.0, -1.0], [-1.0, 1.0]]),
        B=np.zeros((1, 1)),
        C=np.array([[1.0], [0.0]]),
        D=np.array([[-1.0, 0.0]]),
        a=np.array([-0.25, -1.0]),
        b=np.array([0.7]),
    )


def over_cone() -> SOCLCP:
    """One second-order cone in three dimensions."""
    K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0))
    M = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.25], [0.0, 0.25, 1.5]])
    return SOCLCP(M=M, q=np.array([-1.0, 1.5, -0.5]), **cone_fields(K))  # pyright: ignore[reportArgumentType]


def program_over_cone() -> ConeQP:
    """The same data as a program: its gradient is the affine map."""
    problem = over_cone()
    return ConeQP.over(problem.M, problem.q, problem.K)


def triangle() -> AVI:
    """A rotation plus a spring over a triangle: M is not symmetric, no objective has this gradient."""
    return AVI(
        M=np.array([[1.0, -1.0], [1.0, 1.0]]),
        q=np.array([-3.0, -1.5]),
        A=np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]]),
        b=np.array([0.0, 0.0, -2.0]),
    )


def box() -> AVI:
    """A symmetric map over a rectangle."""
    return AVI(
        M=np.array([[2.0, -1.0], [-1.0, 2.0]]),
        q=np.array([-3.0, 0.5]),
        lb=np.array([0.0, -1.0]),
        ub=np.array([1.0, 1.0]),
    )


def relay() -> Relay:
    """Two switches between −1 and 1; the second one holds in between."""
    return Relay(
        M=np.array([[1.0, 0.5], [-0.5, 1.0]]), q=np.array([-2.0, 0.25]), lb=np.full(2, -1.0), ub=np.full(2, 1.0)
    )


def sliding() -> FrictionContact:
    """One contact that slides fast, away from the vertices of a square and an octagon."""
    W = np.array([[1.0, 0.2, 0.1], [0.2, 1.2, 0.0], [0.1, 0.0, 0.9]])
    return FrictionContact(W=W, q=np.array([-1.0, 3.0, 1.6]), mu=np.array([0.6]))


def plane() -> FrictionContact:
    """Two contacts in the plane under one body: one slides, one opens."""
    W = np.array([[1.5, 0.2, 0.5, 0.1], [0.2, 1.0, -0.1, 0.8], [0.5, -0.1, 1.5, -0.2], [0.1, 0.8, -0.2, 1.0]])
    return FrictionContact(W=W, q=np.array([-1.0, 0.8, 1.0, 0.8]), mu=np.array([0.5, 0.5]), dimension=2)


def dumbbell() -> GlobalFrictionContact:
    """Two balls on a floor joined by a rigid rod along x, one of which is pushed.

    Velocities (x, y, z) of both; a contact has the rows (N, T1, T2) = (z, x, y). The joint keeps the distance.
    """
    masses = np.repeat([1.0, 3.0], 3)
    before = np.array([1.2, 0.9, 0.0, 1.2, 0.0, 0.0])
    force = np.array([0.0, 20.0, 0.0, 0.0, 0.0, 0.0]) - GRAVITY * masses * np.tile([0.0, 0.0, 1.0], 2)
    contact = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    return GlobalFrictionContact(
        M=np.diag(masses),
        H=np.kron(np.eye(2), contact),
        G=np.array([[1.0], [0.0], [0.0], [-1.0], [0.0], [0.0]]),
        f=masses * before + STEP * force,
        w=np.zeros(6),
        b=np.zeros(1),
        mu=np.array([0.3, 0.6]),
    )


def frictionless() -> GlobalFrictionContact:
    """The dumbbell on ice."""
    return dataclasses.replace(dumbbell(), mu=np.zeros(2))


def frictionless_local() -> FrictionContact:
    """The plane contacts without friction."""
    return dataclasses.replace(plane(), mu=np.zeros(2))


def anisotropic() -> AnisotropicFrictionContact:
    """A skate: it slides five times as easily along as across."""
    return AnisotropicFrictionContact(W=np.eye(3), q=np.array([-1.0, 1.2, 0.9]), mu=np.array([[0.1, 0.5]]))


def rolling() -> RollingFrictionContact:
    """One contact that slides and rolls: rows (N, T1, T2, M1, M2)."""
    W = np.diag([1.0, 1.0, 1.0, 2.0, 2.0])
    return RollingFrictionContact(
        W=W, q=np.array([-1.0, 1.2, 0.9, 0.8, -0.5]), mu=np.array([0.5]), mu_r=np.array([0.1])
    )


def rolling_plane() -> RollingFrictionContact:
    """The same in the plane: rows (N, T, M)."""
    return RollingFrictionContact(
        W=np.diag([1.0, 1.0, 2.0]), q=np.array([-1.0, 1.2, 0.8]), mu=np.array([0.5]), mu_r=np.array([0.1]), dimension=3
    )


def rolling_global() -> GlobalRollingFrictionContact:
    """A disk of mass 1 and inertia ½ that rolls in the plane: velocities (x, z, ω), rows (N, T, M)."""
    H = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]])
    return GlobalRollingFrictionContact(
        M=np.diag([1.0, 1.0, 0.5]),
        H=H,
        f=np.array([1.0, -GRAVITY * STEP, -0.2]),
        w=np.zeros(3),
        mu=np.array([0.5]),
        mu_r=np.array([0.05]),
        dimension=3,
    )


@dataclass(frozen=True, eq=False)
class NonlinearExample:
    """A mixed complementarity problem (21): the first `free` unknowns are free, the others complementary to F.

    Attributes
    ----------
    source : where it was published. value, jacobian : F and its derivative, (n,) and (n, n).
    solutions : the published ones. start : where methods begin.
    """

    name: str
    source: str
    free: int
    value: Callable[[Vector], Vector]
    jacobian: Callable[[Vector], Dense]
    solutions: tuple[Vector, ...]
    start: Vector

    def residual(self, x: Vector) -> float:
        """‖(F_F, min(z_C, F_C))‖, the natural residual.

        >>> example = kojima_shindo()
        >>> [example.residual(x) < 1e-14 for x in example.solutions]
        [True, True]
        """
        F = self.value(x)
        return float(np.linalg.norm(np.concatenate([F[: self.free], np.minimum(x, F)[self.free :]])))


def kojima_shindo() -> NonlinearExample:
    """Four unknowns, two solutions, the first of them degenerate: x₃ = F₃ = 0."""

    def value(x: Vector) -> Vector:
        a, b, c, d = x
        return np.array(
            [
                3 * a * a + 2 * a * b + 2 * b * b + c + 3 * d - 6,
                2 * a * a + a + b * b + 10 * c + 2 * d - 2,
                3 * a * a + a * b + 2 * b * b + 2 * c + 9 * d - 9,
                a * a + 3 * b * b + 2 * c + 3 * d - 3,
            ]
        )

    def jacobian(x: Vector) -> Dense:
        a, b, _, _ = x
        return np.array(
            [
                [6 * a + 2 * b, 2 * a + 4 * b, 1, 3],
                [4 * a + 1, 2 * b, 10, 2],
                [6 * a + b, a + 4 * b, 2, 9],
                [2 * a, 6 * b, 2, 3],
            ]
        )

    return NonlinearExample(
        "Kojima and Shindo's problem",
        "Kojima and Shindo 1986",
        0,
        value,
        jacobian,
        (np.array([6**0.5 / 2, 0.0, 0.0, 0.5]), np.array([1.0, 0.0, 3.0, 0.0])),
        np.array([1.0, 0.0, 0.0, 0.0]),
    )


def hock_schittkowski_14() -> NonlinearExample:
    """The conditions (12) of min (x − 2)² + (y − 1)², 1 − ¼x² − y² ≥ 0 (λ), x − 2y + 1 = 0 (μ): unknowns x, y, μ, λ.

    The published minimiser is (½(√7 − 1), ¼(√7 + 1)), its objective 9 − 2.875√7.
    """

    def value(t: Vector) -> Vector:
        x, y, mu, lam = t
        return np.array(
            [
                2 * (x - 2) + 0.5 * x * lam - mu,
                2 * (y - 1) + 2 * y * lam + 2 * mu,
                x - 2 * y + 1,
                1 - 0.25 * x * x - y * y,
            ]
        )

    def jacobian(t: Vector) -> Dense:
        x, y, _, lam = t
        return np.array(
            [
                [2 + 0.5 * lam, 0, -1, 0.5 * x],
                [0, 2 + 2 * lam, 2, 2 * y],
                [1, -2, 0, 0],
                [-0.5 * x, -2 * y, 0, 0],
            ]
        )

    x, y = (7**0.5 - 1) / 2, (7**0.5 + 1) / 4
    lam, mu = np.linalg.solve(np.array([[0.5 * x, -1.0], [2 * y, 2.0]]), np.array([-2 * (x - 2), -2 * (y - 1)]))
    return NonlinearExample(
        "Problem 14 of Hock and Schittkowski",
        "Hock and Schittkowski 1981",
        3,
        value,
        jacobian,
        (np.array([x, y, mu, lam]),),
        np.array([2.0, 2.0, 0.0, 0.0]),
    )


def program_14(x: Dense, y: Dense) -> tuple[Dense, Dense, Dense]:
    """f, g and h of problem 14.

    >>> x, y, *_ = hock_schittkowski_14().solutions[0]
    >>> abs(float(program_14(x, y)[0]) - (9 - 2.875 * 7**0.5)) < 1e-14
    True
    """
    return (x - 2) ** 2 + (y - 1) ** 2, 1 - 0.25 * x**2 - y**2, x - 2 * y + 1


def hump() -> NonlinearExample:
    """F(z) = 2 − z²: solutions at 0 and √2, between which min(z, F) has a corner at z = 1."""
    return NonlinearExample(
        "a hump",
        "",
        0,
        lambda z: 2.0 - z * z,
        lambda z: np.diag(-2.0 * z),
        (np.zeros(1), np.full(1, 2**0.5)),
        np.full(1, 1.2),
    )
