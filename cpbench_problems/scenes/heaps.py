"""Scenes of balls: a packing that falls into a box, a trough, a chute, a heap that rolls, and many separate piles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import generator
from cpbench_problems.scenes.bodies import BodyScene, Choices, RigidBodies, at_rest, ball_inertia, family, spread
from cpbench_problems.scenes.nearness import GROUND, Planes, balls_touch, own_balls

DENSITY = 1000.0
"""[kg/m³]"""
RADIUS = 0.1
"""Of an average ball [m]."""
SLOPE = math.radians(30.0)
"""Of the chute."""
ROLLING = 0.05
"""Coefficient of rolling friction over the radius."""


@family("spheres", "balls of three sizes that fall into a box", "balls", mu=0.4)
def spheres(choices: Choices) -> BodyScene:
    """Build layers of balls that are set off from one another by half a cell, above the floor of an open box."""
    rng = generator(choices.seed)
    radius = RADIUS * np.array([0.8, 0.9, 1.0])[rng.integers(3, size=choices.size)]
    side = max(1, round((choices.size / 2) ** (1 / 3)))
    x = _layers(choices.size, side, side, 2.0 * RADIUS, rng)
    x[:, 2] += RADIUS - x[:, 2].min() - (RADIUS - radius[np.argmin(x[:, 2])])
    width = RADIUS * (2 * side + 1.5)
    walls = Planes(
        np.array([[0.0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]),
        np.array([0.0, -RADIUS, RADIUS - width, -RADIUS, RADIUS - width]),
    )
    return _balls("spheres", choices, x, radius, walls, rng)


@family("trough", "balls in a trough whose two sides meet at 60 degrees, wedged between them", "balls", mu=0.3)
def trough(choices: Choices) -> BodyScene:
    """Build sections across the trough, each a triangle of three balls that touch its sides and one another."""
    rng = generator(choices.seed)
    section, column = np.divmod(np.arange(choices.size), 3)
    height = np.array([2.0, 2.0 + math.sqrt(3.0), 2.0 + math.sqrt(3.0)])[column] * RADIUS
    across = np.array([0.0, -1.0, 1.0])[column] * RADIUS
    x = np.stack([across, 2.0 * RADIUS * section, height], axis=1)
    half = math.radians(30.0)
    sides = Planes(np.array([[math.cos(half), 0, math.sin(half)], [-math.cos(half), 0, math.sin(half)]]), np.zeros(2))
    return _balls("trough", choices, x, np.full(choices.size, RADIUS), sides, rng)


@family("chute", "balls that run down a chute of 30 degrees between two walls", "balls", mu=0.3)
def chute(choices: Choices) -> BodyScene:
    """Build rows of three and four balls in turn, at rest on the slope, two layers high."""
    rng = generator(choices.seed)
    along = max(1, math.ceil(choices.size / 6))
    x = _layers(choices.size, along, 3, 2.0 * RADIUS, rng)
    x[:, 2] += RADIUS - x[:, 2].min()
    tilt = np.array([[math.cos(SLOPE), 0, math.sin(SLOPE)], [0, 1, 0], [-math.sin(SLOPE), 0, math.cos(SLOPE)]])
    planes = Planes(np.array([[0.0, 0, 1], [0, 1, 0], [0, -1, 0]]) @ tilt.T, np.array([0.0, -RADIUS, -7.5 * RADIUS]))
    return _balls("chute", choices, x @ tilt.T, np.full(choices.size, RADIUS), planes, rng)


@family("rolling-heap", "a heap of balls on the ground that resist rolling", "balls", mu=0.6)
def rolling_heap(choices: Choices) -> BodyScene:
    """Build a square pyramid of balls, the top of it cut off where there are too few for a whole one."""
    rng = generator(choices.seed)
    side = 1
    while side * (side + 1) * (2 * side + 1) // 6 < choices.size:
        side += 1
    x = np.concatenate([_square(side - k, k) for k in range(side)])[: choices.size]
    scene = _balls("rolling-heap", choices, x, np.full(choices.size, RADIUS), GROUND, rng)
    return replace(scene, mu_r=ROLLING * RADIUS)


@family("clusters", "piles of four balls, each apart from the others", "piles", mu=0.5)
def clusters(choices: Choices) -> BodyScene:
    """Build three balls that touch and one on them, at the places of a grid of 1 m, each pile turned at random."""
    rng = generator(choices.seed)
    base = 2.0 * RADIUS / math.sqrt(3.0)
    angle = rng.random(choices.size)[:, None] * 2.0 * math.pi + np.arange(3) * 2.0 * math.pi / 3.0
    side = math.ceil(math.sqrt(choices.size))
    cell = np.stack(np.divmod(np.arange(choices.size), side), axis=1)
    x = np.zeros((choices.size, 4, 3))
    x[:, :, :2] = cell[:, None, :]
    x[:, :3, 0] += base * np.cos(angle)
    x[:, :3, 1] += base * np.sin(angle)
    x[:, :, 2] = RADIUS
    x[:, 3, 2] += 2.0 * RADIUS * math.sqrt(2.0 / 3.0)
    return _balls("clusters", choices, x.reshape(-1, 3), np.full(4 * choices.size, RADIUS), GROUND, rng)


def _layers(count: int, along: int, across: int, pitch: float, rng: np.random.Generator) -> Dense:
    """Return centres of `count` balls in layers of a square grid, every second one set off by half a cell and each ball
    by up to 1/50."""
    number = np.arange(count)
    layer, in_layer = np.divmod(number, along * across)
    grid = np.stack([*np.divmod(in_layer, across), layer], axis=1).astype(np.float64)
    grid[:, :2] += 0.5 * (layer % 2)[:, None]
    x = pitch * grid * [1.0, 1.0, 0.8]
    return x + pitch * 0.02 * rng.random(x.shape)


def _square(side: int, layer: int) -> Dense:
    """Return the centres of a layer of a square pyramid of balls that touch."""
    i, j = np.divmod(np.arange(side * side), side)
    off = layer + 2.0 * np.stack([i, j], axis=1)
    return RADIUS * np.column_stack([off, np.full(side * side, 1.0 + layer * math.sqrt(2.0))])


def _balls(
    name: str, choices: Choices, x: Dense, radius: Vector, planes: Planes, rng: np.random.Generator
) -> BodyScene:
    """Return a scene of balls at rest; which of them are heavy is drawn."""
    factor = spread(choices.mass_ratio, rng.permutation(len(radius)).astype(np.float64))
    mass = DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3 * factor
    if choices.mass_ratio == 1.0:
        mass = mass * (radius / RADIUS) ** 3
    bodies = RigidBodies(mass, ball_inertia(mass, radius))
    touch = balls_touch(own_balls(radius), planes)
    return BodyScene(
        name=name, bodies=bodies, start=at_rest(x), touch=touch, force=bodies.weight, mu=choices.mu, dt=choices.dt
    )
