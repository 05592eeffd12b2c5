"""Assemblies of which statics by hand gives the limit (Meriam and Kraige, Statics, chapter 6; Coulomb 1773)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from cpbench.formulations import GlobalFrictionContact
from cpbench_lab.hold_limits import hold_limit

TURN = 0.7345
"""By which all is turned, so that no number is round."""
ROTATION = np.array([[math.cos(TURN), -math.sin(TURN), 0], [math.sin(TURN), math.cos(TURN), 0], [0, 0, 1]])
Contact = tuple[int, int, tuple[float, float], float]


def plane(
    bodies: int, contacts: Sequence[Contact], loads: Sequence[Sequence[float]], mu: Any = 0.5, free: Sequence[Any] = ()
) -> GlobalFrictionContact:
    """Bodies in a plane: (x, y, angle). A contact has bodies 1 (-1: the ground) and 2, its point, and the angle of the
    normal from 1 to 2; the forces `free` are those of contacts without friction that pull, too."""

    def column(first: int, second: int, point: Any, angle: float) -> Any:
        direction, result = np.array([math.cos(angle), math.sin(angle)]), np.zeros(3 * bodies)
        for body, sign in ((first, -1.0), (second, 1.0)):
            if body >= 0:
                x, y = point
                result[3 * body : 3 * body + 3] = sign * np.append(direction, x * direction[1] - y * direction[0])
        return result

    def of(given: Sequence[Any], along: Sequence[float]) -> Any:
        return np.array([column(a, b, p, angle + more) for a, b, p, angle in given for more in along]).T

    turned = np.kron(np.eye(bodies), ROTATION)
    given = {"G": turned @ of(free, (0.0,))} if free else {}
    H, f = turned @ of(contacts, (0.0, math.pi / 2)), turned @ np.concatenate(loads)
    friction = np.broadcast_to(mu, len(contacts)).astype(float)
    return GlobalFrictionContact(
        M=np.eye(3 * bodies), H=H, f=f, w=np.zeros(2 * len(contacts)), mu=friction, dimension=2, **given
    )


UP, RIGHT, LEFT, DOWN = math.pi / 2, 0.0, math.pi, -math.pi / 2


def at(force: Sequence[float], point: Sequence[float]) -> list[float]:
    return [*force, point[0] * force[1] - point[1] * force[0]]


def pinched(angle: float) -> Any:
    """A block between two walls that spread by the angle each downwards: tan(angle), with forces that grow to inf."""
    contacts: list[Contact] = [
        (-1, 0, (side, y), -angle if side < 0 else LEFT + angle) for side in (-1.0, 1.0) for y in (-0.3, 0.3)
    ]
    return plane(1, contacts, [at([0.0, -5.0], (0.0, 0.0))]), None, math.tan(angle)


def ladder(angle: float) -> Any:
    """A ladder on a floor and a wall, both rough: sqrt(1 + t²) - t, t = tan(angle)."""
    x, y, t = math.cos(angle), math.sin(angle), math.tan(angle)
    return (
        plane(1, [(-1, 0, (x, 0.0), UP), (-1, 0, (0.0, y), RIGHT)], [at([0, -3.0], (x / 2, y / 2))]),
        None,
        math.hypot(1, t) - t,
    )


def pipes(weight: float) -> Any:
    """Two pipes on the floor, side by side, and one above: 2 - sqrt(3) between them."""
    third, s = math.pi / 3, math.sqrt(3)
    contacts: list[Contact] = [(-1, 0, (-1, 0), UP), (-1, 1, (1, 0), UP), (0, 1, (0, 1), RIGHT)]
    contacts += [(0, 2, (-0.5, 1 + s / 2), third), (1, 2, (0.5, 1 + s / 2), 2 * third)]
    loads = [at([0, -weight], p) for p in ((-1, 1), (1, 1), (0, 1 + s))]
    return plane(3, contacts, loads), None, 2 - s


def pushed(height: float, mu: float) -> Any:
    """A block 2 wide, of weight 10, pushed at a height: it slides at 10 μ or tips at 10/height."""
    feet: list[Contact] = [(-1, 0, (x, 0.0), UP) for x in (-1.0, 1.0)]
    return plane(1, feet, [[0.0, -10.0, 0.0]], mu), ROTATION @ at([1.0, 0.0], (0.0, height)), min(10 * mu, 10 / height)


def climber(angle: float, mu: float) -> Any:
    """One of weight λ at the top of a ladder of weight 1 on a smooth wall: (μt - 1/2)/(1 - μt), t = tan(angle)."""
    x, y, t = math.cos(angle), math.sin(angle), mu * math.tan(angle)
    made = plane(1, [(-1, 0, (x, 0.0), UP), (-1, 0, (0.0, y), RIGHT)], [at([0, -1], (x / 2, y / 2))], [mu, 0.0])
    return made, ROTATION @ at([0, -1.0], (0.0, y)), (t - 0.5) / (1 - t)


def twisted(radius: float, mu: float) -> Any:
    """Three feet on a circle carry a weight 6; a moment about its axis slides them all: 6 μ radius."""
    H = np.zeros((6, 9))
    for c in range(3):
        angle = TURN + 2 * math.pi * c / 3
        for k, direction in enumerate(np.roll(np.eye(3), 1, axis=0)):
            H[:, 3 * c + k] = np.append(
                direction, np.cross([radius * math.cos(angle), radius * math.sin(angle), 0], direction)
            )
    made = GlobalFrictionContact(M=np.eye(6), H=H, f=[0, 0, -6, 0, 0, 0], w=np.zeros(9), mu=np.full(3, mu))
    return made, np.eye(6)[5], 6 * mu * radius


@pytest.mark.parametrize(
    ("make", "given"),
    [(pinched, (0.2,)), (ladder, (1.0,)), (pipes, (3.0,)), (pushed, (1.0, 0.4)), (pushed, (3.0, 0.4)),
     (climber, (1.0, 0.4)), (twisted, (0.7, 0.35))],
)  # fmt: skip
def test_a_limit_is_that_of_statics(make: Callable[..., Any], given: tuple[float, ...]) -> None:
    problem, load, limit = make(*given)
    found = hold_limit(problem, None if load is None else np.asarray(load, float))
    assert found.answer == "limit"
    assert found.narrow
    assert found.holding == pytest.approx(limit, rel=1e-6)
    assert min(found.holding, found.moving) <= limit * (1 + 1e-9)
    assert max(found.holding, found.moving) >= limit * (1 - 1e-9)
