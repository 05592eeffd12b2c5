"""Moreau and Jean's time stepping of a scene, over any solver of contact problems.

One step from t to t + h, with the places of the bodies at t (Jean 1999; Acary and Brogliato 2008, ch. 10):

    M(v⁺ − v) = h (force − gyroscopic moments) + Hr + Gλ,   Gᵀv⁺ + b = 0,   u = Hᵀv⁺ + w,   Coulomb's law on (u, r)
    x⁺ = x + h (θv⁺ + (1 − θ)v),   R⁺ = exp of the same turn · R

Normal rows of w are g/h for a gap g above the scene's slop, so that a gap may close within the step and not more; else
0. With a coefficient of restitution e > 0, they are e u_N⁻ where the gap would close within the step (u_N⁻ before it:
Newton's law of impact). Overlap is not pushed out. Tangential rows are 0.

Angular velocities and moments of the problem are in the principal axes of their bodies, so that M is diagonal.
Rolling friction adds the two components of the relative angular velocity along the tangents.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Contacts, Sequence
from cpbench.formulations.global_contact import GFCPoint, GlobalFrictionContact, GlobalRollingFrictionContact
from cpbench.foundation.matrices import Dense, Vector
from cpbench_problems.scenes.bodies import BodyScene, BodyState, Touching

ContactProblem = GlobalFrictionContact | GlobalRollingFrictionContact
Solve = Callable[[ContactProblem], GFCPoint]
"""Returns an answer to the contact problem of a step."""


@dataclass(frozen=True, eq=False)
class SceneStep:
    """One step: its problem, the answer by which the bodies moved, and the state after it.

    problem, point : None where nothing touches and nothing holds the bodies.
    """

    problem: ContactProblem | None
    point: GFCPoint | None
    state: BodyState


def run(scene: BodyScene, steps: int, solve: Solve) -> Iterator[SceneStep]:
    """Yield the steps of a scene; raises what `solve` raises."""
    state = scene.start
    for index in range(steps):
        touching = scene.touch(state)
        free = _mass(scene) * own_axes(state, state.v) + scene.dt * _loads(scene, state)
        if not len(touching.id) and scene.hold is None:
            step = SceneStep(None, None, _moved(scene, state, free / _mass(scene)))
        else:
            problem = contact_problem(scene, state, touching, free.ravel(), index)
            point = solve(problem)
            impulse = problem.f + problem.H @ point.r + problem.G @ point.lam
            step = SceneStep(problem, point, _moved(scene, state, impulse.reshape(-1, 6) / _mass(scene)))
        state = step.state
        yield step


def contact_problem(
    scene: BodyScene, state: BodyState, touching: Touching, f: Vector, index: int = 0
) -> ContactProblem:
    """Build the problem of one step in global form; f : (6n,), the momentum without reactions [N s]."""
    H = directions(state, touching, rolling=scene.mu_r > 0)
    d, nc = 5 if scene.mu_r > 0 else 3, len(touching.id)
    w = np.zeros((nc, d))
    w[:, 0] = np.where(touching.gap > scene.slop, touching.gap / scene.dt, 0.0)
    if scene.restitution > 0:
        before = (H.T @ own_axes(state, state.v).ravel()).reshape(nc, d)[:, 0]
        hits = touching.gap + scene.dt * before < 0
        w[hits, 0] = scene.restitution * before[hits]
    data: dict[str, Any] = {
        "M": sp.csr_array(sp.diags_array(_mass(scene).ravel())),
        "H": H,
        "f": f,
        "w": w.ravel(),
        "mu": np.full(nc, scene.mu),
        "dimension": d,
        "name": f"step-{index:03d}",
        "sequence": Sequence(name=scene.name, step=index, time=index * scene.dt, dt=scene.dt),
        "contacts": Contacts(touching.id, touching.bodies, touching.point, touching.frame),
    }
    if scene.hold is not None:
        G, b = scene.hold(state)
        data |= {"G": sp.csr_array(axes_of_bodies(state).T @ G), "b": b}
    if scene.mu_r > 0:
        return GlobalRollingFrictionContact(**data, mu_r=np.full(nc, scene.mu_r))
    return GlobalFrictionContact(**data)


def _mass(scene: BodyScene) -> Dense:
    return np.hstack([np.repeat(scene.bodies.mass[:, None], 3, axis=1), scene.bodies.inertia])


def _loads(scene: BodyScene, state: BodyState) -> Dense:
    """Return forces and moments (n, 6), moments in the principal axes and with −ω × Jω."""
    loads = own_axes(state, scene.force)
    spin = own_axes(state, state.v)[:, 3:]
    loads[:, 3:] -= np.cross(spin, scene.bodies.inertia * spin)
    return loads


def _moved(scene: BodyScene, state: BodyState, v: Dense) -> BodyState:
    """Return the state after the step; v : (n, 6), new velocities in the principal axes that the bodies had before."""
    new = np.hstack([v[:, :3], np.einsum("bij,bj->bi", state.R, v[:, 3:])])
    mean = scene.dt * (scene.theta * new + (1.0 - scene.theta) * state.v)
    return BodyState(state.x + mean[:, :3], rotations(mean[:, 3:]) @ state.R, new)


# ----------------------------------------------------------------------------------------------------------- kinematics


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
