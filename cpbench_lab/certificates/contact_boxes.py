"""Boxes around answers to contact problems in space, by the states of their contacts."""

from __future__ import annotations

import time

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.contact_balls import NAMES, OPEN, SLIDE, STICK, ContactSystem, Scene, States, states_of
from cpbench_lab.certificates.exact_rows import Index
from cpbench_lab.certificates.krawczyk import PARTS, Enclosed, digits, enclose, no_box
from cpbench_lab.certificates.redundant import implied, reduced

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
