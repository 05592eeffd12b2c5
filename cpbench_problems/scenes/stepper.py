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
from cpbench_problems.scenes.kinematics import axes_of_bodies, directions, own_axes, rotations

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
