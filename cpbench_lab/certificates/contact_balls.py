"""Contacts with friction as a smooth square system, by the state of each contact, and its conditions in balls.

    open        r = 0                               certain: u_N ≥ 0
    stick       u = 0                               certain: ‖r_T‖ ≤ μ r_N
    slide       u_N = 0, ‖u_T‖r_T + μr_N u_T = 0    certain: r_N ≥ 0, u_T ≠ 0
    smooth      u_N = 0, r_T = 0                    certain: r_N ≥ 0 (contacts with μ = 0)

Beside them stand the free unknowns y of linear equations: (v, λ) of the global form, λ of the mixed one.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.sparse as sp
from flint import arb
from numpy.typing import NDArray

from cpbench.foundation.matrices import Dense, Sparse, Vector
from cpbench_lab.certificates.exact_rows import Index
from cpbench_lab.certificates.krawczyk import PARTS, Enclosed, digits, enclose, no_box, up
from cpbench_lab.certificates.mixed import linear_part
from cpbench_lab.certificates.redundant import implied, reduced

OPEN, STICK, SLIDE, SMOOTH = 0, 1, 2, 3
NAMES = ("open", "sticking", "sliding", "without friction")
States = NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Scene:
    """Contacts in space, u = Vx + q, with equations Lx + a = 0, x = (y, r).

    Attributes
    ----------
    L : (k, N). a : (k,). V : (3nc, N). q : (3nc,). mu : (nc,). k : number of unknowns y.
    """

    L: Sparse
    a: Vector
    V: Sparse
    q: Vector
    mu: Vector

    @classmethod
    def of(cls, problem: Any, point: Any) -> tuple[Scene, Vector]:
        """Return the scene of a problem (fc, fcm, gfc in space), and the point as x."""
        free, r, U, W, q, (A, B, a) = linear_part(problem, point)
        L, V = sp.csr_array(sp.hstack([A, B])), sp.csr_array(sp.hstack([U, W]))
        return cls(L, a, V, q, problem.mu), np.concatenate([free, r])

    @property
    def k(self) -> int:
        """Unknowns before r."""
        return self.a.size

    @cached_property
    def dense(self) -> tuple[Dense, Dense]:
        """L, and V by contacts: (nc, 3, N)."""
        return self.L.toarray(), self.V.toarray().reshape(self.mu.size, 3, -1)

    @cached_property
    def equations(self) -> BallRows:
        """Lx + a."""
        return BallRows.of(self.L, self.a)

    @cached_property
    def velocities(self) -> BallRows:
        """Vx + q."""
        return BallRows.of(self.V, self.q)

    def sizes(self, x: Vector) -> Vector:
        """Positive sizes of the unknowns: of all velocities, joint forces and reactions together."""
        y, r = np.abs(x[: self.k]).max(initial=0.0), np.abs(x[self.k :]).max(initial=0.0)
        return np.where(np.arange(x.size) < self.k, y or 1.0, r or 1.0)


@dataclass(frozen=True, eq=False)
class BallRows:
    """Rows of exact numbers, and constants."""

    rows: list[list[tuple[int, Any]]]
    constants: list[Any]

    @classmethod
    def of(cls, matrix: Sparse, constants: Vector) -> BallRows:
        """Take every double as it is."""
        ends = matrix.indptr.tolist()
        entries = list(zip(matrix.indices.tolist(), map(arb, matrix.data.tolist()), strict=True))
        return cls([entries[a:b] for a, b in pairwise(ends)], list(map(arb, constants.tolist())))

    def __call__(self, x: Sequence[Any]) -> list[Any]:
        """Matrix · x + constants, in balls."""
        return [sum((v * x[j] for j, v in row), c) for row, c in zip(self.rows, self.constants, strict=True)]


@dataclass(frozen=True, eq=False)
class ContactSystem:
    """The scene with a state for every contact."""

    scene: Scene
    states: States

    def residual(self, x: Sequence[Any]) -> list[Any]:
        """Equations of y, then three a contact."""
        scene = self.scene
        u, r = scene.velocities(x), x[scene.k :]
        rows = scene.equations(x)
        for c, state in enumerate(self.states.tolist()):
            at = slice(3 * c, 3 * c + 3)
            (u_N, *u_T), (r_N, *r_T) = u[at], r[at]
            if state == OPEN:
                rows += r[at]
            elif state == STICK:
                rows += u[at]
            elif state == SMOOTH:
                rows += [u_N, *r_T]
            else:
                speed, limit = norm(u_T), arb(float(scene.mu[c])) * r_N
                rows += [u_N, *(speed * a + limit * b for a, b in zip(r_T, u_T, strict=True))]
        return rows

    def jacobian(self, x: Sequence[Any]) -> tuple[Dense, Dense]:
        """Blocks ∂/∂u · V + ∂/∂r of the contacts below L."""
        scene, nc = self.scene, self.states.size
        by_u, by_r = (np.zeros((2, nc, 3, 3)) for _ in range(2))
        for c, state in enumerate(self.states.tolist()):
            if state == OPEN:
                by_r[0, c] = np.eye(3)
            elif state == STICK:
                by_u[0, c] = np.eye(3)
            elif state == SMOOTH:
                by_u[0, c, 0, 0] = by_r[0, c, 1, 1] = by_r[0, c, 2, 2] = 1.0
        sliding = np.flatnonzero(self.states == SLIDE)
        u = scene.velocities(x) if sliding.size else []
        for c in sliding.tolist():
            self._slide(c, u[3 * c + 1 : 3 * c + 3], x[scene.k + 3 * c : scene.k + 3 * c + 3], by_u[:, c], by_r[:, c])
        L, V = scene.dense
        if not np.isfinite(by_u).all():
            nothing = np.full((L.shape[0] + 3 * nc, L.shape[1]), np.nan)
            return nothing, nothing
        centre = np.matmul(by_u[0], V)
        # three products and a sum: four roundings; and what the balls leave open
        spread = (5 * 2.0**-53 * np.matmul(np.abs(by_u[0]), np.abs(V)) + np.matmul(by_u[1], np.abs(V))) * (1 + 1e-9)
        for c in range(nc):
            own = slice(scene.k + 3 * c, scene.k + 3 * c + 3)
            centre[c, :, own] += by_r[0, c]
            spread[c, :, own] += by_r[1, c] + 2.0**-52 * np.abs(centre[c, :, own])
        rest, none = centre.reshape(3 * nc, -1), np.zeros_like(L)
        return np.vstack([L, rest]), np.vstack([none, spread.reshape(3 * nc, -1) * (1 + 1e-9) + 1e-300])

    def _slide(self, c: int, u_T: Sequence[Any], r: Sequence[Any], by_u: Any, by_r: Any) -> None:
        """Write derivatives of (u_N, ‖u_T‖r_T + μr_N u_T) as centres and radii."""
        mu, speed = arb(float(self.scene.mu[c])), norm(u_T)
        by_u[0, 0, 0] = 1.0
        for i in range(2):
            by_r[:, 1 + i, 1 + i] = pair(speed)
            by_r[:, 1 + i, 0] = pair(mu * u_T[i])
            for j in range(2):
                by_u[:, 1 + i, 1 + j] = pair(r[1 + i] * u_T[j] / speed + (mu * r[0] if i == j else arb(0)))

    def broken(self, x: Sequence[Any]) -> list[tuple[int, int | None]]:
        """Contacts whose conditions are not certain, with the state that is certain to be nearer, where one is."""
        result: list[tuple[int, int | None]] = []
        u, r = self.scene.velocities(x), x[self.scene.k :]
        for c, state in enumerate(self.states.tolist()):
            (u_N, *u_T), (r_N, *r_T) = u[3 * c : 3 * c + 3], r[3 * c : 3 * c + 3]
            mu = arb(float(self.scene.mu[c]))
            rub, limit = square(r_T), mu * r_N * mu * r_N
            if state == OPEN and not u_N >= 0:
                result.append((c, (SLIDE if mu != 0 else SMOOTH) if u_N < 0 else None))
            elif state == STICK and not (r_N >= 0 and rub <= limit):
                result.append((c, OPEN if r_N < 0 else SLIDE if r_N > 0 and rub > limit else None))
            elif state in (SLIDE, SMOOTH) and not r_N >= 0:
                result.append((c, OPEN if r_N < 0 else None))
            elif state == SLIDE and not square(u_T) > 0:
                result.append((c, None))
        return result


def square(balls: Sequence[Any]) -> Any:
    """Return Σ a² of balls."""
    return sum((a * a for a in balls), arb(0))


def norm(balls: Sequence[Any]) -> Any:
    """Return √(a² + b²) of balls; no number where the balls hold 0."""
    return square(balls).sqrt()


def pair(ball: Any) -> tuple[float, float]:
    """Centre and radius in doubles, not finite where the ball is not."""
    if not ball.is_finite():
        return np.nan, np.inf
    centre = float(ball.mid())
    return centre, up(ball - arb(centre))


def states_of(scene: Scene, x: Vector) -> States:
    """States of the contacts of an answer: open where the velocity outweighs the force, in units of both.

    The unit of velocities is the largest one, of the answer or without contact: at rest all are rounding errors.
    """
    u, r = (scene.V @ x + scene.q).reshape(-1, 3), x[scene.k :].reshape(-1, 3)
    force, speed = np.abs(r).max(initial=0.0) or 1.0, max(np.abs(u).max(initial=0.0), _free_speed(scene)) or 1.0
    rubs = np.linalg.norm(r[:, 1:], axis=1)
    slips = np.linalg.norm(u[:, 1:], axis=1)
    room = (scene.mu * r[:, 0] - rubs) / np.where(r[:, 0] > 0, np.maximum(scene.mu, 1e-300) * r[:, 0], 1.0)
    states = np.where(room > slips / speed, STICK, SLIDE)
    states = np.where(scene.mu == 0, SMOOTH, states)
    return np.where(u[:, 0] / speed >= r[:, 0] / force, OPEN, states).astype(np.int8)


def _free_speed(scene: Scene) -> float:
    """Return the largest velocity of contacts without reactions."""
    y = np.zeros(scene.k)
    if scene.k:
        y = np.linalg.lstsq(scene.dense[0][:, : scene.k], -scene.a)[0]
    return float(np.abs(scene.V[:, : scene.k] @ y + scene.q).max(initial=0.0))


# ---------------------------------------------------------------------------------------------------------------- boxes

ROUNDS = 12
LARGEST = 3000
"""Unknowns of the largest system that is enclosed: its inverse is dense."""


def enclose_contacts(scene: Scene, x: Vector, seconds: float) -> Enclosed:
    """Find a box that holds a solution near x, within about so many seconds."""
    deadline = time.perf_counter() + seconds
    states = states_of(scene, x)
    if x.size > LARGEST:
        return no_box(states, f"{x.size} unknowns hang together, {LARGEST} is the most that is enclosed")
    units, reason, tried = scene.sizes(x), "", set[bytes]()
    for _ in range(ROUNDS):
        if states.tobytes() in tried or time.perf_counter() > deadline:
            break
        tried.add(states.tobytes())
        system = ContactSystem(scene, states)
        dropped = _implied(scene, states)
        open_rows = scene.k + np.flatnonzero(np.repeat(states == OPEN, 3))
        part = reduced(system, dropped, _start(scene, states, x), units, open_rows)
        box = enclose(part, part.held[part.columns], units[part.columns])
        if box.reason:
            return no_box(states, reason or _hyperstatic(scene, states, box.reason))
        with digits():
            wrong = system.broken(part.full(box.x))
        if not wrong:
            centre, radius = np.zeros((x.size, PARTS)), np.zeros(x.size)
            centre[:, 0] = part.held
            centre[part.columns], radius[part.columns] = box.centre, box.radius
            return Enclosed(states, dropped, centre, radius)
        c, better = wrong[0]
        more = f", and {len(wrong) - 1} more" if len(wrong) > 1 else ""
        word = "grazes: it cannot be told whether it is" if better is None else "is not"
        reason = reason or f"contact {c} {word} {NAMES[states[c]]}{more}"
        if all(state is None for _, state in wrong):
            return no_box(states, reason)
        states = states.copy()
        for at, state in wrong:
            if state is not None:
                states[at] = state
    return no_box(states, reason or "the time is over")


def _implied(scene: Scene, states: States) -> Index:
    """Equations u = 0 of closed contacts that the others imply, by their places in the system."""
    places = 3 * np.arange(states.size)[:, None] + np.arange(3)
    linear = np.where(states[:, None] == STICK, True, (states[:, None] != OPEN) & (np.arange(3) == 0))
    own = places[linear]
    if np.linalg.matrix_rank(scene.V[own].toarray()) == own.size:  # a hint that saves time: none may be implied
        return np.zeros(0, dtype=np.int64)
    return scene.k + own[implied(sp.csr_array(scene.V[own]), scene.q[own])]


def _start(scene: Scene, states: States, x: Vector) -> Vector:
    """Return the answer, with no force where a contact is open."""
    start = x.copy()
    start[scene.k :].reshape(-1, 3)[states == OPEN] = 0.0
    return start


def _hyperstatic(scene: Scene, states: States, reason: str) -> str:
    """Say so where contacts that stick or press outnumber what their velocities can tell apart."""
    _, V = scene.dense
    closed = np.flatnonzero(np.isin(states, (STICK, SLIDE)))
    if not closed.size:
        return reason
    rows = np.concatenate([V[c, :, :] if states[c] == STICK else V[c, :1, :] for c in closed])
    values = np.linalg.svd(rows, compute_uv=False)
    rank = int((values > 1e-12 * values[0]).sum())
    if rank < rows.shape[0]:
        return f"hyperstatic: {rows.shape[0]} velocities of closed contacts are 0, of which {rank} are independent"
    return reason
