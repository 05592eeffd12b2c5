"""Pairs (a, b) with a = P(a − b), and projections on the factors of a set, one vector at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cpbench.foundation.cones import Cone

Project = Callable[[np.ndarray], np.ndarray]


def identity(x: np.ndarray) -> np.ndarray:
    return x


def box(lower: float, upper: float) -> Project:
    return lambda x: np.minimum(np.maximum(x, lower), upper)


def _ball(x: np.ndarray, radius: float) -> np.ndarray:
    size = np.linalg.norm(x)
    return x if size <= radius else x * (radius / size)


def _friction_cone(x: np.ndarray, parts: list[tuple[slice, float]]) -> np.ndarray:
    """Nearest r with ‖r_c‖ ≤ μ_c r_N: the best of the candidates for r_N, one a set of active constraints."""
    sizes = [float(np.linalg.norm(x[c])) for c, _ in parts]
    candidates = [0.0]
    for active in np.ndindex(*(2,) * len(parts)):
        on = [(size, mu) for size, (_, mu), use in zip(sizes, parts, active, strict=True) if use]
        candidates.append(max(0.0, (x[0] + sum(s * m for s, m in on)) / (1.0 + sum(m * m for _, m in on))))

    def at(normal: float) -> np.ndarray:
        r = x.copy()
        r[0] = normal
        for c, mu in parts:
            r[c] = _ball(x[c], mu * normal)
        return r

    return min(map(at, candidates), key=lambda r: float(np.sum((r - x) ** 2)))


def cone(kind: Cone, size: int, mu: float, mu_r: float) -> Project:
    """Projection on one factor of a product."""
    half = (size - 1) // 2
    if kind is Cone.SECOND_ORDER and np.isinf(mu):
        return lambda x: np.concatenate([np.maximum(x[:1], 0.0), x[1:]])
    moments = [(slice(1, 1 + half), mu), (slice(1 + half, None), mu_r)]
    known: dict[Cone, Project] = {
        Cone.ZERO: np.zeros_like,
        Cone.FREE: identity,
        Cone.NONNEGATIVE: box(0.0, np.inf),
        Cone.SECOND_ORDER: lambda x: _friction_cone(x, [(slice(1, None), mu)]),
        Cone.ROLLING: lambda x: _friction_cone(x, moments),
        Cone.ROLLING_DUAL: lambda x: x + _friction_cone(-x, moments),
        Cone.CYLINDER: lambda x: np.concatenate([np.maximum(x[:1], 0.0), _ball(x[1:], mu)]),
        Cone.BALL: lambda x: _ball(x, mu),
    }
    return known[kind]


@dataclass(frozen=True)
class Pairs:
    """Pairs of a problem at an answer.

    Attributes
    ----------
    a, b : the two parts, one after the other. factors : rows of each factor with its projection.
    x : the unknowns. values : the rows (equations and forces). J : their derivatives with respect to x.
    a_is, b_is : what a part is: unknown k, or k − len(x) a row. multiplier : which unknowns are multipliers of rows.
    """

    a: np.ndarray
    b: np.ndarray
    factors: list[tuple[np.ndarray, Project]]
    x: np.ndarray
    J: np.ndarray
    values: np.ndarray
    a_is: np.ndarray
    b_is: np.ndarray
    multiplier: np.ndarray

    @property
    def constants(self) -> np.ndarray:
        """What is left of the rows without the terms of the unknowns; 0 where it is rounding."""
        left = self.values - self.J @ self.x
        return np.where(np.abs(left) <= 1e-14 * (np.abs(self.J) @ np.abs(self.x)), 0.0, left)

    def sizes(self, *, gross: bool = False) -> np.ndarray:
        """Sum of the sizes of the terms of every row; the terms of multipliers are added first unless `gross`."""
        one_term = self.multiplier & (not gross)
        net = np.abs(self.J[:, one_term] @ self.x[one_term])
        return np.abs(self.J[:, ~one_term]) @ np.abs(self.x[~one_term]) + net + np.abs(self.constants)

    def defects(self, unit_a: np.ndarray | float = 1.0, unit_b: np.ndarray | float = 1.0) -> np.ndarray:
        """‖Ea − P(Ea − b/s)‖ of every factor, E and 1/s constant on a factor; sets are scaled with a."""
        E, S = (np.broadcast_to(np.asarray(u, float), self.a.shape) for u in (unit_a, unit_b))
        result = np.zeros(len(self.factors))
        for k, (rows, project) in enumerate(self.factors):
            a, b, e, s = self.a[rows], self.b[rows], E[rows][0], S[rows][0]
            if project is identity:
                result[k] = np.max(np.abs(b)) * s
            elif e > 0:
                result[k] = e * np.linalg.norm(a - project(a - (s / e) * b))
            else:  # a is 0 in a row, or column, of zeros: how far b is from the forces that hold it there
                result[k] = s * np.linalg.norm(project(-b))
        return result


def groups(pairs: Pairs) -> list[np.ndarray]:
    """Return the unknowns that only change together: the reactions of a contact, the factors of a cone, single ones."""
    alone = {k: np.array([k]) for k in range(pairs.x.size)}
    for rows, _ in pairs.factors:
        for index in (pairs.a_is[rows], pairs.b_is[rows]):
            if rows.size > 1 and index.max() < pairs.x.size:
                alone |= {int(k): index for k in index}
    return list({index.tobytes(): index for index in alone.values()}.values())
