"""Rigid bodies, their places and velocities, and what a scene says of them; plain data. SI units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Dense, Vector
from cpbench.registry import Registry

Numbers: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]
"""Of bodies, contacts and the like."""
Frames: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]
"""Shape (k, 3, 3)."""
GRAVITY = 9.81
"""[m/s²]"""
REACH = 0.02
"""Gaps up to this make a contact [m]."""


@dataclass(frozen=True, eq=False)
class RigidBodies:
    """The n bodies. mass : (n,) [kg]. inertia : (n, 3), principal moments about the centre [kg m²]."""

    mass: Vector
    inertia: Dense

    @property
    def weight(self) -> Dense:
        """The force of gravity along −z with no moment, shape (n, 6)."""
        force = np.zeros((len(self.mass), 6))
        force[:, 2] = -GRAVITY * self.mass
        return force


@dataclass(frozen=True, eq=False)
class BodyState:
    """Places and velocities of n bodies.

    Attributes
    ----------
    x : (n, 3), centres [m]. R : (n, 3, 3), columns are the principal axes of a body.
    v : (n, 6), velocity of the centre [m/s] and angular velocity [rad/s], both in the axes of the world.
    """

    x: Dense
    R: Frames
    v: Dense


@dataclass(frozen=True, eq=False)
class Touching:
    """The nc contacts of a state. A body n or higher is one that does not move.

    Attributes
    ----------
    id : (nc,), the same for the same contact in all steps. bodies : (nc, 2), the normal points to the first.
    point : (nc, 3) [m]. frame : (nc, 3, 3), rows are normal, tangent, tangent. gap : (nc,) [m].
    """

    id: Numbers
    bodies: Numbers
    point: Dense
    frame: Frames
    gap: Vector


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyScene:
    """A scene: bodies, what touches and what holds them.

    Attributes
    ----------
    start : the state at time 0. touch : the contacts of a state. force : (n, 6), constant, weight included [N, N m].
    hold : G (6n, p) and b (p,) of the joints of a state, Gᵀv + b = 0 with v in the axes of the world; None: no joints.
    mu : coefficient of friction. mu_r : of rolling friction [m]; 0: none, and no rows for it.
    restitution : of Newton's law of impact, e. dt : time step [s].
    slop : gaps up to this count as 0 [m], since a solver's tolerance leaves some between bodies that touch.
    theta : the part of the new velocity in the displacement of a step: 1 of Euler's implicit rule, 1/2 of the
    trapezoidal rule, which is exact where the acceleration is constant.
    """

    name: str
    bodies: RigidBodies
    start: BodyState
    touch: Callable[[BodyState], Touching]
    force: Dense
    hold: Callable[[BodyState], tuple[sp.csr_array, Vector]] | None = None
    mu: float
    mu_r: float = 0.0
    restitution: float = 0.0
    slop: float = 1e-7
    dt: float = 0.005
    theta: float = 1.0


@dataclass(frozen=True)
class Choices:
    """Choices of a user for a scene.

    Attributes
    ----------
    size : number of the family's own units. mu : coefficient of friction. mass_ratio : of the heaviest to the lightest
    body. seed : of the random numbers. dt : time step [s].
    """

    size: int
    mu: float
    mass_ratio: float
    seed: int
    dt: float


@dataclass(frozen=True)
class SceneFamily:
    """Scenes of one kind. unit : what `size` counts, in the plural. mu : the default. build : makes one."""

    name: str
    summary: str
    unit: str
    mu: float
    smallest: int
    build: Callable[[Choices], BodyScene]


families: Registry[SceneFamily] = Registry("scene", "cpbench_problems.scenes")


def family(
    name: str, summary: str, unit: str, *, mu: float, smallest: int = 1
) -> Callable[[Callable[[Choices], BodyScene]], Callable[[Choices], BodyScene]]:
    """Register a function that builds scenes (a decorator)."""

    def register(build: Callable[[Choices], BodyScene]) -> Callable[[Choices], BodyScene]:
        families.add(name, SceneFamily(name, summary, unit, mu, smallest, build))
        return build

    return register


def at_rest(x: Any, R: Any = None) -> BodyState:
    """Place bodies with these centres (n, 3) and axes (n, 3, 3), by default those of the world, that do not move."""
    n = len(x)
    axes = np.tile(np.eye(3), (n, 1, 1)) if R is None else np.asarray(R, dtype=np.float64)
    return BodyState(np.asarray(x, dtype=np.float64), axes, np.zeros((n, 6)))


def box_inertia(mass: Vector, sides: Dense) -> Dense:
    """Compute the principal moments of solid boxes, (n, 3), with sides (n, 3) [m]."""
    squares = np.broadcast_to(sides, (len(mass), 3)) ** 2
    return mass[:, None] / 12.0 * (squares.sum(axis=1, keepdims=True) - squares)


def ball_inertia(mass: Vector, radius: Vector) -> Dense:
    """Compute the principal moments of solid balls, (n, 3)."""
    return np.repeat((0.4 * mass * radius**2)[:, None], 3, axis=1)


def spread(ratio: float, parts: Vector) -> Vector:
    """Return factors from 1 to `ratio` [1], as `parts` go from their least to their greatest, on a logarithmic scale.

    >>> spread(100.0, np.array([0.0, 1.0, 2.0])).round(12).tolist()
    [1.0, 10.0, 100.0]
    """
    low, high = float(parts.min()), float(parts.max())
    return ratio ** ((parts - low) / (high - low)) if high > low else np.ones_like(parts)
