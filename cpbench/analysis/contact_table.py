"""State, forces and velocities of every contact of an answer, and the load on each body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cpbench.analysis.contact_states import ContactStates, State, contact_states, forces
from cpbench.formulations.base import Contacts, Point
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation.matrices import Dense, Vector, norm

ROLLS = "rolls"
"""State of a contact that does not slip while the bodies turn about it; only with rolling friction."""


@dataclass(frozen=True, eq=False)
class ContactTable:
    """The contacts of an answer, in the order of the problem.

    Attributes
    ----------
    id : (nc,) int64, the contact's own number where the file has one, else its place from 0.
    normal : (nc,) r_N, what the contact pushes with, in the unit of r [N s].
    friction : (nc,) ‖r_T‖/(μ r_N), 1 at the edge of the cone; 0 where the contact is open or μ is 0.
    opening, sliding : (nc,) u_N and ‖u_T‖ [m/s].
    state : (nc,) open, slip, stick, or rolls, as of `contact_states`.
    moment, rolling : (nc,) ‖m‖/(μ_r r_N) and ‖ω‖ [rad/s]; empty without rolling friction.
    bodies : (nb,) int64, the bodies that the contacts name, sorted; empty where they are not known.
    touched : (nb,) int64, how many contacts of each body are not open.
    load : (nb, 3) sum of the reactions on each body, in the axes of the scene [N s]; empty where no frames are known.
    """

    id: NDArray[np.int64]
    normal: Vector
    friction: Vector
    opening: Vector
    sliding: Vector
    state: NDArray[np.str_]
    moment: Vector
    rolling: Vector
    bodies: NDArray[np.int64]
    touched: NDArray[np.int64]
    load: Dense

    def __len__(self) -> int:
        return self.normal.size

    def counts(self) -> dict[str, int]:
        """Return how many contacts are in each state, for the states that occur."""
        counts = {state: int((self.state == state).sum()) for state in (*map(str, State), ROLLS)}
        return {state: count for state, count in counts.items() if count}


def contact_ids(problem: ContactProblem) -> NDArray[np.int64]:
    """Return the numbers of contacts that the file has, else their places from 0; shape (nc,)."""
    contacts = problem.contacts
    numbered = contacts is not None and contacts.knows("id") and problem.nc > 0
    return contacts.id if numbered and contacts is not None else np.arange(problem.nc, dtype=np.int64)


def contact_table(problem: ContactProblem, point: Point, tolerance: float = 1e-6) -> ContactTable:
    """Return what the contacts of an answer do; `tolerance` tells noise from motion, as in `contact_states`.

    Raises PointError on an answer that is not finite.
    """
    states = contact_states(problem, point, tolerance)
    moment, rolling, rolls = _rolling(problem, point, states, tolerance)
    bodies, touched, load = _loads(states, problem.contacts)
    return ContactTable(
        id=contact_ids(problem),
        normal=states.r[:, 0],
        friction=np.linalg.norm(states.share, axis=1),
        opening=states.u[:, 0],
        sliding=np.linalg.norm(states.u[:, 1:], axis=1),
        state=np.where((states.state == str(State.STICK)) & rolls, ROLLS, states.state),
        moment=moment,
        rolling=rolling,
        bodies=bodies,
        touched=touched,
        load=load,
    )


def _rolling(
    problem: ContactProblem, point: Point, states: ContactStates, tolerance: float
) -> tuple[Vector, Vector, NDArray[np.bool_]]:
    """Return ‖m‖/(μ_r r_N), ‖ω‖ and whether the bodies turn, by the rule of slipping in lengths of each contact."""
    still = np.zeros(problem.nc, dtype=np.bool_)
    mu_r: Vector | None = getattr(problem, "mu_r", None)
    if mu_r is None:
        return np.zeros(0), np.zeros(0), still
    first = states.r.shape[1]
    r = point.arrays()["r"].reshape(problem.nc, -1)
    u = problem.slacks(point)["u"].reshape(problem.nc, -1)
    m, omega = np.linalg.norm(r[:, first:], axis=1), np.linalg.norm(u[:, first:], axis=1)
    bound = mu_r * r[:, 0]
    share = np.divide(m, bound, out=np.zeros_like(m), where=(bound > 0) & (states.state != str(State.OPEN)))
    weight, lengths = problem.rho, problem.lengths
    r_c, u_c = np.linalg.norm(r / lengths, axis=1), np.linalg.norm(u * lengths, axis=1)
    floor = np.sqrt(weight) * max(norm(r_c / np.sqrt(weight)), norm(np.sqrt(weight) * u_c))
    turning = weight * np.linalg.norm(u[:, first:] * lengths[:, first:], axis=1)
    return share, omega, turning > tolerance * np.maximum(r_c, floor)


def _loads(states: ContactStates, geometry: Contacts | None) -> tuple[NDArray[np.int64], NDArray[np.int64], Dense]:
    """Return the bodies, how many contacts hold each, and the sum of the reactions on each."""
    if geometry is None or not geometry.count or not geometry.knows("bodies"):
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3))
    bodies, positions = np.unique(geometry.bodies, return_inverse=True)
    first, second = positions.reshape(-1, 2).T
    closed = (states.state != str(State.OPEN)).astype(np.int64)
    touched = np.zeros(bodies.size, np.int64)
    np.add.at(touched, first, closed)
    np.add.at(touched, second, closed)
    if not geometry.knows("frame"):
        return bodies, touched, np.zeros((0, 3))
    load, pushed = np.zeros((bodies.size, 3)), forces(states, geometry)
    np.add.at(load, first, pushed)
    np.subtract.at(load, second, pushed)
    return bodies, touched, load
