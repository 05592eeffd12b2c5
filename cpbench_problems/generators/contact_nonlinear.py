"""Frictional contact with nonlinear dynamics, F(v) = Hr, u = Hᵀv + w: one step of a time-stepping scheme.

    drag       balls in a heavy fluid, implicit Euler: m v + h c √(‖v‖² + s²) v = f + (Hr), drag that grows with the
               square of the speed above s; on a floor and against each other
    spin       rigid bodies joined by contacts, implicit midpoint: J(ω − ω⁻) + h ω_m × Jω_m = f + (Hr), ω_m = (ω + ω⁻)/2
    pendulum   a chain of n point masses on rods that hits a wall, implicit midpoint in its angles q:
               M(q_m)(v − v⁻) + h (Σ_j a_ij sin(q_i − q_j)_m v_jm² + b_i sin q_im) = f + (Hr), a_ij and b_i the masses
               and weights beyond link i and j, M_ij = a_ij cos(q_i − q_j)_m; hinges are stiff, so nothing is cut off

v and the state of every contact are chosen (as in `contact_planted`), then the loads f = N(v) − Hr and, by the gaps
and velocities of what is touched, w = u − Hᵀv. The sums of `drag` and `spin` are products, sums and square roots of
short numbers; sines, whose last digits differ between C libraries, and f are rounded to a grid.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.global_contact import NFCPoint, NonlinearFrictionContact
from cpbench.foundation.matrices import Vector
from cpbench.generators.base import Instance, collection, dyadic, generator, snapped
from cpbench_problems.generators.contact_planted import MU, STATES, contact_states
from cpbench_problems.generators.symbols import Symbol, mapped, total, unknowns

STEP, SWING = 2.0**-4, 2.0**-5
"""[s], the second for pendulums; long, so that the dynamics are far from linear within them."""
DRAG, SLOW = 0.5, 0.25
"""c [kg/m] of a ball and s [m/s]."""
GRAVITY = 9.8125
"""[m/s²], a multiple of 1/16."""
MOST_DENSE = 600
"""Rows of H up to which it is dense."""
SUMMARY = "balls with drag, spinning bodies and pendulums that touch: implicit steps with planted contacts"
CITATION = "planted by cpbench; the schemes are those of Moreau 1988 and Acary and Brogliato 2008"


@collection("contact-nonlinear", "nfc", SUMMARY, CITATION)
def build() -> list[Instance]:
    """Build chains of one to twenty bodies."""
    return [
        *(balls(n) for n in (1, 4, 16)),
        *(spinning(n) for n in (2, 8, 20)),
        *(pendulum(n) for n in (1, 2, 6, 12)),
    ]


@collection("contact-nonlinear-large", "nfc", SUMMARY, CITATION, tier="standard")
def build_large() -> list[Instance]:
    """Build up to 1000 balls, 800 spinning bodies, and long chains."""
    many = [*(balls(n) for n in (200, 400, 1000)), *(spinning(n) for n in (200, 400, 800))]
    return [balls(100), spinning(100), pendulum(30), *many]


def balls(n: int) -> Instance:
    """Build n balls: each on the floor, and every other one against the next."""
    rng = generator(81)
    pairs = [(b, -1) for b in range(n)] + [(b, b + 1) for b in range(0, n - 1, 2)]
    H = _empty(3 * n, 3 * len(pairs))
    for c, (first, second) in enumerate(pairs):
        # rows: normal, tangents; balls touch along the first axis, the floor is below
        frame = np.roll(np.eye(3), 1 if second < 0 else 0, axis=0)
        columns = slice(3 * c, 3 * c + 3)
        H[3 * first : 3 * first + 3, columns] = -frame.T if second >= 0 else frame.T
        if second >= 0:
            H[3 * second : 3 * second + 3, columns] = frame.T
    mass = 2.0 ** rng.integers(-1, 2, n)
    v = unknowns(3 * n)
    force: list[Symbol] = []
    for b in range(n):
        own = v[3 * b : 3 * b + 3]
        speed = (total(x * x for x in own) + SLOW**2).sqrt()
        force += [float(mass[b]) * x + STEP * DRAG * (speed * x) for x in own]
    answer = dyadic(rng, 3 * n, -8, 8, 16)
    return _planted(f"drag-{n}", rng, v, force, answer, H, 3, {"bodies": n})


def spinning(n: int) -> Instance:
    """Build n rigid bodies of six freedoms in a ring, joined by n + n/2 contacts with arms."""
    rng = generator(82)
    pairs = [(b, (b + 1) % n) for b in range(n)] + [(b, (b + n // 2) % n) for b in range(n // 2)]
    H = _empty(6 * n, 3 * len(pairs))
    for c, pair in enumerate(pairs):
        for body, sign in zip(pair, (1.0, -1.0), strict=True):
            arm = dyadic(rng, (3, 3), -1, 1, 4)
            H[6 * body : 6 * body + 6, 3 * c : 3 * c + 3] = sign * np.vstack([np.eye(3), arm])
    mass = 2.0 ** rng.integers(-1, 2, n)
    inertia = mass[:, None] * np.array([0.25, 0.5, 0.625])
    before = dyadic(rng, (n, 3), -8, 8, 4)
    z = unknowns(6 * n)
    force: list[Symbol] = []
    for b in range(n):
        v, omega = z[6 * b : 6 * b + 3], z[6 * b + 3 : 6 * b + 6]
        J = inertia[b].tolist()
        middle = [0.5 * (w + w0) for w, w0 in zip(omega, before[b].tolist(), strict=True)]
        torque = _cross(middle, [j * w for j, w in zip(J, middle, strict=True)])
        force += [float(mass[b]) * x for x in v]
        force += [j * (w - w0) + STEP * t for j, w, w0, t in zip(J, omega, before[b].tolist(), torque, strict=True)]
    answer = dyadic(rng, 6 * n, -8, 8, 16)
    start = np.zeros((n, 6))
    start[:, 3:] = before
    return _planted(f"spin-{n}", rng, z, force, answer, H, 3, {"bodies": n}, start.ravel())


def pendulum(n: int) -> Instance:
    """Build a chain of n links of length 1/2; every other mass from the end touches a wall on its right."""
    rng = generator(83)
    length, mass = 0.5, 2.0 ** rng.integers(-1, 2, n)
    q, before = dyadic(rng, n, -1, 1, 16), dyadic(rng, n, -4, 4, 4)
    beyond = np.cumsum(mass[::-1])[::-1]  # mass that hangs on a link
    v = unknowns(n)
    angle = [float(q[i]) + (0.25 * SWING) * (v[i] + float(before[i])) for i in range(n)]
    middle = [0.5 * (v[i] + float(before[i])) for i in range(n)]
    change = [v[i] - float(before[i]) for i in range(n)]
    force: list[Symbol] = []
    for i in range(n):
        terms: list[Any] = []
        for j in range(n):
            a = length * length * float(beyond[max(i, j)])
            if i == j:
                terms.append(a * change[i])
            else:
                between = angle[i] - angle[j]
                terms.append(a * (between.cos() * change[j] + SWING * (between.sin() * (middle[j] * middle[j]))))
        terms.append(SWING * GRAVITY * length * float(beyond[i]) * angle[i].sin())
        force.append(total(terms))
    touching = range(n - 1, -1, -2)
    H = np.zeros((n, 2 * len(touching)))
    for c, j in enumerate(touching):
        # the mass j is at Σ_{i ≤ j} length (sin q_i, −cos q_i); the normal points to the left, the tangent up
        H[: j + 1, 2 * c] = -length * snapped(np.cos(q[: j + 1]))
        H[: j + 1, 2 * c + 1] = length * snapped(np.sin(q[: j + 1]))
    answer = before + dyadic(rng, n, -2, 2, 16)
    return _planted(f"pendulum-{n}", rng, v, force, answer, H, 2, {"links": n}, before)


def _empty(rows: int, columns: int) -> Any:
    """Return zeros, stored as a sparse matrix where there are many."""
    return np.zeros((rows, columns)) if rows <= MOST_DENSE else sp.lil_array((rows, columns))


def _cross(a: list[Any], b: list[Any]) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _planted(
    name: str,
    rng: np.random.Generator,
    v: list[Symbol],
    force: list[Symbol],
    answer: Vector,
    H: Any,
    d: int,
    properties: dict[str, Any],
    start: Vector | None = None,
) -> Instance:
    """Build F(v) = N(v) − f with loads and velocities that `answer` and a drawn contact state solve."""
    H = sp.csr_array(H) if sp.issparse(H) else H
    nc = H.shape[1] // d
    states = [STATES[int(rng.integers(3))] for _ in range(nc)]
    r, u = contact_states(rng, states, MU, d)
    f = snapped(mapped(v, force).evaluate(answer) - H @ r.ravel())
    F = mapped(v, [N - load for N, load in zip(force, f.tolist(), strict=True)])
    w = snapped(u.ravel() - H.T @ answer)
    problem = NonlinearFrictionContact(
        F=F,
        H=H,
        w=w,
        mu=np.full(nc, MU),
        start=np.zeros(answer.size) if start is None else start,
        dimension=d,
        name=name,
    )
    counts = {s: states.count(s) for s in STATES[:3]}
    point = NFCPoint(v=answer, r=r.ravel())
    return Instance(problem, point, "planted to rounding", properties={**properties, "states": counts})
