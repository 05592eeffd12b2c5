"""Velocities of contacts from those of bodies, and rotations; nothing here knows time or forces."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Dense
from cpbench_problems.scenes.bodies import BodyState, Touching


def directions(state: BodyState, touching: Touching, *, rolling: bool = False) -> sp.csr_array:
    """Return H, shape (6n, nc·d): rows of u = Hᵀv are the velocity of the first body against the second at the
    contact, along normal and tangents, and with `rolling` the angular velocity along the tangents."""
    n, nc = len(state.x), len(touching.id)
    d = 5 if rolling else 3
    blocks, rows, columns = [], [], []
    for side, sign in ((0, 1.0), (1, -1.0)):
        moving = np.flatnonzero(touching.bodies[:, side] < n)
        body = touching.bodies[moving, side]
        frame, R = touching.frame[moving], state.R[body]
        arm = touching.point[moving] - state.x[body]
        block = np.zeros((len(moving), 6, d))
        block[:, :3, :3] = frame.transpose(0, 2, 1)
        block[:, 3:, :3] = (np.cross(arm[:, None, :], frame) @ R).transpose(0, 2, 1)
        if rolling:
            block[:, 3:, 3:] = (frame[:, 1:] @ R).transpose(0, 2, 1)
        blocks.append(sign * block)
        rows.append(np.broadcast_to((6 * body[:, None] + np.arange(6))[:, :, None], block.shape))
        columns.append(np.broadcast_to((d * moving[:, None] + np.arange(d))[:, None, :], block.shape))
    data, row, column = (np.concatenate([part.ravel() for part in parts]) for parts in (blocks, rows, columns))
    return sp.csr_array(sp.coo_array((data, (row, column)), shape=(6 * n, d * nc)))


def own_axes(state: BodyState, wrench: Dense) -> Dense:
    """Turn the angular parts of (n, 6) into the principal axes of the bodies."""
    return np.hstack([wrench[:, :3], np.einsum("bji,bj->bi", state.R, wrench[:, 3:])])


def axes_of_bodies(state: BodyState) -> sp.csr_array:
    """Return the matrix (6n, 6n) that turns velocities in the principal axes into those of the world."""
    n = len(state.x)
    blocks = np.tile(np.eye(6), (n, 1, 1))
    blocks[:, 3:, 3:] = state.R
    return sp.csr_array(sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(6 * n, 6 * n)))


def rotations(turns: Dense) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the rotations (n, 3, 3) about vectors (n, 3) by their lengths [rad], by Rodrigues' formula."""
    angle = np.sqrt((turns**2).sum(axis=1))
    safe = np.where(angle > 0, angle, 1.0)
    a = np.where(angle > 0, np.sin(safe) / safe, 1.0)
    b = np.where(angle > 0, 2.0 * (np.sin(safe / 2) / safe) ** 2, 0.5)
    K = np.cross(np.eye(3)[None], -turns[:, None, :])  # rows e_i × (−t) = t × e_i; K x = t × x
    K = K.transpose(0, 2, 1)
    return np.eye(3) + a[:, None, None] * K + b[:, None, None] * (K @ K)
