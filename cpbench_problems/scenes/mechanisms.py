"""Scenes with joints: a chain that is pulled up from the ground, and fingers that hold a ball."""

from __future__ import annotations

import math

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import generator
from cpbench_problems.scenes.bodies import (
    GRAVITY,
    BodyScene,
    BodyState,
    Choices,
    Numbers,
    RigidBodies,
    at_rest,
    ball_inertia,
    box_inertia,
    family,
    spread,
)
from cpbench_problems.scenes.nearness import GROUND, Balls, Planes, balls_touch

LINK, THICKNESS = 0.1, 0.02
"""Length between the joints of a link, and the diameter of the balls at its ends [m]."""
LIGHTEST = 0.1
"""Mass of a link [kg], of the lightest where they differ."""
ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
"""Share of coordinates up to which two of them are the same."""
PULL = 1.5
"""Upward force on the first link, over the weight of four links or of the chain, whichever is less."""
BALL, TIP = 0.05, 0.01
"""Radius of the ball that is held, and of the tips of the fingers [m]."""
BALL_MASS = 1.0
"""[kg]"""
GRIP = 3.0
"""Force of all fingers together over the weight of the ball; they hold it where mu is above 1/3."""


@family("chain", "a chain of links with ball joints that is pulled up from the ground by its end", "links", mu=0.5)
def chain(choices: Choices) -> BodyScene:
    """Build links in a row on the ground, each with a ball at both ends, so that neighbours rest side by side."""
    rng, n = generator(choices.seed), choices.size
    ranks = rng.permutation(n).astype(np.float64)
    mass = LIGHTEST * spread(choices.mass_ratio, ranks)
    x = np.stack([LINK * (np.arange(n) + 0.5), np.zeros(n), np.full(n, THICKNESS / 2)], axis=1)
    bodies = RigidBodies(mass, box_inertia(mass, np.tile([LINK, THICKNESS, THICKNESS], (n, 1))))
    force = bodies.weight.copy()
    force[0, 2] += PULL * GRAVITY * min(float(mass.sum()), float(mass[:4].sum()))
    ends = np.repeat(np.arange(n), 2)
    position = np.zeros((2 * n, 3))
    position[:, 0] = np.tile([-0.5 * LINK + THICKNESS, 0.5 * LINK - THICKNESS], n)
    balls = Balls(ends, position, np.full(2 * n, THICKNESS / 2))

    def hold(state: BodyState) -> tuple[sp.csr_array, Vector]:
        """Let the end of each link stay where the next begins; what is apart closes within the step."""
        arm = LINK / 2 * state.R[:, :, 0]
        before, after = np.arange(n - 1), np.arange(1, n)
        G = _points(n, after, -arm[after], 1.0) + _points(n, before, arm[before], -1.0)
        near, far = state.x[after] - arm[after], state.x[before] + arm[before]
        apart = near - far
        # the places of ends that meet differ by rounding, which is no distance to close
        apart[np.abs(apart) <= ROUNDING * (np.abs(near) + np.abs(far))] = 0.0
        return sp.csr_array(G), apart.ravel() / choices.dt

    return BodyScene(
        name="chain",
        bodies=bodies,
        start=at_rest(x),
        touch=balls_touch(balls, GROUND, each_other=False),
        force=force,
        hold=hold if n > 1 else None,
        mu=choices.mu,
        dt=choices.dt,
    )


@family("grasp", "a ball that fingers hold by friction alone", "fingers", mu=0.6, smallest=2)
def grasp(choices: Choices) -> BodyScene:
    """Build a ball with fingers around its equator; a finger slides towards the axis and is held in all other ways.

    Each finger pushes with the same force. The fingers have the mass of the ball, or with `mass_ratio` that part of it.
    """
    n = choices.size
    angle = 2.0 * math.pi * (np.arange(n) + 0.5) / n
    inward = -np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=1)
    x = np.concatenate([np.zeros((1, 3)), -(BALL + TIP) * inward])
    mass = np.concatenate([[BALL_MASS], np.full(n, BALL_MASS / choices.mass_ratio)])
    radius = np.concatenate([[BALL], np.full(n, TIP)])
    bodies = RigidBodies(mass, ball_inertia(mass, radius))
    force = np.zeros((n + 1, 6))
    force[0] = bodies.weight[0]
    force[1:, :3] = GRIP * GRAVITY * BALL_MASS / n * inward
    G = _sliders(inward)
    touch = balls_touch(Balls(np.arange(n + 1), np.zeros((n + 1, 3)), radius), Planes(np.zeros((0, 3)), np.zeros(0)))
    return BodyScene(
        name="grasp",
        bodies=bodies,
        start=at_rest(x),
        touch=touch,
        force=force,
        hold=lambda state: (G, np.zeros(G.shape[1])),
        mu=choices.mu,
        dt=choices.dt,
    )


def _points(n: int, body: Numbers, arm: Dense, sign: float) -> sp.csr_array:
    """Return (6n, 3k): column triples are the velocity of a point of a body at `arm` (k, 3) from its centre."""
    k = len(body)
    block = np.zeros((k, 6, 3))
    block[:, :3] = np.eye(3)
    block[:, 3:] = np.cross(arm[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)
    rows = np.broadcast_to((6 * body[:, None] + np.arange(6))[:, :, None], block.shape)
    columns = np.broadcast_to((3 * np.arange(k)[:, None] + np.arange(3))[:, None, :], block.shape)
    entries = (sign * block.ravel(), (rows.ravel(), columns.ravel()))
    return sp.csr_array(sp.coo_array(entries, shape=(6 * n, 3 * k)))


def _sliders(axis: Dense) -> sp.csr_array:
    """Return G of bodies 1 to n, each of which may only slide along its horizontal `axis` (n, 3)."""
    n = len(axis)
    across = np.stack([-axis[:, 1], axis[:, 0], np.zeros(n)], axis=1)
    G = np.zeros((n + 1, 6, n, 5))
    finger = np.arange(n)
    G[finger + 1, :3, finger, 0] = across
    G[finger + 1, 2, finger, 1] = 1.0
    for k in range(3):
        G[finger + 1, 3 + k, finger, 2 + k] = 1.0
    return sp.csr_array(G.reshape(6 * (n + 1), 5 * n))
