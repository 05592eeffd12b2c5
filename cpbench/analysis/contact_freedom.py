"""Freedom that an answer with contacts leaves: forces that others may replace, and motions beside that at rest."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.linalg as sla

from cpbench.analysis.contact_states import State, contact_states
from cpbench.analysis.contact_table import contact_ids
from cpbench.formulations.base import Point
from cpbench.formulations.contact import ContactProblem, without_motion
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Vector, norm
from cpbench.foundation.text import counted, some_of

LIMIT, RANK, EDGES = 300, 1e-9, 16
"""The most rows of contacts, bodies and joints that are looked at; the least singular value, over the largest; edges of
a cone in it."""


def freedom_lines(problem: ContactProblem, point: Point, tolerance: float) -> Iterator[str]:
    """Yield a line for each thing that an answer leaves open."""
    names = contact_ids(problem).astype(str)
    if immobile := without_motion(problem):
        which = some_of(names[immobile].tolist(), 8)
        yield f"  W_NN = 0 at {counted(len(immobile), 'contact')} ({which}): no force moves it along its normal"
    if (free := _free_forces(problem, point, tolerance)).size:
        r, wide = point.arrays()["r"], _free_forces(problem, point, tolerance, wide=True)
        least = norm(np.linalg.qr(wide)[0].T @ r) <= tolerance * norm(r)
        shown = "; these are those of least norm" if least else ""
        size = np.linalg.norm(free.reshape(problem.nc, -1), axis=1)
        which = some_of(names[size > 1e-6 * size.max()].tolist(), 8)
        many = counted(free.shape[1], "dimension")
        yield f"  forces are not unique (hyperstatic, of {many}): contacts {which}{shown}"
    if problem.nc and _holds_at_rest(problem, point):
        yield "  the motion is not unique: forces at the contacts can hold all at rest, too (cpbench sweep --bisect)"
    count, contacts, _ = moving(problem, point, tolerance)
    if count:
        which = some_of(names[contacts].tolist(), 8)
        yield f"  the motion is not unique (of {counted(count, 'dimension')}): contacts {which} may slide otherwise"


def moving(problem: ContactProblem, point: Point, tolerance: float) -> tuple[int, list[int], Vector]:
    """Return of how many dimensions the other motions near an answer are, the contacts that move otherwise in one, and
    the reactions there.

    Near an answer forces and velocities keep the state of each contact: 0 at an open one, u = 0 at one that sticks, u_N
    = 0 and r_T = −μ r_N u_T/‖u_T‖ at one that slips. The answer is moved onto these equations by Newton steps; the null
    space of their derivative, where that changes velocities, are the other motions: sliding contacts of which loads may
    shift without a motion, but not their friction. One of them, 1 % or 0.1 % away, has to meet the law of contact, too.
    """
    n, d = problem.nc * problem.dimension, problem.dimension
    if not _small(problem) or hasattr(problem, "mu_r") or problem.node == "afc":
        return 0, [], np.zeros(n)
    states, unit = contact_states(problem, point, tolerance), np.repeat(np.sqrt(problem.rho), d)
    W, eye, nc = unit[:, None] * _mobility(problem) * unit, np.eye(n), problem.nc
    start, velocity = states.r.ravel() / unit, states.u.ravel() * unit

    def law(x: Vector) -> tuple[Vector, Dense]:
        u = (velocity + W @ (x - start)).reshape(nc, d)
        rest, slope = x.copy(), eye.copy()
        for c in np.flatnonzero(states.state != str(State.OPEN)).tolist():
            at, (normal, *tangents) = slice(c * d, (c + 1) * d), range(c * d, (c + 1) * d)
            slips = states.state[c] == str(State.SLIP) or problem.mu[c] == 0.0
            still = slice(normal, normal + 1) if slips else at
            rest[still], slope[still] = u.ravel()[still], W[still]
            if slips:
                size, push = norm(u[c, 1:]) or 1.0, problem.mu[c] * x[normal]
                e = u[c, 1:] / size
                rest[tangents] = x[tangents] + push * e
                slope[tangents] += problem.mu[c] * np.outer(e, eye[normal])
                slope[tangents] += push / size * (np.eye(d - 1) - np.outer(e, e)) @ W[tangents]
        return rest, slope

    def settled(x: Vector) -> Vector:
        for _ in range(8):
            rest, slope = law(x)
            x = x - np.linalg.lstsq(slope, rest, rcond=1e-6)[0]
        return x

    x = settled(start)
    _, s, vt = np.linalg.svd(law(x)[1])
    null = vt[s <= RANK * s.max(initial=0.0)].T
    _, gains, mix = np.linalg.svd(W @ null, full_matrices=False)
    count = int((gains > 1e-6 * np.abs(W).max()).sum())
    y = velocity + W @ (x - start)
    if not count:
        return 0, [], x * unit
    scale = max(norm(x), norm(y))
    for step in (0.01, -0.01, 1e-3, -1e-3):
        other = settled(x + step * norm(y) / gains[0] * null @ mix[0])
        r, u = (given.reshape(nc, d) for given in (other, y + W @ (other - x)))
        inside = np.linalg.norm(r[:, 1:], axis=1) <= problem.mu * r[:, 0] + 1e-9 * scale
        change = np.abs(W @ (other - x)).reshape(nc, d).max(axis=1)
        exact = max(norm(law(at)[0]) for at in (x, other)) <= 1e-9 * scale
        if exact and inside.all() and u[:, 0].min() >= -1e-9 * scale and norm(change) >= 1e-4 * norm(y):
            return count, np.flatnonzero(change > 0.1 * change.max()).tolist(), other * unit
    return 0, [], x * unit


def least_forces(problem: ContactProblem, point: Point, tolerance: float) -> Point | None:
    """Return the answer with the forces of least norm among those that do the same; None where they are unique, or
    where the least are not in their cones."""
    free = _free_forces(problem, point, tolerance, wide=True)
    if problem.node not in ("fc", "gfc") or not free.size or getattr(problem, "b", np.zeros(0)).size:
        return None
    r: Vector = point.arrays()["r"]
    q, _ = np.linalg.qr(free)
    return type(point)(**{**point.arrays(), "r": r - q @ (q.T @ r)})


def _mobility(problem: Any) -> Dense:
    """Return W of u = Wr + const, where joints react as they must."""
    if problem.node not in ("gfc", "grfc"):
        W = matrices.dense(problem.W)
        if problem.node != "fcm":
            return W
        V = matrices.dense(problem.V)
        return W - V @ np.linalg.pinv(matrices.dense(problem.R), rcond=RANK) @ V.T
    row = 1.0 / np.sqrt(np.maximum(problem.M.diagonal(), np.finfo(float).tiny))[:, None]
    H, G = (row * matrices.dense(part) for part in (problem.H, problem.G))
    joints = np.zeros((G.shape[1], G.shape[1]))
    system = np.block([[row * matrices.dense(problem.M) * row.T, G], [G.T, joints]])
    pushes = np.vstack([H, np.zeros((G.shape[1], H.shape[1]))])
    return H.T @ np.linalg.lstsq(system, pushes, rcond=RANK)[0][: len(H)]


def _small(problem: Any) -> bool:
    """Return whether a problem is one of those that are looked at."""
    wide = max([problem.nc * problem.dimension, *(getattr(problem, part, np.zeros(0)).size for part in "fb")])
    return problem.node in ("fc", "afc", "rfc", "gfc", "grfc", "fcm") and problem.nc > 0 and wide <= LIMIT


def _free_forces(problem: ContactProblem, point: Point, tolerance: float, *, wide: bool = False) -> Dense:
    """Return a basis of the changes of reactions at contacts that change no motion, near which all stay in their cones.
    With `wide` all reactions of contacts at rest may change, and leave their cones.

    At a contact that sticks inside its cone all reactions may change, at another one with a reaction its size, and at
    an open one nothing. The null space is that of a singular value decomposition, with singular values of at most 1e-9
    of the largest taken as 0 in units √ρ; changes of the reactions of joints alone do not count.
    """
    rows = problem.nc * problem.dimension
    if not _small(problem):
        return np.zeros((rows, 0))
    states = contact_states(problem, point, tolerance)
    d, r = problem.dimension, point.arrays()["r"].reshape(problem.nc, -1)
    inside = (states.state == str(State.STICK)) & (np.linalg.norm(states.share, axis=1) < 1.0 - 1e-4)
    if wide:
        size, speed = np.linalg.norm(states.r, axis=1), np.linalg.norm(states.u, axis=1)
        scale = max(norm(size / np.sqrt(problem.rho)), norm(np.sqrt(problem.rho) * speed))
        inside |= np.sqrt(problem.rho) * speed <= tolerance * scale
    columns = []
    for c in np.flatnonzero((states.state != str(State.OPEN)) | inside).tolist():
        may = [0, *(1 + np.flatnonzero(states.mu[c] > 0.0))] if inside[c] else []
        block = np.eye(d)[:, may] if may else (r[c] / norm(r[c]))[:, None]
        columns.append(np.pad(block, ((c * d, rows - (c + 1) * d), (0, 0))))
    if not columns:
        return np.zeros((rows, 0))
    basis = np.sqrt(problem.effective_mass)[:, None] * np.hstack(columns)
    image = np.sqrt(problem.effective_mass)[:, None] * (_mobility(problem) @ basis)
    _, s, vt = np.linalg.svd(image)
    return basis @ vt[int((s > RANK * s.max(initial=0.0)).sum()) :].T


def _holds_at_rest(problem: Any, point: Point) -> bool:
    """Return whether an answer moves though forces, in pyramids inside the cones, hold all at rest, to rounding."""
    d, slack = problem.dimension, problem.slacks(point)["u"]
    if problem.node == "gfc" and not (problem.w.any() or problem.b.any()):
        row = 1.0 / np.sqrt(np.maximum(problem.M.diagonal(), np.finfo(float).tiny))
        A, joints = (row[:, None] * matrices.dense(part) for part in (problem.H, problem.G))
        load, free = row * problem.f, problem.free_velocity
    elif problem.node == "fc":
        A, joints, load, free = matrices.dense(problem.W), np.zeros((problem.q.size, 0)), problem.q, problem.q
    else:
        return False
    if not _small(problem) or norm(slack) <= 1e-2 * norm(free):
        return False
    from scipy.optimize import nnls  # slow to import

    angles = 2.0 * np.pi / EDGES * np.arange(EDGES) if d == 3 else np.array([0.0, np.pi])
    round_ = np.vstack([np.cos(angles), np.sin(angles)])[: d - 1]
    edges = [np.vstack([np.ones((1, angles.size)), mu * round_]) for mu in problem.mu]
    pushes = A @ sla.block_diag(*edges)
    G = np.hstack([pushes, joints, -joints])
    size = np.linalg.norm(G, axis=0)
    try:
        _, rest = nnls(G / np.where(size > 0.0, size, 1.0), -load)
    except RuntimeError:  # its iterations were not enough
        return False
    return bool(rest <= 1e-9 * norm(load))
