"""Model predictive control of a chain of masses: a quadratic program, banded in time; one alone, or one a period."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg import solve_discrete_are

from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import Instance, collection, dyadic, generator, snapped

CITATION = "Wang and Boyd 2010, IEEE Trans. Control Syst. Technol. 18:267 (oscillating masses)"
STEP, STIFFNESS, EFFORT = 2.0**-2, 1.0, 2.0**-2
"""Time step, stiffness of the springs, and weight of the squared forces."""
PUSH, LIMIT = 2.0, 0.25
"""Largest coordinate of the first state, and largest force."""


@collection("mpc-chains", "qp", "control of oscillating masses over a horizon, forces within bounds", CITATION)
def build() -> list[Instance]:
    return [chain(masses, horizon) for masses, horizon in ((2, 6), (3, 10), (4, 20))]


@collection("mpc-chains-large", "qp", "the same with 10⁴ and 10⁵ unknowns", CITATION, tier="standard")
def build_large() -> list[Instance]:
    return [chain(masses, horizon) for masses, horizon in ((6, 200), (10, 333), (6, 5555))]


@collection(
    "mpc-sequences", "qp", "the same in consecutive periods, each with a plan to start from", CITATION, tier="standard"
)
def build_sequences() -> list[Instance]:
    return [*periods(8, 60, 8), *periods(12, 300, 4)]


def dynamics(masses: int) -> tuple[Dense, Dense]:
    """Return A and B of x⁺ = Ax + Bu: masses between springs in a row, held at both ends, x = (positions, speeds);
    semi-implicit Euler, so that all is exact. A force acts on every mass."""
    pull = STIFFNESS * (np.eye(masses, k=1) + np.eye(masses, k=-1) - 2.0 * np.eye(masses))
    one, zero = np.eye(masses), np.zeros((masses, masses))
    speeds = np.hstack([STEP * pull, one])
    A = np.vstack([np.hstack([one, zero]) + STEP * speeds, speeds])
    return A, np.vstack([STEP * STEP * one, STEP * one])


def chain(masses: int, horizon: int) -> Instance:
    """Build the program of a drawn state."""
    name = f"mpc-chain-{masses}-{horizon}"
    facts = {"class": "SPD", "masses": masses, "horizon": horizon, "bounds": True}
    return Instance(program(masses, horizon, drawn_state(masses), name), properties=facts)


def periods(masses: int, horizon: int, count: int) -> list[Instance]:
    """Build the programs of `count` consecutive periods, each with a plan to start from.

    The plant follows Riccati's feedback cut off at the limit, which the first force of the program is where no later
    limit is active; a drawn force disturbs it. The plan to start from is that feedback over the horizon: it satisfies
    all equations and bounds. States are rounded, so that they come out alike on every machine.
    """
    (A, B), rng, state = dynamics(masses), generator(1900 + masses), drawn_state(masses)
    instances: list[Instance] = []
    for period in range(count):
        problem = program(masses, horizon, state, f"mpc-{masses}-{horizon}-period-{period:02d}")
        plan = rollout(masses, horizon, state)
        start = QPPoint(z=plan, lam=np.zeros(0), mu=np.zeros(problem.d.size), nu=np.zeros(plan.size))
        facts = {"class": "SPD", "masses": masses, "horizon": horizon, "period": period, "bounds": True}
        instances.append(Instance(problem, properties=facts, starts=(start,)))
        state = snapped(A @ state + B @ (plan[:masses] + dyadic(rng, masses, -1, 1) / 16))
    return instances


def rollout(masses: int, horizon: int, state: Vector) -> Vector:
    """Return (u_0, x_1, u_1, x_2, ...) under Riccati's feedback for an endless horizon, cut off at the limit."""
    A, B = dynamics(masses)
    P = solve_discrete_are(A, B, np.eye(2 * masses), EFFORT * np.eye(masses))
    gain = np.linalg.solve(EFFORT * np.eye(masses) + B.T @ P @ B, B.T @ P @ A)
    stages = []
    for _ in range(horizon):
        force = snapped(np.clip(-gain @ state, -LIMIT, LIMIT))
        state = A @ state + B @ force
        stages += [force, state]
    return np.concatenate(stages)


def drawn_state(masses: int) -> Vector:
    """Draw positions and speeds up to PUSH."""
    return dyadic(generator(900 + masses), 2 * masses, -1, 1) * PUSH


def program(masses: int, horizon: int, state: Vector, name: str, limit: float = LIMIT) -> QP:
    """Minimise Σ ½|x_k|² + ½ EFFORT |u_{k−1}|² over (u_0, x_1, u_1, x_2, ...) from x_0 = state, |u| ≤ limit.

    Where the limit is not active, the first force is that of Riccati's recursion.
    """
    A, B = dynamics(masses)
    states, stage = 2 * masses, 3 * masses
    one, zero = sp.eye_array(horizon), sp.eye_array(horizon, k=-1)
    now = sp.hstack([sp.csr_array(-B), sp.eye_array(states)])
    before = sp.hstack([sp.csr_array((states, masses)), sp.csr_array(-A)])
    C = sp.csr_array(sp.kron(one, now) + sp.kron(zero, before))
    d = np.zeros(states * horizon)
    d[:states] = A @ state
    Q = sp.csr_array(sp.diags_array(np.tile(np.repeat([EFFORT, 1.0], (masses, states)), horizon)))
    ub = np.tile(np.repeat([limit, np.inf], (masses, states)), horizon)
    return QP.build(Q, np.zeros(stage * horizon), C=C, d=d, lb=-ub, ub=ub, name=name)
