"""Conditions that leave no room: no point meets all of them strictly."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

from cpbench.diagnosis.case import Cause, FailedTrial
from cpbench.verification.polyhedra import Polyhedron, conditions

ROOM = 1e-9
"""Room, over the size of the rows, below which there is none: what the linear program leaves."""
NODES = ("qp", "coneqp", "lcp", "mlcp")
"""Nodes whose conditions are rows; contact without friction leaves no room to the tangents, and needs none."""
LARGEST = 3000
"""Unknowns of the largest linear program."""


def no_interior(case: FailedTrial) -> Cause | None:
    """Find the point with the most room to the sides of all inequalities, by a linear program."""
    if case.problem.node not in NODES:
        return None
    P = conditions(case.problem)
    if P is None or P.lb.size > LARGEST:
        return None
    room = _room(P)
    if room is None or room > ROOM:
        return None
    return Cause(
        kind="no interior",
        evidence=f"no point meets its inequalities with more room than {max(room, 0.0):.1e} of the size of their rows",
        numbers={"room": room},
        without=_relaxed(case),
        change="inequalities that are wider by the size of their rows",
    )


def _room(P: Polyhedron) -> float | None:
    """Return the largest t ≤ 1 for which Gx ≥ h + t‖G_i‖ and bounds hold with room t; None where it is not found."""
    n, rows = P.lb.size, np.flatnonzero(np.isfinite(P.h))
    G: Any = sp.csr_array(P.G)[rows]
    size = np.asarray(abs(G).max(axis=1).toarray(), dtype=float).ravel() if rows.size else np.zeros(0)
    used = size > 0
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
    return None
