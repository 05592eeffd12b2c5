"""Model predictive control of a chain of masses: a quadratic program, banded in time."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.qp import QP
from cpbench.foundation.matrices import Dense
from cpbench.generators.base import Instance, collection, dyadic, generator

CITATION = "Wang and Boyd 2010, IEEE Trans. Control Syst. Technol. 18:267 (oscillating masses)"
STEP, STIFFNESS, EFFORT = 2.0**-2, 1.0, 2.0**-2
"""Time step, stiffness of the springs, and weight of the squared forces."""


@collection("mpc-chains", "qp", "control of oscillating masses over a horizon, forces within bounds", CITATION)
def build() -> list[Instance]:
    return [chain(masses, horizon) for masses, horizon in ((2, 6), (3, 10), (4, 20))]


@collection("mpc-chains-large", "qp", "the same with 10⁴ and 10⁵ unknowns", CITATION, tier="standard")
def build_large() -> list[Instance]:
    return [chain(masses, horizon) for masses, horizon in ((6, 200), (10, 333), (6, 5555))]


def dynamics(masses: int) -> tuple[Dense, Dense]:
    """Return A and B of x⁺ = Ax + Bu: masses between springs in a row, held at both ends, x = (positions, speeds);
    semi-implicit Euler, so that all is exact. A force acts on every mass."""
    pull = STIFFNESS * (np.eye(masses, k=1) + np.eye(masses, k=-1) - 2.0 * np.eye(masses))
    one, zero = np.eye(masses), np.zeros((masses, masses))
    speeds = np.hstack([STEP * pull, one])
    A = np.vstack([np.hstack([one, zero]) + STEP * speeds, speeds])
    return A, np.vstack([STEP * STEP * one, STEP * one])


def chain(masses: int, horizon: int, push: float = 2.0, limit: float = 0.25) -> Instance:
    """Minimise Σ ½|x_k|² + ½ EFFORT |u_{k−1}|² over (u_0, x_1, u_1, x_2, ...), x_0 drawn within `push`, |u| ≤ limit.

    Where the limit is not active, the first force is that of Riccati's recursion.
    """
    A, B = dynamics(masses)
    states, stage = 2 * masses, 3 * masses
    start = dyadic(generator(900 + masses), states, -1, 1) * push
    one, zero = sp.eye_array(horizon), sp.eye_array(horizon, k=-1)
    now = sp.hstack([sp.csr_array(-B), sp.eye_array(states)])
    before = sp.hstack([sp.csr_array((states, masses)), sp.csr_array(-A)])
    C = sp.csr_array(sp.kron(one, now) + sp.kron(zero, before))
    d = np.zeros(states * horizon)
    d[:states] = A @ start
    Q = sp.csr_array(sp.diags_array(np.tile(np.repeat([EFFORT, 1.0], (masses, states)), horizon)))
    ub = np.tile(np.repeat([limit, np.inf], (masses, states)), horizon)
    name = f"mpc-chain-{masses}-{horizon}"
    problem = QP.build(Q, np.zeros(stage * horizon), C=C, d=d, lb=-ub, ub=ub, name=name)
    facts = {"class": "SPD", "masses": masses, "horizon": horizon, "bounds": True}
    return Instance(problem, properties=facts)
