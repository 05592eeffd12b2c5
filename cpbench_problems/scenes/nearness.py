"""Which points of bodies are near which: balls against planes and one another, and pads against flat faces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from cpbench.foundation.matrices import Dense, Vector
from cpbench_problems.scenes.bodies import REACH, BodyState, Frames, Numbers, Touching


def frames(normals: Dense) -> Frames:
    """Return (k, 3, 3): unit normals (k, 3), and two tangents that start from the axis that a normal is farthest
    from."""
    away = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = cross(normals, away)
    first /= np.sqrt((first**2).sum(axis=1, keepdims=True))
    return np.stack([normals, first, cross(normals, first)], axis=1)


def cross(a: Dense, b: Dense) -> Dense:
    """Compute the vector products of the rows (k, 3)."""
    return np.asarray(np.cross(a, b), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls that are fixed to bodies. body : (k,). place : (k, 3), in the axes of the body [m]. radius : (k,) [m]."""

    body: Numbers
    place: Dense
    radius: Vector


@dataclass(frozen=True, eq=False)
class Planes:
    """Half-spaces n·x ≥ d that do not move. normal : (k, 3). offset : (k,), d [m]."""

    normal: Dense
    offset: Vector


GROUND = Planes(np.array([[0.0, 0.0, 1.0]]), np.zeros(1))


def own_balls(radius: Vector) -> Balls:
    """Return one ball a body, about its centre."""
    return Balls(np.arange(len(radius)), np.zeros((len(radius), 3)), radius)


def balls_touch(balls: Balls, planes: Planes, *, each_other: bool = True) -> Callable[[BodyState], Touching]:
    """Return the contacts of balls on planes, and of pairs of balls of two bodies.

    The id of a contact is made of its ball and its plane, or of its two balls. Plane k is body n + k.
    """
    k, widest = len(balls.body), float(balls.radius.max())

    def touch(state: BodyState) -> Touching:
        centre = state.x[balls.body] + np.einsum("bij,bj->bi", state.R[balls.body], balls.place)
        above = centre @ planes.normal.T - planes.offset - balls.radius[:, None]
        ball, plane = np.nonzero(above < REACH)
        normal, gap, other = planes.normal[plane], above[ball, plane], len(state.x) + plane
        number = k + plane
        point = centre[ball] - balls.radius[ball, None] * normal
        if each_other:
            pairs = cKDTree(centre).query_pairs(2.0 * widest + REACH, output_type="ndarray")
            first, second = pairs.max(axis=1), pairs.min(axis=1)
            apart = centre[first] - centre[second]
            distance = np.sqrt((apart**2).sum(axis=1))
            between = distance - balls.radius[first] - balls.radius[second]
            near = (between < REACH) & (balls.body[first] != balls.body[second])
            first, second, distance, between = first[near], second[near], distance[near], between[near]
            along = apart[near] / distance[:, None]
            middle = centre[second] + (balls.radius[second] + between / 2)[:, None] * along
            ball, number = np.concatenate([ball, first]), np.concatenate([number, second])
            other = np.concatenate([other, balls.body[second]])
            normal, point = np.concatenate([normal, along]), np.concatenate([point, middle])
            gap = np.concatenate([gap, between])
        ids = ball * (k + len(planes.offset)) + number
        bodies = np.stack([balls.body[ball], other], axis=1)
        order = np.argsort(ids)
        return Touching(ids[order], bodies[order], point[order], frames(normal[order]), gap[order])

    return touch


@dataclass(frozen=True, eq=False)
class Pads:
    """Points of a body that may stand on a rectangular face of another body, or of the ground.

    Attributes
    ----------
    owner : (k,), whose points. other : (k,), whose face; n for what does not move.
    point : (k, 3) and frame : (k, 3, 3), at the start [m]: rows are the normal, which points to the owner,
    and tangents.
    centre : (k, 3), of the face [m]. half : (k, 2), half the sides of the face along the tangents [m].
    """

    owner: Numbers
    other: Numbers
    point: Dense
    frame: Frames
    centre: Dense
    half: Dense


def pads_touch(pads: Pads, start: BodyState) -> Callable[[BodyState], Touching]:
    """Return the contacts of pads on their faces; the id of a contact is the number of its pad."""
    x, R = _with_ground(start)
    own, of = pads.owner, pads.other
    offset = np.einsum("cji,cj->ci", R[own], pads.point - x[own])
    origin = np.einsum("cji,cj->ci", R[of], pads.centre - x[of])
    axes = pads.frame @ R[of]

    def touch(state: BodyState) -> Touching:
        x, R = _with_ground(state)
        point = x[own] + np.einsum("cij,cj->ci", R[own], offset)
        frame = axes @ R[of].transpose(0, 2, 1)
        apart = point - x[of] - np.einsum("cij,cj->ci", R[of], origin)
        along = np.einsum("cij,cj->ci", frame, apart)
        near = np.flatnonzero((along[:, 0] < REACH) & (np.abs(along[:, 1:]) <= pads.half).all(axis=1))
        bodies = np.stack([own[near], of[near]], axis=1)
        return Touching(near, bodies, point[near], frame[near], along[near, 0])

    return touch


def _with_ground(state: BodyState) -> tuple[Dense, Frames]:
    """Return places and axes with those of the ground behind them."""
    return np.concatenate([state.x, np.zeros((1, 3))]), np.concatenate([state.R, np.eye(3)[None]])
