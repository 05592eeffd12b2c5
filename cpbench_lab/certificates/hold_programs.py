"""Cone programs that give hints on whether forces hold a load (`holding`): forces with the largest margin to the cones
of friction, and motions that gain by the load."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector, power_of_two

ACCURACY = 1e-12
"""What Clarabel is asked for."""
CLOSE = 1e-9
"""A margin below which a cone program does not tell the two answers apart."""


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


def with_most_margin(balance: Balance) -> tuple[Vector, float, Vector] | None:
    """Return forces with Ar + f = 0 and the largest margin s ≤ 1: (μ r_N − s, r_T) is in the cone and r_N ≥ s; s; the
    multipliers of the equations. None where no forces at all balance the load."""
    m, n = balance.A.shape
    cones, kinds = contact_cones(balance.mu, balance.d, n)
    starts = np.cumsum([0, *(size for _, size in kinds)])[:-1]
    margin = np.zeros(cones.shape[0])
    margin[[at for at, (kind, _) in zip(starts, kinds, strict=True) if kind != "zero"]] = 1.0
    normal = sp.csc_array(
        (-np.ones(balance.mu.size), (np.arange(balance.mu.size), np.arange(0, balance.rows, balance.d))),
        shape=(balance.mu.size, n),
    )
    G = sp.block_array(
        [[balance.A, None], [cones, margin[:, None]], [normal, np.ones((balance.mu.size, 1))], [None, np.ones((1, 1))]],
        format="csc",
    )
    h = np.concatenate([-balance.f, np.zeros(cones.shape[0] + balance.mu.size), [1.0]])
    kinds = [("zero", m), *kinds, ("above", balance.mu.size + 1)]
    solution = solved(np.append(np.zeros(n), -1.0), G, h, kinds, ACCURACY)
    return None if solution is None else (solution[0][:n], float(solution[0][n]), solution[1][:m])


def inward_motion(balance: Balance) -> Vector | None:
    """Return a motion strictly inside all dual cones, its entries at most 1; None where there is none."""
    n, nc, d = balance.f.size, balance.mu.size, balance.d
    factor = np.ones((nc, d))
    factor[:, 1:] = balance.mu[:, None]
    u = sp.diags_array(-factor.ravel()) @ balance.A.T[: balance.rows]
    margin = np.tile(np.eye(1, d)[0], nc)[:, None]
    joints, box = balance.A.T[balance.rows :], sp.vstack([sp.eye_array(n), -sp.eye_array(n)])
    G = sp.block_array([[u, margin], [joints, None], [box, None], [None, np.ones((1, 1))]], format="csc")
    h = np.concatenate([np.zeros(balance.rows + joints.shape[0]), np.ones(2 * n + 1)])
    kinds = [*[("cone", d)] * nc, ("zero", joints.shape[0]), ("above", 2 * n + 1)]
    solution = solved(np.append(np.zeros(n), -1.0), G, h, kinds, ACCURACY)
    return solution[0][:n] if solution is not None and solution[0][n] > CLOSE else None


def contact_cones(mu: Vector, d: int, columns: int) -> tuple[Any, list[tuple[str, int]]]:
    """Return the rows G of −Gr = (μ r_N, r_T) at every contact, and their cones."""
    rows, cones = [], []
    for c, each in enumerate(mu.tolist()):
        at = c * d
        tangents = range(at + 1, at + d)
        if 0.0 < each < np.inf:
            rows += [(at, -each), *((k, -1.0) for k in tangents)]
            cones.append(("cone", d))
            continue
        rows.append((at, -1.0))
        cones.append(("above", 1))
        if each == 0.0:
            rows += [(k, -1.0) for k in tangents]
            cones.append(("zero", d - 1))
    at_column, values = zip(*rows, strict=True) if rows else ((), ())
    where: Any = (np.array(values, float), (np.arange(len(rows)), np.array(at_column, int)))
    return sp.csc_array(where, shape=(len(rows), columns)), cones


def solved(
    cost: Vector, G: Any, h: Vector, cones: list[tuple[str, int]], accuracy: float
) -> tuple[Vector, Vector] | None:
    """Return x and the multipliers of min costᵀx with h − Gx in the cones; None where no x is."""
    clarabel: Any = importlib.import_module("clarabel")  # slow to import, and without types

    kinds = {"zero": clarabel.ZeroConeT, "above": clarabel.NonnegativeConeT, "cone": clarabel.SecondOrderConeT}
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = accuracy
    none = sp.csc_array((cost.size, cost.size))
    solution = clarabel.DefaultSolver(none, cost, G, h, [kinds[kind](size) for kind, size in cones], settings).solve()
    return None if "Infeasible" in str(solution.status) else (np.asarray(solution.x), np.asarray(solution.z))


# ---------------------------------------------------------------------------------------------------------------- cones
# How far a load is from the loads that forces in the cones of friction balance (`hold_limits`): a cone program.
#
# min ‖Ar + f‖ over r ∈ K_μ, in units in which the entries of A and f are near 1 (`hold_programs.scaled`). Its dual is
# max fᵀv over ‖v‖ ≤ 1 with Aᵀv in the dual cones. Both are bounded and both have interior points, so Clarabel's answer
# is accurate at the limit too, where the forces themselves may have none.

ACCURACIES = (1e-13, 1e-10)
"""What Clarabel is asked for, one after the other until the answer is clear; it may stop early when asked for much."""
HOLDS, MOVES = 1e-10, 1e-9
"""A distance of which at most the first is taken as 0; one of at least the second is taken as more."""


@dataclass(frozen=True, eq=False)
class Distance:
    """Bounds on the distance of a load from the loads that are held, over the largest entry of the load.

    Attributes
    ----------
    below, above : by a motion v, and by forces; r (n,) : the forces, in the units of the problem.
    """

    below: float
    above: float
    r: Vector

    @property
    def holds(self) -> bool | None:
        """Whether forces hold the load; None where rounding decides."""
        return True if self.above <= HOLDS else False if self.below >= MOVES else None


def distance(balance: Balance) -> Distance:
    """Return the bounds on the distance of a load; a coefficient inf stands for tangential forces without a limit."""
    units, _, column = scaled(balance)
    m, n = units.A.shape
    blocks, sizes = contact_cones(units.mu, units.d, n)
    load = sp.block_array([[None, sp.csc_array([[-1.0]])], [-units.A, sp.csc_array((m, 1))]], format="csc")
    rows = sp.vstack([load, sp.hstack([blocks, sp.csc_array((blocks.shape[0], 1))])], format="csc")
    right = np.concatenate([[0.0], units.f, np.zeros(blocks.shape[0])])
    best = Distance(-np.inf, np.inf, np.zeros(n))
    for accuracy in ACCURACIES:
        answer = solved(np.append(np.zeros(n), 1.0), rows, right, [("cone", m + 1), *sizes], accuracy)
        x, z = answer or (np.zeros(n), np.zeros(m + 1))
        below, above, r = _bounds(units, x[:n], z[1 : m + 1])
        r = best.r if best.above < above else r * column
        best = Distance(max(below, best.below), min(above, best.above), r)
        if best.holds is not None:
            break
    return best


def _bounds(units: Balance, x: Vector, v: Vector) -> tuple[float, float, Vector]:
    """Return what a motion near v and forces near x prove of the distance to rounding, and the forces."""
    r = _inside(units, x)
    v = v / max(1.0, float(np.linalg.norm(v)))
    v = v if units.f @ v >= 0.0 else -v
    u = units.A.T @ v
    at, forces = (given[: units.rows].reshape(-1, units.d) for given in (u, r))
    slide, free = np.linalg.norm(at[:, 1:], axis=1), np.isinf(units.mu)
    against = at[:, 0] - np.where(free, 0.0, units.mu) * slide
    loss = np.maximum(-against, 0.0) @ forces[:, 0] + slide[free] @ np.linalg.norm(forces[free, 1:], axis=1)
    loss += np.abs(u[units.rows :]) @ np.abs(r[units.rows :])
    return float(units.f @ v - loss), float(np.linalg.norm(units.A @ r + units.f)), r


def for_any_friction(balance: Balance) -> Balance:
    """Return the balance that holds where forces hold the load for every μ > 0: with m ≥ 0 and ‖r_T‖ ≤ n at every
    contact, A_N n = 0 and A_N m + A_T r_T + f = 0, these are r_N = m + n/μ and r_T. Joints bear loads in both."""
    contacts, joints = balance.A[:, : balance.rows], balance.A[:, balance.rows :]
    normal = sp.diags_array(np.where(np.arange(balance.rows) % balance.d == 0, 1.0, 0.0))
    N = contacts @ normal
    A = sp.block_array([[contacts - N, N, joints, None], [N, None, None, joints]], format="csr")
    mu = np.repeat([1.0, 0.0], balance.mu.size)
    return replace(balance, A=A, f=np.append(balance.f, np.zeros(balance.f.size)), mu=mu)


def nearest_factor(balance: Balance, load: Vector) -> tuple[float, Distance]:
    """Return the factor ≥ 0 of a load at which the total is nearest to those that are held, with the distance there."""
    m = balance.f.size
    before = sp.csr_array(balance.A)
    column = np.zeros((m, balance.d))
    column[:, 0] = load  # a contact without friction, whose normal force is the factor
    A = sp.hstack([before[:, : balance.rows], sp.csr_array(column), before[:, balance.rows :]], format="csr")
    nearest = distance(replace(balance, A=A, mu=np.append(balance.mu, 0.0)))
    return max(float(nearest.r[balance.rows]), 0.0), nearest


def _inside(balance: Balance, x: Vector) -> Vector:
    """Return the unknowns with the force at each contact moved into its cone."""
    r = x[: balance.rows].reshape(-1, balance.d).copy()
    r[:, 0] = np.maximum(r[:, 0], 0.0)
    size, room = np.linalg.norm(r[:, 1:], axis=1), np.where(r[:, 0] > 0.0, balance.mu, 0.0) * r[:, 0]
    r[:, 1:] *= np.where(size > room, room / np.where(size > 0.0, size, 1.0), 1.0)[:, None]
    return np.append(r, x[balance.rows :])
