"""Scenes whose motion has a closed form: incline, sliding to rest, backspin, a row of spheres, and a rope on a drum.

Each formula is that of the continuous motion, and the stepper with θ = 1/2 follows it to rounding, for exact answers:
its velocities are those of the continuous motion at the times of the steps where accelerations are constant, and where
friction stops or a ball begins to roll at a step; the trapezoidal rule then has the exact displacement. With θ = 1, the
displacement of a constant acceleration over N steps would be (1 + 1/N) times as long. g is GRAVITY.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench_problems.scenes.bodies import (
    GRAVITY,
    BodyScene,
    BodyState,
    RigidBodies,
    Touching,
    at_rest,
    ball_inertia,
    box_inertia,
)
from cpbench_problems.scenes.nearness import GROUND, Pads, Planes, balls_touch, own_balls, pads_touch

DT = 0.01
"""[s]"""
MU = 0.4
SLOP = 1e-3
"""[m], of answers to 1e-3 over 200 steps."""
KNOT = 1e-3
"""Mass of a knot of the rope [kg]."""
FLAT = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])


@dataclass(frozen=True, eq=False)
class Motion:
    """A scene, and where its bodies have to be after `steps` steps.

    Attributes
    ----------
    formula : in words. places : coordinates of a state that are compared (k,) [m]. exact : (k,), their closed form [m].
    """

    scene: BodyScene
    steps: int
    formula: str
    places: Callable[[BodyState], Vector]
    exact: Vector

    def error(self, state: BodyState) -> float:
        """Return the largest distance of a coordinate from its closed form over the longest way that the closed form
        has any body go."""
        ways = np.abs(self.exact - self.places(self.scene.start))
        return float(np.abs(self.places(state) - self.exact).max() / ways.max())


def incline() -> Motion:
    """Build a block that slides down from rest, slope α = atan 1/2, μ = 0.4: s = ½ g (sin α − μ cos α) t² (Newton's
    second law along the slope with friction μ m g cos α).

    After 2 s: 1.754866 m.
    """
    seconds, slope = 2.0, math.atan(0.5)
    scene = _block("incline", np.array([math.sin(slope), 0.0, -math.cos(slope)]), 0.0)
    distance = 0.5 * GRAVITY * (math.sin(slope) - MU * math.cos(slope)) * seconds**2
    return _along_x(scene, seconds, "½ g (sin α − μ cos α) t²", distance)


def sliding_to_rest() -> Motion:
    """Build a block on flat ground that slides with v₀ = μ g t₁ and rests from t₁ = 0.5 s on: s = v₀²/(2μg) (the work
    of friction is the kinetic energy).

    It is looked at after 1 s: what creeps at rest moves on.
    """
    stop = 0.5
    scene = _block("sliding to rest", np.array([0.0, 0.0, -1.0]), MU * GRAVITY * stop)
    return _along_x(scene, 1.0, "v₀²/(2 μ g)", MU * GRAVITY * stop**2 / 2.0)


def backspin() -> Motion:
    """Build a ball that is thrown forwards with backspin, slides until t₁ = 0.5 s, and rolls back from then on.

    Friction μmg slows it by μg, and turns it by 5μg/(2R): the contact is at rest when v₀ + Rω₀ = 7/2 μ g t₁, with
    v₁ = v₀ − μ g t₁. Here v₀ = μ g t₁/2, so v₁ = −μ g t₁/2 and Rω₀ = 3 μ g t₁; at t: s = v₀t₁ − ½μgt₁² + v₁(t − t₁)
    = v₁(t − t₁) (Coriolis 1835, Théorie mathématique des effets du jeu de billard).
    """
    slide, seconds, radius = 0.5, 1.5, 0.1
    mass = np.ones(1)
    bodies = RigidBodies(mass, ball_inertia(mass, np.array([radius])))
    start = at_rest(np.array([[0.0, 0.0, radius]]))
    speed = MU * GRAVITY * slide
    start.v[0, 0], start.v[0, 4] = speed / 2.0, -3.0 * speed / radius
    touch = balls_touch(own_balls(np.array([radius])), GROUND)
    scene = BodyScene(
        name="backspin",
        bodies=bodies,
        start=start,
        touch=touch,
        force=bodies.weight,
        mu=MU,
        dt=DT,
        theta=0.5,
        slop=SLOP,
    )
    return _along_x(scene, seconds, "−½ μ g t₁ (t − t₁)", -speed / 2.0 * (seconds - slide))


def row_of_spheres() -> Motion:
    """Build five equal spheres in a row, elastic and without friction, of which the first flies towards the others.

    Each takes over the velocity of the one before and leaves it at rest (momentum and energy of two equal bodies), so
    that each comes to rest where the next one was, and the last flies on. The first gap takes a whole number of steps
    and a half, the others take a whole number, so that each impact is in the middle of a step.
    """
    count, radius, speed = 5, 0.05, 1.0
    gap = speed * DT * np.array([10.5, 11.0, 11.0, 11.0])
    seconds = 1.0
    mass = np.ones(count)
    bodies = RigidBodies(mass, ball_inertia(mass, np.full(count, radius)))
    x = np.zeros((count, 3))
    x[1:, 0] = np.cumsum(2.0 * radius + gap)
    start = at_rest(x)
    start.v[0, 0] = speed
    nothing = Planes(np.zeros((0, 3)), np.zeros(0))
    scene = BodyScene(
        name="row of spheres",
        bodies=bodies,
        start=start,
        touch=balls_touch(own_balls(np.full(count, radius)), nothing),
        force=np.zeros((count, 6)),
        mu=0.0,
        restitution=1.0,
        dt=DT,
        theta=0.5,
        slop=SLOP,
    )
    exact = x[:, 0] + np.append(gap, speed * seconds - gap.sum())
    return Motion(scene, round(seconds / DT), "each takes the place of the next", lambda state: state.x[:, 0], exact)


def capstan() -> Motion:
    """Build a rope over a fixed drum, 180 degrees of it, with 1 kg on one side and 6 kg on the other.

    The rope is N light knots, each with a contact, between stretches of constant direction; it turns by δ = π/N at
    each knot and goes on over the drum for as long as one likes (the contacts stay where they are). At a knot with
    tensions T before and T' behind: N = (T + T') sin δ/2 and (T' − T) cos δ/2 = μN + m a for its mass m, where
    a cos δ/2 is the acceleration of the loads. So T' = T κ + m a/(c − μs), κ = (c + μs)/(c − μs), c = cos δ/2,
    s = sin δ/2; κᴺ tends to e^(μπ) (Eytelwein 1808). With T = m₁(g + ac) and T' = m₂(g − ac) at the ends, a follows.
    """
    knots, seconds = 12, 1.0
    light, heavy, turn = 1.0, 6.0, math.pi / knots
    c, s = math.cos(turn / 2), math.sin(turn / 2)
    kappa, push = (c + MU * s) / (c - MU * s), KNOT / (c - MU * s)
    # T' = κᴺ T + a·push·(κᴺ − 1)/(κ − 1)
    whole = kappa**knots
    a = GRAVITY * (heavy - whole * light) / (c * (heavy + whole * light) + push * (whole - 1.0) / (kappa - 1.0))
    fall = 0.5 * a * c * seconds**2
    scene = rope_on_drum(knots, light, heavy)
    exact = scene.start.x[[0, -1], 2] + np.array([fall, -fall])
    return Motion(scene, round(seconds / DT), "½ a c t²", lambda state: state.x[[0, -1], 2], exact)


MOTIONS: tuple[Callable[[], Motion], ...] = (incline, sliding_to_rest, backspin, row_of_spheres, capstan)


def _along_x(scene: BodyScene, seconds: float, formula: str, distance: float) -> Motion:
    """Return the motion of a single body, whose way along x has a closed form and which does nothing else."""
    exact = scene.start.x[0] + np.array([distance, 0.0, 0.0])
    return Motion(scene, round(seconds / DT), formula, lambda state: state.x[0], exact)


def _block(name: str, gravity: Vector, speed: float) -> BodyScene:
    """Return a flat block of 1 kg on four points, with x down the slope, that moves along x."""
    sides = np.array([[0.2, 0.2, 0.1]])
    mass = np.ones(1)
    bodies = RigidBodies(mass, box_inertia(mass, sides))
    start = at_rest(np.array([[0.0, 0.0, 0.05]]))
    start.v[0, 0] = speed
    corner = np.array([[a, b, 0.0] for a in (-0.1, 0.1) for b in (-0.1, 0.1)])
    own, ground = np.zeros(4, np.int64), np.ones(4, np.int64)
    pads = Pads(own, ground, corner, np.tile(FLAT, (4, 1, 1)), np.zeros((4, 3)), np.full((4, 2), np.inf))
    force = np.zeros((1, 6))
    force[0, :3] = GRAVITY * gravity
    touch = pads_touch(pads, start)
    return BodyScene(
        name=name, bodies=bodies, start=start, touch=touch, force=force, mu=MU, dt=DT, theta=0.5, slop=SLOP
    )


def rope_on_drum(knots: int, light: float, heavy: float) -> BodyScene:
    """Build two loads [kg] and the knots between them on half a drum; contacts and stretches of the rope stay as they
    are."""
    mass = np.array([light, *[KNOT] * knots, heavy])
    n, radius, turn = len(mass), 0.1, math.pi / knots
    bodies = RigidBodies(mass, ball_inertia(mass, np.full(n, 0.01)))
    angle = math.pi - turn * (np.arange(knots) + 0.5)
    normal = np.stack([np.cos(angle), np.zeros(knots), np.sin(angle)], axis=1)
    across = np.tile([0.0, 1.0, 0.0], (knots, 1))
    x = np.concatenate([[[-radius, 0, -0.5]], radius * normal, [[radius, 0, -0.5]]])
    frame = np.stack([normal, np.cross(across, normal), across], axis=1)
    ids, pairs = np.arange(knots), np.stack([np.arange(1, n - 1), np.full(knots, n)], axis=1)

    def touch(state: BodyState) -> Touching:
        """Return the same contacts in all states, at the centres of the knots, so that these have no lever arm."""
        return Touching(ids, pairs, state.x[1:-1], frame, np.zeros(knots))

    bend = math.pi / 2 - turn * np.arange(knots + 1)
    stretch = np.stack([np.cos(bend), np.zeros(knots + 1), np.sin(bend)], axis=1)
    G = np.zeros((n, 6, n - 1))
    k = np.arange(n - 1)
    G[k, :3, k], G[k + 1, :3, k] = -stretch, stretch
    held = sp.csr_array(G.reshape(6 * n, n - 1))
    force = np.zeros((n, 6))
    force[[0, -1], 2] = -GRAVITY * mass[[0, -1]]
    return BodyScene(
        name="capstan",
        bodies=bodies,
        start=at_rest(x),
        touch=touch,
        force=force,
        hold=lambda state: (held, np.zeros(n - 1)),
        mu=MU,
        dt=DT,
        theta=0.5,
        slop=SLOP,
    )
