"""Spheres on a disturbed cubic lattice, every neighbour a contact: a frictional problem as large as one likes.

N³ bodies and 3N²(N − 1) contacts, each of which shares a body with about ten others. Contacts are in the order of
their first body, as a program that walks over its bodies makes them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.formulations.gfc import GlobalFrictionContact

RADIUS, INERTIA, DISTURBANCE = 0.5, 0.1, 0.1


def lattice(N: int, mu: float = 0.5, seed: int = 0) -> GlobalFrictionContact:
    """The contacts between neighbours, for bodies that fall at random speeds: masses are log-normal around 1 kg."""
    rng = np.random.default_rng(seed)
    bodies, grid = N**3, np.arange(N**3).reshape(N, N, N)
    places = np.stack(np.meshgrid(*[np.arange(N)] * 3, indexing="ij"), -1).reshape(-1, 3)
    places = places + DISTURBANCE * rng.standard_normal((bodies, 3))
    first = np.concatenate([grid[:-1].ravel(), grid[:, :-1].ravel(), grid[:, :, :-1].ravel()])
    second = np.concatenate([grid[1:].ravel(), grid[:, 1:].ravel(), grid[:, :, 1:].ravel()])
    order = np.argsort(first, kind="stable")
    first, second = first[order], second[order]
    H = _directions(places[second] - places[first], first, second, bodies)
    mass = np.repeat(np.exp(0.2 * rng.standard_normal(bodies)), 6) * np.tile([1.0] * 3 + [INERTIA] * 3, bodies)
    v = np.zeros((bodies, 6))
    v[:, :3] = 0.3 * rng.standard_normal((bodies, 3)) - [0.0, 0.0, 1.0]
    M = sp.csr_array(sp.diags_array(mass))
    nc = first.size
    return GlobalFrictionContact(
        M=M, H=H, f=mass * v.ravel(), w=np.zeros(3 * nc), mu=np.full(nc, mu), name=f"lattice-{nc}"
    )


def _directions(apart: NDArray[Any], first: NDArray[Any], second: NDArray[Any], bodies: int) -> sp.csr_array:
    """H: the velocity of the second body against the first, along the normal and two tangents of every contact."""
    n = apart / np.linalg.norm(apart, axis=1)[:, None]
    t = np.cross(n, np.where(np.abs(n[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    t /= np.linalg.norm(t, axis=1)[:, None]
    frame = np.stack([n, t, np.cross(n, t)], 1)
    spin = RADIUS * np.cross(n[:, None, :], frame)  # of ω in frame·(ω × arm), arm = ±RADIUS n
    pushed = np.concatenate([frame, -spin], axis=2)  # the arm of the second body points against n
    pushing = np.concatenate([-frame, -spin], axis=2)
    nc = first.size
    blocks = np.stack([pushing, pushed], 1).reshape(2 * nc, 3, 6)
    column = np.stack([first, second], 1).ravel()
    rows = sp.bsr_array((blocks, column, np.arange(0, 2 * nc + 1, 2)), shape=(3 * nc, 6 * bodies))
    return sp.csr_array(rows.T)
