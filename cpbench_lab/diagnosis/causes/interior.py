"""Conditions that leave no room: no point meets all of them strictly."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.optimize import linprog

from cpbench.formulations.base import Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.linear import AVI
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.proofs.polyhedra import Polyhedron, conditions
from cpbench_lab.diagnosis.case import Cause, FailedTrial

ROOM = 1e-9
"""Room, over the size of the rows, below which there is none: what the linear program leaves."""
LARGEST = 3000
"""Unknowns of the largest linear program."""


def no_interior(case: FailedTrial) -> Cause | None:
    """Find the point with the most room to the sides of all inequalities, by a linear program."""
    # contact without friction leaves no room to the tangents, and needs none; those of an AVI have its multipliers
    if isinstance(case.problem, ContactProblem | AVI):
        return None
    P = _around_cones(case.problem) if case.problem.node == "coneqp" else conditions(case.problem)
    if P is None or P.lb.size > LARGEST:
        return None
    room = _room(case.problem, P)
    if room is None or room > ROOM:
        return None
    return Cause(
        kind="no interior",
        evidence=f"no point meets its inequalities with more room than {max(0.0, room):.1e} of the size of their rows",
        numbers={"room": room},
        without=_relaxed(case),
        change="inequalities that are wider by the size of their rows",
    )


def _around_cones(problem: Any) -> Polyhedron | None:
    """Return a polyhedron around Ax + b ∈ K: without room in it there is none in K. None where K has other factors."""
    K, n = problem.K, problem.p.size
    A, b = sp.csr_array(problem.A), problem.b
    first = (np.cumsum(K.size) - K.size).astype(np.int64)
    rows, level = list[tuple[int, int, float]](), list[int]()
    for kind, start, size, mu in zip(K.kind, first.tolist(), K.size.astype(int).tolist(), K.mu.tolist(), strict=True):
        inside = range(start, start + size)
        if kind == Cone.ZERO:
            level += inside
        elif kind == Cone.NONNEGATIVE:
            rows += [(i, i, 0.0) for i in inside]
        elif kind == Cone.SECOND_ORDER and np.isfinite(mu):
            rows += [(start, i, sign) for i in inside[1:] for sign in (1.0 / mu, -1.0 / mu)] if mu else []
            rows += [(start, start, 0.0)]
        elif kind != Cone.FREE:
            return None
    normal, other, factor = (np.array(part) for part in zip(*rows, strict=True)) if rows else (np.zeros(0, int),) * 3
    G = A[normal] + sp.diags_array(factor.astype(float)) @ A[other]
    free = np.full(n, np.inf)
    return Polyhedron(G, -(b[normal] + factor * b[other]), A[level], -b[level], -free, free, "x")


def _room(problem: Problem, P: Polyhedron) -> float | None:
    """Return the largest t ≤ 1 for which Gx ≥ h + t‖G_i‖ and bounds hold with room t; None where it is not found."""
    n, rows = P.lb.size, np.flatnonzero(np.isfinite(P.h))
    G: Any = sp.csr_array(P.G)[rows]
    size = np.asarray(abs(G).max(axis=1).toarray(), dtype=float).ravel() if rows.size else np.zeros(0)
    used = size > 0
    if problem.node == "coneqp":  # a row in which the normal and a tangent cancel leaves none
        size, used = np.where(used, size, 1.0), np.ones(rows.size, dtype=bool)
    low, high = np.flatnonzero(np.isfinite(P.lb)), np.flatnonzero(np.isfinite(P.ub))
    unit = sp.eye_array(n, format="csr")
    sides = sp.vstack([-G[used], -unit[low], unit[high]], format="csr")
    width = np.concatenate([size[used], (P.lb < P.ub)[low].astype(float), (P.lb < P.ub)[high].astype(float)])
    if not width.any():
        return None
    program: Any = linprog  # its types know no sparse matrices
    found = program(
        np.append(np.zeros(n), -1.0),
        A_ub=sp.hstack([sides, sp.csr_array(width[:, None])]),
        b_ub=np.concatenate([-P.h[rows][used], -P.lb[low], P.ub[high]]),
        A_eq=sp.hstack([sp.csr_array(P.E), sp.csr_array((P.f.size, 1))]) if P.f.size else None,
        b_eq=P.f if P.f.size else None,
        bounds=[(None, None)] * n + [(None, 1.0)],
        method="highs",
    )
    return float(found.x[-1]) if found.status == 0 else None


def _relaxed(case: FailedTrial) -> Any:
    """Return the trial with wider inequalities."""
    P: Any = case.problem
    if P.node == "qp":
        size = np.asarray(abs(sp.csr_array(P.A)).max(axis=1).toarray(), dtype=float).ravel() if P.b.size else P.b
        return replace(case.trial, problem=replace(P, b=P.b - size))
    if P.node == "lcp":
        size = np.asarray(abs(sp.csr_array(P.M)).max(axis=1).toarray(), dtype=float).ravel()
        return replace(case.trial, problem=replace(P, q=P.q + size))
    if P.node == "coneqp":
        size = np.asarray(abs(sp.csr_array(P.A)).max(axis=1).toarray(), dtype=float).ravel()
        return replace(case.trial, problem=replace(P, b=P.b + np.where(_grows(P.K), size, 0.0)))
    return None


def _grows(cone: ProductCone) -> NDArray[np.bool_]:
    """Return the rows that may grow in every cone: all of an orthant, the first one of each with a normal."""
    result = np.zeros(cone.rows, dtype=bool)
    first = np.cumsum(cone.size) - cone.size
    for kind, start, size in zip(cone.kind, first, cone.size, strict=True):
        if kind == Cone.NONNEGATIVE:
            result[int(start) : int(start + size)] = True
        elif kind in (Cone.SECOND_ORDER, Cone.ROLLING, Cone.ROLLING_DUAL, Cone.CYLINDER):
            result[int(start)] = True
    return result
