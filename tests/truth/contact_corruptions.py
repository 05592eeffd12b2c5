"""Right answers of real contact files with one contact corrupted: none may pass that misses Coulomb's law, unflagged.

How wrong a corrupted contact is, is said by its own law in its own units (Acary & Brogliato, *Numerical Methods for
Nonsmooth Dynamical Systems*, 2008, ch. 3), by NumPy alone.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import cpbench
from cpbench.errors import CpbenchError
from cpbench.foundation import matrices
from cpbench.verification import judge

Array = np.ndarray
MISSED = 0.05
"""A contact that misses its law by more than this share of its own size is wrong."""
FLAGS = ("contact", "direction")
"""The verdict's remarks that say so of an accepted answer."""
SOLVERS = ("proximal-newton", "auto-fc", "nsgs")
CONTACTS_OF_A_FILE = 40


def _into_ball(x: Array, radius: float) -> Array:
    size = float(np.linalg.norm(x))
    return x if size <= radius else x * (radius / size)


def missed_by(problem: Any, r: Array, inertia: Array) -> float:
    """Return the worst miss of Coulomb's law over all contacts, each over its own size.

    A contact's size is the largest of ‖r_c‖, ρ_c‖u_c‖ and ρ_c‖q_c‖ with ρ_c = d/trace W_cc (`inertia`, in kg). It can
    miss the cone, tension, penetration, normal complementarity, and friction (stick, or slip against the reaction).
    """
    d, nc = problem.dimension, problem.nc
    R, Q = r.reshape(nc, d), np.asarray(problem.q).reshape(nc, d) * inertia[:, None]
    U = (problem.W @ r + problem.q).reshape(nc, d) * inertia[:, None]
    sizes = np.max([np.linalg.norm(X, axis=1) for X in (R, U, Q)], axis=0)
    worst = 0.0
    for c in np.flatnonzero(sizes):
        rc, uc, mu = R[c] / sizes[c], U[c] / sizes[c], float(problem.mu[c])
        cone = max(0.0, float(np.linalg.norm(rc[1:])) - mu * rc[0]) / max(1.0, mu)
        normal = max(-rc[0], -uc[0], min(max(rc[0], 0.0), max(uc[0], 0.0)))
        sliding = float(np.linalg.norm(rc[1:] - _into_ball(rc[1:] - uc[1:], mu * max(rc[0], 0.0))))
        worst = max(worst, cone, normal, sliding)
    return worst


def inertias(problem: Any) -> Array:
    """Return d/trace W_cc of each contact [kg], 1 where the trace is not positive; shape (nc,)."""
    d = problem.dimension
    traces = matrices.dense(problem.W).diagonal().reshape(problem.nc, d).sum(axis=1)
    return np.where(traces > 0, d / np.where(traces > 0, traces, 1.0), 1.0)


def right_answer(problem: Any, seconds: float = 4.0) -> Array | None:
    """Return reactions that are right to 1e-8 by the verdict and miss no contact's law by more than MISSED."""
    best: tuple[float, Array] | None = None
    for solver in SOLVERS:
        try:
            found = cpbench.solve(problem, solver, tolerance=1e-10, seconds=seconds)
        except CpbenchError:
            continue
        if found.point is not None and found.point.finite and (best is None or found.error < best[0]):
            best = found.error, np.asarray(found.point.r)
        if best is not None and best[0] < 1e-9:
            break
    return best[1] if best is not None and best[0] <= 1e-8 else None


def corrupted(problem: Any, r: Array, contacts: Array) -> Iterator[tuple[int, str, Array]]:
    """Yield contact, kind and reactions: zero, doubled, halved, friction reversed, swapped or turned, pressed more."""
    d, nc = problem.dimension, problem.nc
    R = r.reshape(nc, d)
    sizes = np.linalg.norm(R, axis=1)
    for c in contacts:
        own = R[c]
        kinds = {
            "zero": 0.0 * own,
            "doubled": 2.0 * own,
            "halved": 0.5 * own,
            "friction reversed": np.concatenate([own[:1], -own[1:]]),
            "pressed": own + np.eye(d)[0] * 1e-3 * sizes.max(),
        }
        if d == 3:
            kinds |= {"tangents swapped": own[[0, 2, 1]], "turned": np.array([own[0], -own[2], own[1]])}
        for kind, changed in kinds.items():
            X = R.copy()
            X[c] = changed
            if np.abs(X - R).max() >= 1e-12 * max(float(sizes.max()), 1e-300):
                yield int(c), kind, X.ravel()


@dataclass(frozen=True)
class Corruption:
    """One corrupted answer under one ε."""

    file: str
    contact: int
    kind: str
    epsilon: float
    error: float
    missed: float
    flags: tuple[str, ...]

    @property
    def unflagged(self) -> bool:
        """Passes with a contact that misses its law, and nothing says so."""
        passes = self.error <= self.epsilon and "unresolvable" not in self.flags and self.missed > MISSED
        return passes and not any(flag in self.flags for flag in FLAGS)


def corruptions(name: str, problem: Any, r: Array, epsilon: float) -> Iterator[Corruption]:
    """Yield the verdict on every corruption of a right answer; `missed` is computed where one passes."""
    inertia, point = inertias(problem), type(problem.zero_point())
    every = np.arange(problem.nc)
    if problem.nc > CONTACTS_OF_A_FILE:
        every = np.random.default_rng(zlib.crc32(name.encode())).choice(every, CONTACTS_OF_A_FILE, replace=False)
    for contact, kind, x in corrupted(problem, r, every):
        verdict = judge(problem, point(x), epsilon)
        missed = missed_by(problem, x, inertia) if verdict.error <= epsilon else np.nan
        yield Corruption(name, contact, kind, epsilon, verdict.error, missed, tuple(verdict.flags))
