"""Small problems of the chapters on nonlinear programs and on nonsmooth equations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cpbench.foundation.matrices import Dense, Vector


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
