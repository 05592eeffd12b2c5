"""Freedom that an answer with contacts leaves: forces that others may replace, and motions beside that at rest."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.linalg as sla

from cpbench.analysis.contact_states import State, contact_states
from cpbench.formulations.base import Point
from cpbench.formulations.contact import ContactProblem, without_motion
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Vector, norm
from cpbench.foundation.text import counted

LIMIT, RANK, EDGES = 300, 1e-9, 16
"""The most rows and columns that are looked at; the least singular value, over the largest; edges of a cone in it."""


def freedom_lines(problem: ContactProblem, point: Point, tolerance: float) -> Iterator[str]:
    """Yield a line for each thing that an answer leaves open."""
    if immobile := without_motion(problem):
        yield f"  W_NN = 0 at {counted(len(immobile), 'contact')} {immobile}: no force moves it along its normal"
    if (free := _free_forces(problem, point, tolerance)).size:
        r, wide = point.arrays()["r"], _free_forces(problem, point, tolerance, wide=True)
        least = norm(np.linalg.qr(wide)[0].T @ r) <= tolerance * norm(r)
        shown = "; these are those of least norm" if least else ""
        yield f"  forces are not unique (hyperstatic, of {counted(free.shape[1], 'dimension')}){shown}"
    if problem.nc and _holds_at_rest(problem, point):
        yield "  the motion is not unique: forces at the contacts can hold all at rest, too (cpbench sweep --bisect)"


def least_forces(problem: ContactProblem, point: Point, tolerance: float) -> Point | None:
    """Return the answer with the forces of least norm among those that do the same; None where they are unique, or
    where the least are not in their cones."""
    free = _free_forces(problem, point, tolerance, wide=True)
    if problem.node not in ("fc", "gfc") or not free.size or getattr(problem, "b", np.zeros(0)).size:
        return None
    r: Vector = point.arrays()["r"]
    q, _ = np.linalg.qr(free)
    return type(point)(**{**point.arrays(), "r": r - q @ (q.T @ r)})


def _equations(problem: Any) -> tuple[Dense, Dense]:
    """Return the matrices by which reactions of contacts, and of joints, move or load bodies, in units of their own."""
    if problem.node in ("gfc", "grfc"):
        row = 1.0 / np.sqrt(np.maximum(problem.M.diagonal(), np.finfo(float).tiny))
        return row[:, None] * matrices.dense(problem.H), row[:, None] * matrices.dense(problem.G)
    W = matrices.dense(problem.W)
    if problem.node != "fcm":
        return np.sqrt(problem.effective_mass)[:, None] * W, np.zeros((len(W), 0))
    V, R = matrices.dense(problem.V), matrices.dense(problem.R)
    return np.vstack([W, V.T]), np.vstack([V, R])


def _free_forces(problem: ContactProblem, point: Point, tolerance: float, *, wide: bool = False) -> Dense:
    """Return a basis of the changes of reactions at contacts that change no motion, near which all stay in their cones.
    With `wide` all reactions of contacts at rest may change, and leave their cones.

    At a contact that sticks inside its cone all reactions may change, at another one with a reaction its size, and at
    an open one nothing. The null space is that of a singular value decomposition, with singular values of at most 1e-9
    of the largest taken as 0 in units √ρ; changes of the reactions of joints alone do not count.
    """
    rows = problem.nc * problem.dimension
    if rows > LIMIT or problem.node not in ("fc", "afc", "rfc", "gfc", "grfc", "fcm"):
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
    A, joints = _equations(problem)
    u, s, _ = np.linalg.svd(joints, full_matrices=False)
    kept = u[:, s > RANK * s.max(initial=0.0)]
    image = A @ basis
    _, s, vt = np.linalg.svd(image - kept @ (kept.T @ image))
    return basis @ vt[int((s > RANK * s.max(initial=0.0)).sum()) :].T


def _holds_at_rest(problem: Any, point: Point) -> bool:
    """Return whether an answer moves though forces, in pyramids inside the cones, hold all at rest, to rounding."""
    d, slack = problem.dimension, problem.slacks(point)["u"]
    if problem.node == "gfc" and not (problem.w.any() or problem.b.any()):
        (A, joints), load, free = _equations(problem), problem.f, problem.free_velocity
        load = load / np.sqrt(np.maximum(problem.M.diagonal(), np.finfo(float).tiny))
    elif problem.node == "fc":
        A, joints, load, free = matrices.dense(problem.W), np.zeros((problem.q.size, 0)), problem.q, problem.q
    else:
        return False
    if max(A.shape) > LIMIT or norm(slack) <= 1e-2 * norm(free):
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
