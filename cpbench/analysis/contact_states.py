"""Open, stick or slip: the state of every contact of an answer, with the numbers that a picture of it needs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from cpbench.errors import PointError, ProblemError
from cpbench.formulations.base import Contacts, Point, Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.local_contact import AnisotropicFrictionContact
from cpbench.foundation.matrices import Dense, Vector, norm


class State(StrEnum):
    """State of a contact."""

    STICK = "stick"
    SLIP = "slip"
    OPEN = "open"


@dataclass(frozen=True, eq=False)
class ContactStates:
    """The contacts of an answer; rolling parts (moments, angular velocities) are left out.

    Attributes
    ----------
    r, u : (nc, d), reactions [N s] and velocities [m/s], normal first.
    mu : (nc, d − 1), coefficient along each tangent.
    share : (nc, d − 1), r_T/(μ r_N), in the unit disk for an admissible reaction; 0 where μ r_N is 0.
    state : (nc,), a State each.
    """

    r: Dense
    u: Dense
    mu: Dense
    share: Dense
    state: NDArray[np.str_]

    @property
    def against(self) -> Dense:
        """The value of r_T/(μ r_N) expected while sliding, −(μ∘u_T) over its length; 0 without sliding; (nc, d − 1).

        With different μ along the two tangents r_T is not against u_T, but this holds (associated slip).
        """
        slide = self.mu * self.u[:, 1:]
        speed = np.linalg.norm(slide, axis=1, keepdims=True)
        return -slide / np.where(speed > 0, speed, 1.0)

    def count(self, state: State) -> int:
        """Count the contacts in this state."""
        return int((self.state == str(state)).sum())


def contact_states(problem: Problem, point: Point, tolerance: float = 1e-6) -> ContactStates:
    """Return states of all contacts, with the noise of `formulations.contact.contact_residuals`.

    A contact is open when the energy of its reaction, ‖r_c‖²/ρ_c, is below tolerance² times that of the whole answer,
    or its r_N is not positive; else it slips when ρ_c‖u_T‖ exceeds tolerance times max(‖r_c‖, √ρ_c of the energy); else
    it sticks. Raises ProblemError when the problem has no contacts, PointError on an answer that is not finite.
    """
    if not isinstance(problem, ContactProblem):
        raise ProblemError(problem.node, "has no contacts; give a problem of fc, fcm, gfc, afc, rfc or grfc")
    problem.check_point(point)
    if not point.finite:
        raise PointError(f"{problem.node}: the answer has a number that is not finite: no contact has a state in it")
    nc, rows = problem.nc, problem.dimension
    d = rows if not hasattr(problem, "mu_r") else 1 + (rows - 1) // 2
    r = point.arrays()["r"].reshape(nc, rows)[:, :d]
    u = problem.slacks(point)["u"].reshape(nc, rows)[:, :d]
    mu = _coefficients(problem, d)
    weight = problem.rho
    r_c, slide = np.linalg.norm(r, axis=1), np.linalg.norm(u[:, 1:], axis=1)
    scale = max(norm(r_c / np.sqrt(weight)), norm(np.sqrt(weight) * np.linalg.norm(u, axis=1)))
    floor = np.sqrt(weight) * scale
    is_open = (r_c <= tolerance * floor) | (r[:, 0] <= 0)
    slips = weight * slide > tolerance * np.maximum(r_c, floor)
    state = np.where(is_open, str(State.OPEN), np.where(slips, str(State.SLIP), str(State.STICK)))
    bound = mu * r[:, :1]
    share = np.divide(r[:, 1:], bound, out=np.zeros_like(bound), where=(bound > 0) & ~is_open[:, None])
    return ContactStates(r, u, mu, share, state)


def _coefficients(problem: ContactProblem, d: int) -> Dense:
    """Return μ of every contact and tangent."""
    if isinstance(problem, AnisotropicFrictionContact):
        return problem.friction
    mu: Vector = problem.mu
    return np.repeat(mu[:, None], d - 1, axis=1)


def forces(states: ContactStates, contacts: Contacts) -> Dense:
    """Return reactions in the axes of the scene, on the first body of each contact: Σ_i r_i times row i of the
    frame.

    Shape (nc, 3) [N s].
    """
    frame = np.asarray(contacts.frame)[:, : states.r.shape[1]]
    return np.asarray(np.einsum("ci,cik->ck", states.r, frame))
