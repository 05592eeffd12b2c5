"""Linear programs that give hints on whether forces hold a load (`holding`): forces with the largest margin to the
cones of friction, and motions that gain by the load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Vector, power_of_two

ACCURACY = 1e-10
"""HiGHS' least feasibility tolerance."""
CLOSE = 1e-9
"""A margin below which a linear program does not tell the two answers apart."""
DIRECTIONS = 16
"""Cuts of a disk that a first motion strictly inside the dual cones is sought with."""


@dataclass(frozen=True, eq=False)
class Balance:
    """A (n, nc·d + p), f (n,) and mu (nc,) of Ar + f = 0; the last p unknowns are free."""

    A: Any
    f: Vector
    mu: Vector
    d: int

    @property
    def rows(self) -> int:
        """The number of reactions at contacts."""
        return self.mu.size * self.d


def scaled(balance: Balance) -> tuple[Balance, Vector, Vector]:
    """Return the balance in units in which loads and entries are near 1, and the units: powers of two, one a row and
    one a contact or joint."""
    A, f = balance.A, balance.f
    row = power_of_two(np.maximum(np.asarray(abs(A).max(axis=1).toarray()).ravel(), 0.0))
    load = power_of_two(np.array([matrices.max_abs(row * f)]))[0]
    sizes = np.asarray(abs(sp.diags_array(row) @ A).max(axis=0).toarray()).ravel()
    contacts = sizes[: balance.rows].reshape(-1, balance.d).max(axis=1, initial=0.0)
    column = power_of_two(np.concatenate([np.repeat(contacts, balance.d), sizes[balance.rows :]])) / load
    right = sp.csr_array(sp.diags_array(row * load) @ A @ sp.diags_array(column))
    return replace(balance, A=right, f=row * f * load), row * load, column


def directions(d: int, count: int) -> list[Vector]:
    """Return unit vectors of tangents, about the circle or both ways along the line."""
    if d == 2:
        return [np.array([1.0]), np.array([-1.0])][: 2 if count else 0]
    angles = 2.0 * np.pi / max(count, 1) * np.arange(count)
    return [np.array([np.cos(angle), np.sin(angle)]) for angle in angles.tolist()]


def _cone_rows(balance: Balance, cuts: Sequence[Sequence[Vector]]) -> Any:
    """Return the rows of μ r_N − cᵀr_T for each cut c, and of r_N, over all unknowns."""
    entries: list[tuple[int, int, float]] = []
    at = 0
    for c, own in enumerate(cuts):
        for cut in own:
            entries.append((at, c * balance.d, float(balance.mu[c])))
            entries += [(at, c * balance.d + 1 + k, -float(value)) for k, value in enumerate(cut)]
            at += 1
        entries.append((at, c * balance.d, 1.0))
        at += 1
    i, j, values = zip(*entries, strict=True) if entries else ((), (), ())
    where: Any = (np.array(values, float), (np.array(i, int), np.array(j, int)))
    return sp.csr_array(where, shape=(at, balance.A.shape[1]))


def with_most_margin(balance: Balance, cuts: Sequence[Sequence[Vector]]) -> tuple[Vector, float, Vector] | None:
    """Return forces with Ar + f = 0 and the largest margin s ≤ 1 to all cuts; s; the multipliers of the equations."""
    rows, n = _cone_rows(balance, cuts), balance.A.shape[1]
    low = np.full(n, -np.inf)
    high = np.full(n, np.inf)
    for c in np.flatnonzero(balance.mu == 0.0).tolist():
        low[c * balance.d + 1 : (c + 1) * balance.d] = high[c * balance.d + 1 : (c + 1) * balance.d] = 0.0
    margin = sp.csr_array(np.ones((rows.shape[0], 1)))
    found = _least(
        np.append(np.zeros(n), -1.0),
        sp.hstack([-rows, margin], format="csr"),
        np.zeros(rows.shape[0]),
        sp.hstack([balance.A, sp.csr_array((balance.f.size, 1))], format="csr"),
        -balance.f,
        np.column_stack([np.append(low, -np.inf), np.append(high, 1.0)]),
    )
    if found is None:
        return None
    return found.x[:n], float(found.x[n]), np.asarray(found.eqlin.marginals)


def outside_disks(balance: Balance, x: Vector, margin: float) -> list[int]:
    """Return the contacts whose forces are outside the disk with half the margin."""
    r = x[: balance.rows].reshape(-1, balance.d)
    size = np.sqrt(np.einsum("ij,ij->i", r[:, 1:], r[:, 1:]))
    return np.flatnonzero(size > balance.mu * r[:, 0] - 0.5 * margin + CLOSE).tolist() if balance.d == 3 else []


def add_cuts(cuts: list[list[Vector]], outside: Sequence[int], balance: Balance, x: Vector) -> bool:
    """Add the cuts along the forces of contacts; returns whether any is new."""
    r, before = x[: balance.rows].reshape(-1, balance.d), sum(map(len, cuts))
    for c in outside:
        size = float(np.linalg.norm(r[c, 1:]))
        if size > 0.0 and balance.mu[c] > 0.0:
            new = r[c, 1:] / size
            if all(float(new @ cut) < 1.0 - 1e-14 for cut in cuts[c]):
                cuts[c].append(new)
    return sum(map(len, cuts)) > before


def inward_motion(balance: Balance) -> Vector | None:
    """Return a motion strictly inside all dual cones, its entries at most 1; None where there is none."""
    wide = 1.0 / np.cos(np.pi / DIRECTIONS) if balance.d == 3 else 1.0
    cuts = [[mu * wide * cut for cut in directions(balance.d, DIRECTIONS)] if mu else [] for mu in balance.mu.tolist()]
    over = _cone_rows(replace(balance, mu=np.ones(balance.mu.size)), cuts) @ balance.A.T
    n = balance.f.size
    joints = sp.csr_array(balance.A.T[balance.rows :])
    found = _least(
        np.append(np.zeros(n), -1.0),
        sp.hstack([-over, sp.csr_array(np.ones((over.shape[0], 1)))], format="csr"),
        np.zeros(over.shape[0]),
        sp.hstack([joints, sp.csr_array((joints.shape[0], 1))], format="csr"),
        np.zeros(joints.shape[0]),
        np.vstack([np.full((n, 2), (-1.0, 1.0)), (-np.inf, 1.0)]),
    )
    return found.x[:n] if found is not None and found.x[n] > CLOSE else None


def _least(cost: Vector, above: Any, side: Vector, equal: Any, right: Vector, bounds: Dense) -> Any:
    """Return what HiGHS finds for min costᵀx, above·x ≤ side, equal·x = right, within bounds; None for nothing."""
    from scipy.optimize import linprog  # slow to import

    options: Any = {"primal_feasibility_tolerance": ACCURACY, "dual_feasibility_tolerance": ACCURACY}
    given = {"A_ub": above, "b_ub": side, "bounds": bounds, "method": "highs-ds", "options": options}
    if equal.shape[0]:
        given |= {"A_eq": equal, "b_eq": right}
    found: Any = linprog(cost, **given)
    return found if found.x is not None and found.status == 0 else None
