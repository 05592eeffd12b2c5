"""Exact solutions that are numbers of few binary digits, as planted ones are: degenerate ones are proved by them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from cpbench.foundation.matrices import Sparse, Vector
from cpbench_lab.certificates.contact_balls import Scene
from cpbench_lab.certificates.exact_rows import ExactRows, rational

GRIDS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 20, 24)
"""Binary places after the point."""
NEAR = 1e-4
"""Distance, over the size where that is above 1, within which a rounded answer is tried."""


def rounded(x: Vector) -> Iterator[Vector]:
    """Yield the answer rounded to more and more binary places, and as it is."""
    size = max(np.abs(x).max(initial=0.0), 1.0)
    seen = set[bytes]()
    for places in GRIDS:
        near = np.ldexp(np.rint(np.ldexp(x, places)), -places) + 0.0
        if np.abs(near - x).max(initial=0.0) <= NEAR * size and near.tobytes() not in seen:
            seen.add(near.tobytes())
            yield near
    yield x


def affine(matrix: Sparse, constants: Vector, x: Sequence[Any]) -> list[Any]:
    """Matrix · x + constants over the rationals."""
    return [v + rational(c) for v, c in zip(ExactRows.of(matrix).products(x), constants.tolist(), strict=True)]


def solves_contacts(scene: Scene, x: Vector) -> bool:
    """Return whether x meets all equations and Coulomb's law with Signorini's conditions, exactly.

    No root is needed: where u_T ≠ 0, r_T is opposite to it and ‖r_T‖² = μ²r_N².
    """
    exact = [rational(v) for v in x.tolist()]
    if any(affine(scene.L, scene.a, exact)):
        return False
    u, r = affine(scene.V, scene.q, exact), exact[scene.k :]
    places = pairwise(range(0, len(u) + 1, 3))
    return all(_contact(u[a:b], r[a:b], rational(mu)) for (a, b), mu in zip(places, scene.mu.tolist(), strict=True))


def _contact(u: Sequence[Any], r: Sequence[Any], mu: Any) -> bool:
    (u_N, u_1, u_2), (r_N, r_1, r_2) = u, r
    if u_N < 0 or r_N < 0 or u_N * r_N != 0:
        return False
    room = mu * mu * r_N * r_N - r_1 * r_1 - r_2 * r_2
    if u_1 == 0 and u_2 == 0:
        return bool(room >= 0)
    return bool(room == 0 and u_1 * r_2 == u_2 * r_1 and u_1 * r_1 + u_2 * r_2 <= 0)
