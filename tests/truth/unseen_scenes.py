"""Rigid-body scenes drawn at random: stacks, walls, arches, piles, wedged rows, hands; as contact in global form.

A scene is a list of bodies (centre, mass, radius of gyration) and of contacts (point, normal, the two bodies). One time
step of Moreau's scheme gives Mv = Hr + f, u = Hᵀv + w (Acary & Brogliato, *Numerical Methods for Nonsmooth Dynamical
Systems*, 2008, ch. 10). Units are SI; a time step is 5 ms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from cpbench.formulations import GlobalFrictionContact, GlobalRollingFrictionContact

STEP = 0.005
GRAVITY = 9.81
FIXED = -1
"""Index of the body that does not move."""

Rng = np.random.Generator
Array = np.ndarray


@dataclass
class Scene:
    """Bodies and contacts, collected one by one; `frames` are rows (normal, tangent, tangent) that point to `first`."""

    centres: list[Array] = field(default_factory=list)
    masses: list[float] = field(default_factory=list)
    gyration: list[float] = field(default_factory=list)
    velocities: list[Array] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    frames: list[Array] = field(default_factory=list)
    pairs: list[tuple[int, int]] = field(default_factory=list)
    joints: list[tuple[int, int, Array]] = field(default_factory=list)

    def body(self, centre: Sequence[float], mass: float, gyration: float, velocity: Sequence[float] = (0,) * 6) -> int:
        """Add a body and return its index."""
        self.centres.append(np.asarray(centre, float))
        self.masses.append(mass)
        self.gyration.append(gyration)
        self.velocities.append(np.asarray(velocity, float))
        return len(self.masses) - 1

    def contact(self, point: Array, normal: Array, first: int, second: int = FIXED) -> None:
        """Add a contact."""
        self.points.append(np.asarray(point, float))
        self.frames.append(frame(normal))
        self.pairs.append((first, second))

    def columns(self, point: Array, axes: Array, first: int, second: int) -> list[tuple[int, Array]]:
        """Return for each moving body of a pair its 6×3 block: wrench of unit impulses along `axes` at `point`."""
        blocks = []
        for body, sign in ((first, 1.0), (second, -1.0)):
            if body != FIXED:
                arm = point - self.centres[body]
                blocks.append((body, sign * np.vstack([axes.T, np.cross(arm, axes).T])))
        return blocks

    def jacobian(self, places: Sequence[tuple[Array, Array, int, int]]) -> sp.csc_array:
        """Return H or G: 6 rows a body, 3 columns a place."""
        H = sp.lil_array((6 * len(self.masses), 3 * len(places)))
        for c, place in enumerate(places):
            for body, block in self.columns(*place):
                H[6 * body : 6 * body + 6, 3 * c : 3 * c + 3] = block
        return sp.csc_array(H)


def frame(normal: Array) -> Array:
    """Return an orthonormal frame whose first row is the normal."""
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    t = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    t /= np.linalg.norm(t)
    return np.array([n, t, np.cross(n, t)])


def as_global(scene: Scene, mu: Array | float, restitution: float = 0.0) -> GlobalFrictionContact:
    """Return one step of the scene; contacts that close bounce by Newton's law."""
    M = np.concatenate([[m, m, m, *(m * g * g,) * 3] for m, g in zip(scene.masses, scene.gyration, strict=True)])
    v = np.concatenate(scene.velocities)
    weight = np.tile([0.0, 0, -GRAVITY, 0, 0, 0], len(scene.masses))
    H = scene.jacobian([(p, F, a, b) for p, F, (a, b) in zip(scene.points, scene.frames, scene.pairs, strict=True)])
    before = H.T @ v
    w = np.zeros(3 * len(scene.points))
    w[::3] = restitution * np.minimum(before[::3], 0.0)
    G = scene.jacobian([(point, np.eye(3), a, b) for a, b, point in scene.joints]) if scene.joints else None
    return GlobalFrictionContact(
        M=sp.csr_array(sp.diags_array(M)),
        H=sp.csr_array(H),
        f=M * (v + STEP * weight),
        w=w,
        mu=np.broadcast_to(mu, len(scene.points)).astype(float),
        **({} if G is None else {"G": sp.csr_array(G), "b": np.zeros(G.shape[1])}),
    )


def masses(rng: Rng, number: int) -> Array:
    """Draw masses [kg] whose ratio is up to 1e7, one exponent a scene."""
    return 10.0 ** (rng.uniform(0, 7) * rng.uniform(-0.5, 0.5, number))


def friction(rng: Rng, contacts: int) -> Array:
    """Draw coefficients of friction: one for all, or one each."""
    return np.full(contacts, rng.uniform(0, 1.2)) if rng.random() < 0.5 else rng.uniform(0, 1.2, contacts)


def _face(scene: Scene, centre: Array, normal: Array, half: float, first: int, second: int) -> None:
    """Add the four corners of a square face."""
    _, s, t = frame(normal)
    for a in (-half, half):
        for b in (-half, half):
            scene.contact(centre + a * s + b * t, normal, first, second)


def stack(rng: Rng, size: int) -> Scene:
    """A tower of boxes, each set off and pushed a little."""
    scene, up = Scene(), np.array([0.0, 0, 1])
    levels = max(1, size // 4)
    for k, m in enumerate(masses(rng, levels)):
        shift = rng.uniform(-0.1, 0.1, 2)
        body = scene.body([*shift, k + 0.5], m, 0.41, rng.normal(0, 0.02, 6))
        _face(scene, np.array([*shift, float(k)]), up, 0.45, body, body - 1 if k else FIXED)
    return scene


def wall(rng: Rng, size: int) -> Scene:
    """Bricks in running bond: each lies on two below."""
    scene, up = Scene(), np.array([0.0, 0, 1])
    wide = max(2, int(np.sqrt(size / 4)))
    m = masses(rng, wide * wide)
    row: list[int] = []
    for level in range(wide):
        new = [
            scene.body(
                [k + 0.5 * (level % 2), 0, 0.5 * level + 0.25], m[level * wide + k], 0.33, rng.normal(0, 0.01, 6)
            )
            for k in range(wide - level % 2)
        ]
        for k, body in enumerate(new):
            left = k if level % 2 else k - 1
            for side, place in ((-0.25, left), (0.25, left + 1)):
                if not row or 0 <= place < len(row):
                    for y in (-0.2, 0.2):
                        foot = scene.centres[body] + np.array([side, y, -0.25])
                        scene.contact(foot, up, body, row[place] if row else FIXED)
        row = new
    return scene


def arch(rng: Rng, size: int) -> Scene:
    """Voussoirs on a half circle between two springers, four contacts a joint."""
    scene = Scene()
    stones = max(2, size // 4 - 1)
    angles = np.pi * (np.arange(stones) + 0.5) / stones
    for angle, m in zip(angles, masses(rng, stones), strict=True):
        scene.body([5 * np.cos(angle), 0, 5 * np.sin(angle)], m, 0.4, rng.normal(0, 0.005, 6))
    for k in range(stones + 1):
        angle = np.pi * k / stones
        along = np.array([-np.sin(angle), 0, np.cos(angle)])
        first, second = (k, k - 1) if k < stones else (k - 1, FIXED)
        normal = along if k < stones else -along
        _face(scene, np.array([5 * np.cos(angle), 0, 5 * np.sin(angle)]), normal, 0.4, first, second if k else FIXED)
    return scene


def pile(rng: Rng, size: int) -> Scene:
    """Balls thrown into a box: what touches or nearly touches is a contact, one point each."""
    scene = Scene()
    balls = max(1, size // 3)
    side = max(1.0, (balls / 2) ** (1 / 3))
    heights: list[Array] = []
    for m in masses(rng, balls):
        x, y = rng.uniform(0, side, 2)
        z = max([0.5, *(c[2] + np.sqrt(max(0.0, 1 - (c[0] - x) ** 2 - (c[1] - y) ** 2)) for c in heights)])
        heights.append(np.array([x, y, z]))
        scene.body(heights[-1], m, 0.316, rng.normal(0, 0.1, 6))
    for a, p in enumerate(heights):
        if p[2] < 0.51:
            scene.contact(p - [0, 0, 0.5], np.array([0.0, 0, 1]), a)
        for b in range(a):
            gap = p - heights[b]
            if np.linalg.norm(gap) < 1.02:
                scene.contact(heights[b] + gap / 2, gap, a, b)
    if not scene.points:
        scene.contact(heights[0] - [0, 0, 0.5], np.array([0.0, 0, 1]), 0)
    return scene


def redundant_pile(rng: Rng, size: int) -> Scene:
    """Boxes in a row between walls and on the ground, nine contacts a face: far more contacts than freedoms."""
    scene, up, along = Scene(), np.array([0.0, 0, 1]), np.array([1.0, 0, 0])
    boxes = max(1, size // 15)
    for k, m in enumerate(masses(rng, boxes)):
        body = scene.body([k + 0.5, 0, 0.5], m, 0.41, rng.normal(0, 0.02, 6))
        for a in (-0.4, 0.0, 0.4):
            for b in (-0.4, 0.0, 0.4):
                scene.contact(np.array([k + 0.5 + a, b, 0]), up, body)
        _face(scene, np.array([float(k), 0, 0.5]), along, 0.4, body, body - 1 if k else FIXED)
    _face(scene, np.array([float(boxes), 0, 0.5]), -along, 0.4, boxes - 1, FIXED)
    return scene


def wedged_row(rng: Rng, size: int) -> Scene:
    """Bodies in a row between two walls, the outer ones pushed inwards: self-stress, friction carries the weight."""
    scene, along = Scene(), np.array([1.0, 0, 0])
    bodies = max(1, size // 4 - 1)
    push = 10.0 ** rng.uniform(-3, 1)
    for k, m in enumerate(masses(rng, bodies)):
        inward = push * ((k == 0) - (k == bodies - 1))
        body = scene.body([k + 0.5, 0, 0], m, 0.41, [inward, 0, 0, 0, 0, 0])
        _face(scene, np.array([float(k), 0, 0]), along, 0.4, body, body - 1 if k else FIXED)
    _face(scene, np.array([float(bodies), 0, 0]), -along, 0.4, bodies - 1, FIXED)
    return scene


def hand(rng: Rng, size: int) -> Scene:
    """One object in the grasp of several fingers, heavier or lighter than it, that close on it."""
    scene = Scene()
    body = scene.body([0, 0, 0], 10.0 ** rng.uniform(-2, 1), 0.03)
    for _ in range(max(2, min(size, 20))):
        inward = rng.normal(size=3)
        inward /= np.linalg.norm(inward)
        push = np.concatenate([rng.uniform(0, 0.5) * inward, np.zeros(3)])
        finger = scene.body(-0.08 * inward, 10.0 ** rng.uniform(-2, 1), 1.0, push)
        scene.contact(-0.05 * inward, inward + rng.normal(0, 0.2, 3), body, finger)
    return scene


def jointed(rng: Rng, size: int) -> Scene:
    """Chains of links held by ball joints, lying on the ground."""
    scene, up = Scene(), np.array([0.0, 0, 1])
    links = max(2, size // 2)
    for k, m in enumerate(masses(rng, links)):
        body = scene.body([k, 0, 0.1], m, 0.3, rng.normal(0, 0.1, 6))
        for end in (-0.4, 0.4):
            scene.contact(np.array([k + end, 0, 0]), up, body)
        if k:
            scene.joints.append((body, body - 1, np.array([k - 0.5, 0, 0.1])))
    return scene


SCENES: dict[str, Callable[[Rng, int], Scene]] = {
    "stack": stack,
    "wall": wall,
    "arch": arch,
    "pile": pile,
    "redundant-pile": redundant_pile,
    "wedged-row": wedged_row,
    "hand": hand,
}


def rolling(rng: Rng, size: int) -> GlobalRollingFrictionContact:
    """A pile of balls that resists rolling: rows (N, T1, T2, and the relative spins about the frame's axes)."""
    scene = pile(rng, size)
    plain = as_global(scene, friction(rng, len(scene.points)))
    n, nc = plain.f.size, len(scene.points)
    H = sp.lil_array((n, 5 * nc))
    sliding = sp.csc_array(plain.H)
    for c, (F, (a, b)) in enumerate(zip(scene.frames, scene.pairs, strict=True)):
        H[:, 5 * c : 5 * c + 3] = sliding[:, 3 * c : 3 * c + 3]
        for body, sign in ((a, 1.0), (b, -1.0)):
            if body != FIXED:
                H[6 * body + 3 : 6 * body + 6, 5 * c + 3 : 5 * c + 5] = sign * F[1:].T
    return GlobalRollingFrictionContact(
        M=plain.M,
        H=sp.csr_array(H),
        f=plain.f,
        w=np.zeros(5 * nc),
        mu=plain.mu,
        mu_r=rng.uniform(0, 0.1) * np.ones(nc),
    )
