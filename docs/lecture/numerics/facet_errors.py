"""Errors of polygons in place of Coulomb's disk: one sliding contact, solved with facets in every direction.

Nothing here knows the formulas 1 − cos(π/ν), 1/cos(π/ν) − 1 and 180°/ν but :func:`bounds`: the numbers come from the
edges `fc-lcp-inner` and `fc-lcp-outer`, Lemke's method, and the lift.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cpbench import CpbenchError, FrictionContact, make
from cpbench.errors import ProblemError
from cpbench.foundation.matrices import Dense, Vector
from cpbench.solvers.base import Budget, Claim, solve

SIDES = ("inner", "outer")
FAST = 5000.0
"""Tangential over normal free velocity: so fast that u_T has the direction of q_T, to 0.01°."""
STEP = 0.5
"""Degrees between two directions."""


@dataclass(frozen=True, eq=False)
class FacetedSlide:
    """Answers of the faceted problem, a direction of sliding each.

    Attributes
    ----------
    side : inner or outer. facets : ν.
    direction : (k,), angles of the sliding velocity [deg].
    share : (k, 2), r_T/(μ r_N). resistance : (k,), −r_Tᵀt/(μ r_N), t the direction of sliding; 1 for the disk.
    slip_angle : (k,), ∠(−u_T, r_T) [deg], 0 for the disk.
    """

    side: str
    facets: int
    direction: Vector
    share: Dense
    resistance: Vector
    slip_angle: Vector

    @property
    def radius_error(self) -> float:
        """The most by which the resistance misses that of the disk."""
        return float(np.abs(self.resistance - 1.0).max())

    @property
    def largest_slip_angle(self) -> float:
        return float(self.slip_angle.max())


def faceted_slide(
    side: str, facets: int, mu: float = 0.5, W: Dense | None = None, *, step: float = STEP
) -> FacetedSlide:
    """Solve the one-contact problem u = Wr + q, q = W_NN(−1, FAST t), for directions t every `step` degrees.

    Half a turn shows all, for the polygons have opposite vertices. W is (3, 3), the identity by default.
    Raises ProblemError where there is no friction or no inertia, NotApplicable for such facets, CpbenchError when
    Lemke's method ends without an answer.
    """
    W = np.eye(3) if W is None else W
    if not mu > 0 or not W[0, 0] > 0:
        raise ProblemError("fc", f"mu = {mu:g}, W_NN = {W[0, 0]:g}: a contact slides with friction only where both > 0")
    edge = make(f"fc-lcp-{side}", {"facets": facets})
    direction = np.arange(0.0, 180.0, step)
    tangents = np.column_stack([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
    share, velocity = np.empty_like(tangents), np.empty_like(tangents)
    for k, t in enumerate(tangents):
        problem = FrictionContact(W=W, q=W[0, 0] * np.array([-1.0, *(FAST * t)]), mu=np.array([mu]))
        lcp, trace = edge.apply(problem)
        done = solve(lcp, "lemke", Budget(tolerance=1e-10))
        if done.claim is not Claim.SOLVED:
            raise CpbenchError(
                f"{edge.label}: lemke {done.claim} at {direction[k]:g}° ({done.message}); take a contact with larger W"
            )
        r = edge.lift(done.point, trace).r
        share[k] = r[1:] / (mu * r[0])
        velocity[k] = (problem.W @ r + problem.q)[1:]
    across = share[:, 0] * velocity[:, 1] - share[:, 1] * velocity[:, 0]
    angle = np.degrees(np.arctan2(np.abs(across), -np.einsum("ki,ki->k", share, velocity)))
    return FacetedSlide(side, facets, direction, share, -np.einsum("ki,ki->k", share, tangents), angle)


def bounds(facets: Vector) -> dict[str, Vector]:
    """Return the suprema over all directions: radius too small (inner), too large (outer), and slip angle [deg].

    >>> {name: round(float(value), 4) for name, value in bounds(np.array(4.0)).items()}
    {'inner': 0.2929, 'outer': 0.4142, 'angle': 45.0}
    """
    half = math.pi / facets
    return {"inner": 1.0 - np.cos(half), "outer": 1.0 / np.cos(half) - 1.0, "angle": np.degrees(half)}
