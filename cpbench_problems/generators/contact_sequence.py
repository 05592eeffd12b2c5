"""A recorded scene: spheres in a box that turns about a horizontal axis, one contact problem a time step.

Moreau's time stepping with velocities v⁺ and impulses r, at the contacts whose gap g is below MARGIN:

    M(v⁺ − v) = h f + Hr,   u = Hᵀv⁺ + w,   w = g/h in the normal − velocity of the wall,   Coulomb's law on (u, r)

(u_N = g/h + ġ ≥ 0: what is apart may close its gap within the step). A contact is a pair of bodies, which is its id
for the whole scene; walls carry their tangents along as the box turns, and a pair of spheres has those that its normal
gives, which jump. Contacts come, go, stick, slide and open, and the spheres are held once and more than once.

Every step is solved by a fixed point to SOLVED, and then made for its answer: r = P_K(y) and û = (r − y)/ρ are
complementary to rounding for any y (Moreau's decomposition), u_N = û_N − μ‖u_T‖; with y = r − ρû(r) of the last
iterate, what they leave of u = Hᵀv⁺ + w, 4e-6 m/s at most, goes into w. So each problem has a known solution, and the
next step begins from it. y is rounded to GRID, so that sums in another order do not grow into another scene.

The last bits still depend on libraries for sines and products: the files are not shipped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Contacts, Sequence
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.global_contact import GFCPoint, GlobalFrictionContact
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation.cones import de_saxce, project_friction_cone
from cpbench.foundation.matrices import Dense, Vector, norm
from cpbench.generators.base import Instance, collection, generator
from cpbench_problems.generators.contact_global import GRAVITY

STEPS = 32
SETTLING = 130
"""Steps before the first that is kept, in which the spheres fall together and come to lean on each other: a contact
that lasts has much the same impulse in the next step, one that has just been hit has not."""
DT = 2.0**-7
"""[s]"""
SPIN = 1.5
"""Angular velocity of the box about y [rad/s]."""
MU = 0.5
MARGIN = 0.02
"""Gaps up to this make a contact [m]; the box is 2 m wide."""
DENSITY = 40.0
"""Mass over radius cubed [kg/m³]."""
SOLVED, SOLVED_ROUGHLY = 1e-7, 1e-3
"""Change of r in one iteration over r, for steps that are kept and for those before."""
ITERATIONS = 3000
GRID = 2.0**-22
"""[N s]; the weight of a sphere gives 0.07 a step."""
CITATION = "Moreau 1988, Unilateral contact and dry friction in finite freedom dynamics; De Saxcé and Feng 1998"
SUMMARY = "steps of one scene: spheres in a box that turns"


@dataclass(frozen=True)
class Body:
    """Spheres: x (n, 3) [m], v (n, 6) with ω behind the velocity, radius (n,), mass and inertia in `M` (6n,)."""

    x: Dense
    v: Dense
    radius: Vector
    M: Vector


@dataclass(frozen=True)
class SequenceStep:
    """One step: the problem in global form with a solution, and the spheres after it."""

    index: int
    contacts: Contacts
    H: sp.csr_array
    f: Vector
    w: Vector
    v: Vector
    r: Vector
    body: Body


@collection("contact-sequence", "fc", SUMMARY + ", Delassus form", CITATION, builtin=False)
def build_local() -> list[Instance]:
    """Build the steps as u = Wr + q with W = HᵀM⁻¹H and q = HᵀM⁻¹f + w."""
    found: list[Instance] = []
    for step in scene():
        inverse = sp.diags_array(1.0 / step.body.M)
        W = sp.csr_array(step.H.T @ (inverse @ step.H))
        q = step.H.T @ (step.f / step.body.M) + step.w
        problem = FrictionContact(W=W, q=q, mu=_friction(step), **_place(step, found, "turning-box"))
        found.append(Instance(problem, FCPoint(r=step.r), "planted to rounding", properties=_properties(step)))
    return found


@collection("contact-sequence-global", "gfc", SUMMARY, CITATION, builtin=False)
def build_global() -> list[Instance]:
    """Build the steps as Mv = Hr + f, u = Hᵀv + w."""
    found: list[Instance] = []
    for step in scene():
        problem = GlobalFrictionContact(
            M=sp.csr_array(sp.diags_array(step.body.M)),
            H=step.H,
            f=step.f,
            w=step.w,
            mu=_friction(step),
            **_place(step, found, "turning-box-global"),
        )
        point = GFCPoint(v=step.v, r=step.r)
        found.append(Instance(problem, point, "planted to rounding", properties=_properties(step)))
    return found


def _friction(step: SequenceStep) -> Vector:
    return np.full(len(step.contacts.id), MU)


def _place(step: SequenceStep, earlier: list[Instance], name: str) -> dict[str, Any]:
    previous = earlier[-1].problem.fingerprint if earlier else ""
    sequence = Sequence(name=name, step=step.index, time=(SETTLING + step.index) * DT, dt=DT, previous=previous)
    return {"name": f"step-{step.index:03d}", "sequence": sequence, "contacts": step.contacts}


def _properties(step: SequenceStep) -> dict[str, Any]:
    """Count the contacts that push, and those of these that slide."""
    R = step.r.reshape(-1, 3)
    pushing = R[:, 0] > 0
    sliding = pushing & (np.hypot(R[:, 1], R[:, 2]) >= MU * R[:, 0] * (1 - 1e-12))
    return {"contacts": len(R), "pushing": int(pushing.sum()), "sliding": int(sliding.sum())}


@cache
def scene() -> tuple[SequenceStep, ...]:
    """Simulate the sequence and return its kept steps, in order."""
    return tuple(step for step in _run(_at_rest()) if step.index >= 0)


def _at_rest() -> Body:
    """Place 18 spheres of three sizes in two layers, a little out of line."""
    rng = generator(45)
    place = (-0.65, 0.0, 0.65)
    x = np.array([[a, b, c] for c in (-0.62, 0.05) for b in place for a in place])
    x = x + rng.integers(-5, 6, x.shape) / 256
    radius = np.array([0.25, 0.28125, 0.3125])[rng.integers(3, size=len(x))]
    mass = DENSITY * radius**3
    M = np.column_stack([mass, 0.4 * mass * radius**2]).repeat(3, axis=1).ravel()
    return Body(x, np.zeros((len(x), 6)), radius, M)


def _run(body: Body) -> Iterator[SequenceStep]:
    last: dict[int, float] = {}
    for index in range(-SETTLING, STEPS):
        contacts, gap = _contacts(body, SPIN * DT * (SETTLING + index))
        H, w = _kinematics(body, contacts)
        w[::3] += gap / DT
        impulse = np.zeros_like(body.v)
        impulse[:, 2] = -GRAVITY * DT * body.M.reshape(-1, 6)[:, 2]
        f = body.M * body.v.ravel() + impulse.ravel()
        guess = np.zeros((len(gap), 3))
        guess[:, 0] = [last.get(int(i), 0.0) for i in contacts.id]
        r, u = _solve(H, w, f, body.M, guess, SOLVED if index >= 0 else SOLVED_ROUGHLY)
        v = (f + H @ r) / body.M
        w = u - H.T @ v
        last = dict(zip(contacts.id.tolist(), r[::3].tolist(), strict=True))
        moved = v.reshape(-1, 6)
        body = Body(body.x + DT * moved[:, :3], moved, body.radius, body.M)
        yield SequenceStep(index, contacts, H, f, w, v, r, body)


def _contacts(body: Body, angle: float) -> tuple[Contacts, Vector]:
    """Find the pairs whose gap is below MARGIN, and their gaps. Normals point to the first body; wall k is body n +
    k.
    """
    n, c, s = len(body.x), math.cos(angle), math.sin(angle)
    axes = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    walls = np.concatenate([axes, -axes])  # inward normals, 1 m from the centre
    found: list[tuple[int, int, Vector, Dense, float]] = []
    to_wall = body.x @ walls.T + 1.0 - body.radius[:, None]
    for i, k in np.argwhere(to_wall < MARGIN).tolist():
        tangent = walls[(k + 1) % 3]
        frame = np.array([walls[k], tangent, _cross(walls[k], tangent)])
        found.append((i, n + k, body.x[i] - body.radius[i] * walls[k], frame, float(to_wall[i, k])))
    for i in range(n):
        for j in range(i):
            apart = body.x[i] - body.x[j]
            distance = norm(apart)
            gap = distance - body.radius[i] - body.radius[j]
            if gap < MARGIN:
                normal = apart / distance
                found.append((i, j, body.x[j] + (body.radius[j] + gap / 2) * normal, _frame(normal), gap))
    found.sort(key=lambda contact: contact[:2])
    bodies = np.array([contact[:2] for contact in found], dtype=np.int64).reshape(-1, 2)
    contacts = Contacts(
        id=bodies[:, 0] * (n + 6) + bodies[:, 1],
        bodies=bodies,
        position=np.array([contact[2] for contact in found]).reshape(-1, 3),
        frame=np.array([contact[3] for contact in found]).reshape(-1, 3, 3),
    )
    return contacts, np.array([contact[4] for contact in found])


def _frame(normal: Vector) -> Dense:
    """Return the normal and two tangents that start from the axis it is farthest from: they jump where that changes."""
    tangent = _cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    tangent = tangent / norm(tangent)
    return np.array([normal, tangent, _cross(normal, tangent)])


def _cross(a: Vector, b: Vector) -> Vector:
    return np.asarray(np.cross(a, b), dtype=np.float64)


def _kinematics(body: Body, contacts: Contacts) -> tuple[sp.csr_array, Vector]:
    """Return H, and w of the walls alone: their velocity SPIN e_y × p at the contact point p, negative."""
    n, nc = len(body.x), len(contacts.id)
    H, w = np.zeros((6 * n, 3 * nc)), np.zeros((nc, 3))
    for c, ((first, second), p, F) in enumerate(
        zip(contacts.bodies.tolist(), contacts.position, contacts.frame, strict=True)
    ):
        for b, sign in ((first, 1.0), (second, -1.0)):
            if b < n:
                H[6 * b : 6 * b + 6, 3 * c : 3 * c + 3] = sign * np.hstack([F, np.cross(p - body.x[b], F)]).T
            else:
                w[c] -= F @ np.cross([0.0, SPIN, 0.0], p)
    return sp.csr_array(H), w.ravel()


def _solve(H: sp.csr_array, w: Vector, f: Vector, M: Vector, guess: Dense, tolerance: float) -> tuple[Vector, Vector]:
    """Solve for r and u of a step, complementary to rounding; u is Hᵀv⁺ + w up to what GRID and the tolerance leave.

    r ← P_K(r − ρû(r)) with ρ ≤ 1/λ_max(W), De Saxcé and Feng's fixed point, with Nesterov's momentum, dropped where it
    points back.
    """
    if not len(guess):
        return np.zeros(0), np.zeros(0)
    dense = H.toarray()
    W, q = dense.T @ (dense / M[:, None]), dense.T @ (f / M) + w
    mu, rho = np.full(len(guess), MU), 2.0 ** -math.ceil(math.log2(np.linalg.eigvalsh(W)[-1]))
    r, z, theta = guess, guess, 1.0
    y = guess
    for _ in range(ITERATIONS):
        y = z - rho * de_saxce((W @ z.ravel() + q).reshape(-1, 3), mu)
        following = project_friction_cone(y, mu)
        change, step = following - z, following - r
        r = following
        if norm(change.ravel()) <= tolerance * norm(r.ravel()):
            break
        theta = 1.0 if np.vdot(change, step) < 0 else theta
        smaller = 0.5 * (math.sqrt(theta**4 + 4 * theta**2) - theta**2)
        z = r + theta * (1.0 - theta) / (theta**2 + smaller) * step
        theta = smaller
    y = np.round(y / GRID) * GRID
    r = project_friction_cone(y, mu)
    u = (r - y) / rho
    u[:, 0] -= mu * np.hypot(u[:, 1], u[:, 2])
    return r.ravel(), u.ravel()
