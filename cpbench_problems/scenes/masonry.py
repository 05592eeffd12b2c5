"""Scenes of blocks: a tower, a wall in running bond, and round arches that stand or fall.

Blocks stand on four points, near the corners of the face that they share with the block or the ground below.
"""

from __future__ import annotations

import math

import numpy as np

from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import generator
from cpbench_problems.scenes.bodies import (
    BodyScene,
    BodyState,
    Choices,
    Frames,
    Numbers,
    RigidBodies,
    at_rest,
    box_inertia,
    family,
    spread,
)
from cpbench_problems.scenes.nearness import Pads, pads_touch

DENSITY = 2000.0
"""[kg/m³]"""
CUBE, BRICK = 0.2, np.array([0.4, 0.2, 0.2])
"""Sides [m]."""
INSET = 0.9
"""Where the points of a face are: this part of the way from its centre to its corners."""
DEPTH = 0.3
"""Of an arch of mean radius 1 [m]."""
THICK, THIN = 0.16, 0.08
"""Thickness of an arch over its mean radius. A half circle of many stones needs 0.1075 to stand (Milankovitch 1907,
Theorie der Druckkurven; Heyman 1969 has 0.106 with an approximation)."""
UP = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
"""Frame of a horizontal face."""


@family("tower", "a tower of cubes, each set off a little; the top is the heaviest", "cubes", mu=0.6)
def tower(choices: Choices) -> BodyScene:
    """Build cubes on one another; with `mass_ratio` each is heavier than the one below by the same factor."""
    rng, n = generator(choices.seed), choices.size
    x = np.zeros((n, 3))
    x[:, :2] = 0.02 * CUBE * (2.0 * rng.random((n, 2)) - 1.0)
    x[:, 2] = CUBE * (np.arange(n) + 0.5)
    mass = DENSITY * CUBE**3 * spread(choices.mass_ratio, np.arange(n, dtype=np.float64))
    below = np.where(np.arange(n) > 0, np.arange(n) - 1, n)
    start = at_rest(x)
    pads = _faces(np.arange(n), below, x - [0.0, 0.0, CUBE / 2], np.full((n, 2), CUBE / 2))
    return _blocks("tower", choices, start, RigidBodies(mass, box_inertia(mass, np.full((n, 3), CUBE))), pads)


@family("wall", "a wall of bricks in running bond, with half bricks at its ends", "bricks", mu=0.6)
def wall(choices: Choices) -> BodyScene:
    """Build courses of bricks; those of every second course lie on two each."""
    rng = generator(choices.seed)
    wide = max(1, round(math.sqrt(choices.size / 2)))
    left, right, course = _bond(choices.size, wide)
    n = len(left)
    sides = np.column_stack([right - left, np.full(n, BRICK[1]), np.full(n, BRICK[2])])
    x = np.column_stack([(left + right) / 2, np.zeros(n), BRICK[2] * (course + 0.5)])
    owner: list[int] = []
    other: list[int] = []
    overlap: list[tuple[float, float]] = []
    for k in range(n):
        below = np.flatnonzero((course == course[k] - 1) & (right > left[k] + 1e-9) & (left < right[k] - 1e-9))
        for b in below if course[k] else [n]:
            owner.append(k)
            other.append(int(b))
            overlap.append((left[k], right[k]) if b == n else (max(left[k], left[b]), min(right[k], right[b])))
    span, own = np.array(overlap), np.array(owner)
    centre = np.column_stack([span.mean(axis=1), np.zeros(len(own)), BRICK[2] * course[own]])
    half = np.column_stack([(span[:, 1] - span[:, 0]) / 2, np.full(len(own), BRICK[1] / 2)])
    factor = spread(choices.mass_ratio, rng.permutation(n).astype(np.float64))
    volume = sides.prod(axis=1) if choices.mass_ratio == 1.0 else float(BRICK.prod())
    mass = DENSITY * volume * factor
    pads = _faces(own, np.array(other), centre, half)
    return _blocks("wall", choices, at_rest(x), RigidBodies(mass, box_inertia(mass, sides)), pads)


@family("arch", "a round arch of stones that stands by its own weight", "stones", mu=0.7, smallest=3)
def arch(choices: Choices) -> BodyScene:
    """Build an arch that is thick enough to stand."""
    return _arch("arch", choices, THICK)


@family("falling-arch", "a round arch of stones that is too thin to stand", "stones", mu=0.7, smallest=3)
def falling_arch(choices: Choices) -> BodyScene:
    """Build an arch that opens at its joints and falls."""
    return _arch("falling-arch", choices, THIN)


def _arch(name: str, choices: Choices, thickness: float) -> BodyScene:
    """Build equal stones on a half circle of mean radius 1 m between two abutments.

    A stone is the part of a ring between two radii; its centre of gravity is that of this part, its inertia that of a
    box of the same length.
    """
    n = choices.size
    middle, width = math.pi * (np.arange(n) + 0.5) / n, math.pi / n
    inner, outer = 1.0 - thickness / 2, 1.0 + thickness / 2
    radius = 2.0 / 3.0 * (outer**3 - inner**3) / (outer**2 - inner**2) * math.sin(width / 2) / (width / 2)
    x = radius * _radial(middle)
    R = np.stack([_radial(middle), np.tile([0.0, 1.0, 0.0], (n, 1)), _tangent(middle)], axis=2)
    # right-handed axes: radial × y = −(along the arch), so the third is turned over
    R[:, :, 2] *= np.sign(np.linalg.det(R))[:, None]
    ranks = generator(choices.seed).permutation(n).astype(np.float64)
    mass = DENSITY * DEPTH * thickness * width * spread(choices.mass_ratio, ranks)
    inertia = box_inertia(mass, np.tile([thickness, DEPTH, width], (n, 1)))
    joint = math.pi * np.arange(n + 1) / n
    owner, other = np.arange(n + 1), np.arange(n + 1) - 1
    owner[n], other[n], other[0] = n - 1, n, n
    sign = np.where(np.arange(n + 1) < n, 1.0, -1.0)[:, None]
    frame = np.stack([sign * _tangent(joint), _radial(joint), np.tile([0.0, 1.0, 0.0], (n + 1, 1))], axis=1)
    half = np.tile([thickness / 2, DEPTH / 2], (n + 1, 1))
    pads = _faces(owner, other, _radial(joint), half, frame, inset=1.0)
    return _blocks(name, choices, at_rest(x, R), RigidBodies(mass, inertia), pads)


def _radial(angle: Vector) -> Dense:
    return np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)], axis=1)


def _tangent(angle: Vector) -> Dense:
    return np.stack([-np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=1)


def _bond(size: int, wide: int) -> tuple[Vector, Vector, Numbers]:
    """Return left and right ends and the course of `size` bricks, in courses of `wide` or of `wide` − 1 and two
    halves."""
    left: list[float] = []
    right: list[float] = []
    course: list[int] = []
    while len(left) < size:
        level = course[-1] + 1 if course else 0
        cuts = BRICK[0] * np.arange(wide + 1.0)
        if level % 2:
            cuts = BRICK[0] * np.array([0.0, *(np.arange(wide) + 0.5), wide])
        left += cuts[:-1].tolist()
        right += cuts[1:].tolist()
        course += [level] * (len(cuts) - 1)
    return np.array(left)[:size], np.array(right)[:size], np.array(course)[:size]


def _faces(
    owner: Numbers, other: Numbers, centre: Dense, half: Dense, frame: Frames | None = None, *, inset: float = INSET
) -> Pads:
    """Return four pads for each face: its corners, drawn in towards its centre by `inset`."""
    k = len(owner)
    axes = np.tile(UP, (k, 1, 1)) if frame is None else frame
    corner = np.array([[a, b] for a in (-inset, inset) for b in (-inset, inset)])
    point = centre[:, None, :] + np.einsum("pa,ca,cai->cpi", corner, half, axes[:, 1:])
    four = np.repeat(np.arange(k), 4)
    return Pads(
        np.asarray(owner, dtype=np.int64)[four],
        np.asarray(other, dtype=np.int64)[four],
        point.reshape(-1, 3),
        axes[four],
        centre[four],
        1.05 * half[four],
    )


def _blocks(name: str, choices: Choices, start: BodyState, bodies: RigidBodies, pads: Pads) -> BodyScene:
    touch = pads_touch(pads, start)
    return BodyScene(
        name=name, bodies=bodies, start=start, touch=touch, force=bodies.weight, mu=choices.mu, dt=choices.dt
    )
