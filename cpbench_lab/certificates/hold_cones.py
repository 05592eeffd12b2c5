"""How far a load is from the loads that forces in the cones of friction balance (`hold_limits`): a cone program.

min ‖Ar + f‖ over r ∈ K_μ, in units in which the entries of A and f are near 1 (`hold_programs.scaled`). Its dual is
max fᵀv over ‖v‖ ≤ 1 with Aᵀv in the dual cones. Both are bounded and both have interior points, so Clarabel's answer
is accurate at the limit too, where the forces themselves may have none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.hold_programs import Balance, contact_cones, scaled, solved

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
