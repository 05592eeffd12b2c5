"""Rolling resistance: discs and balls on a plane, which rest, roll or slide as formulas say, and planted contacts.

A disc or ball of mass 1 and radius 1 is pressed with the impulse N and pushed sideways with P. It rests while
P ≤ μN and RP ≤ μ_r N; it rolls without sliding where the second fails: m = μ_r N against ω,
v = (P − μ_r N/R)/(1 + J/(mR²)) and ‖r_T‖ = P − mv (Acary and Bourrier 2021 for the law).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.global_contact import GFCPoint, GlobalRollingFrictionContact
from cpbench.formulations.local_contact import RollingFrictionContact
from cpbench.foundation.matrices import Dense
from cpbench.generators.base import Instance, collection, dyadic, generator
from cpbench_problems.generators.contact_planted import DIRECTIONS

CITATION = "Acary and Bourrier 2021, Eur. J. Mech. A/Solids 85:104046; planted by cpbench"
DISC = np.array([[0.0, 1, 0], [1, 0, 0], [0, 1, 1]])
"""H of a disc: unknowns (x, y, ω), rows of the contact (N, T, M) = (y, x + ω, ω)."""
HOOP = np.diag([1.0, 1.0, 1.0])
BALL_INERTIA = 0.5
"""Between that of a solid ball, 2/5, and of a hollow one, 2/3."""


@collection("rolling", "rfc", "discs and balls with rolling resistance, local form", CITATION)
def build_local() -> list[Instance]:
    sizes = (12, 6, 7, 8, 9, 10, 11)
    planted = [_planted(f"planted-{nc}", nc) for nc in sizes]
    return [disc("rests", push=1.0), disc("rolls", push=5.0), _condensed(ball_global(), {"rank": 5}), *planted]


@collection("rolling-global", "grfc", "discs and balls with rolling resistance, global form", CITATION)
def build_global() -> list[Instance]:
    return [coupled_discs(), ball_global(), *(_planted_global(bodies) for bodies in range(3, 11))]


@collection(
    "rolling-large", "rfc", "up to 20,000 contacts with rolling resistance, local form", CITATION, tier="standard"
)
def build_local_large() -> list[Instance]:
    planted = [_planted(f"planted-{nc}", nc) for nc in (40, 100, 200)]
    return [*planted, *(_condensed(_planted_global(bodies)) for bodies in (150, 250, 400, 800, 10_000))]


@collection("rolling-global-large", "grfc", "up to 6250 balls with rolling resistance, global form", CITATION,
            tier="standard")  # fmt: skip
def build_global_large() -> list[Instance]:
    return [_planted_global(bodies) for bodies in (30, 60, 100, 150, 200, 300, 600, 6250)]


def disc(what: str, push: float) -> Instance:
    """Build a hoop (J = 1) pressed with 8 and pushed, μ = 1/2, μ_r = 1/4: it rests up to P = 2, then rolls."""
    pressed, mu, mu_r = 8.0, 0.5, 0.25
    speed = max(push - mu_r * pressed, 0.0) / 2.0
    r = np.array([pressed, speed - push, min(push, mu_r * pressed)])
    problem = RollingFrictionContact(
        W=DISC.T @ DISC,
        q=DISC.T @ np.array([push, -pressed, 0.0]),
        mu=[mu],
        mu_r=[mu_r],
        dimension=3,
        name=f"disc-{what}",
    )
    return Instance(problem, FCPoint(r=r), "closed form", properties={"state": what, "rank": 3, "symmetric": True})


def coupled_discs() -> Instance:
    """Build two such hoops with their centres coupled, the first pushed with 10: they roll as one pushed with 5 would.

    The coupling hands half of the push on: λ = 5.
    """
    H, G = np.kron(np.eye(2), DISC), np.array([[-1.0], [0], [0], [1], [0], [0]])
    one = disc("rolls", push=5.0)
    assert isinstance(one.solution, FCPoint)
    r = np.tile(one.solution.r, 2)
    speed = np.array([1.5, 0.0, -1.5])
    problem = GlobalRollingFrictionContact(
        M=np.kron(np.eye(2), HOOP),
        H=H,
        G=G,
        f=[10.0, -8.0, 0.0, 0.0, -8.0, 0.0],
        w=np.zeros(6),
        mu=[0.5, 0.5],
        mu_r=[0.25, 0.25],
        dimension=3,
        name="coupled-discs",
    )
    return Instance(problem, GFCPoint(v=np.tile(speed, 2), r=r, lam=[5.0]), "closed form", properties={"joints": 1})


def _ball() -> tuple[Dense, Dense]:
    """Return M and H of a ball: unknowns (x, y, z, ω₁, ω₂, ω₃), normal z; u_T = (x − ω₂, y + ω₁), rolling (ω₁, ω₂)."""
    H = np.zeros((6, 5))
    H[2, 0] = H[0, 1] = H[1, 2] = H[3, 3] = H[4, 4] = 1.0
    H[4, 1], H[3, 2] = -1.0, 1.0
    return np.diag([1.0, 1, 1, BALL_INERTIA, BALL_INERTIA, BALL_INERTIA]), H


def ball_global() -> Instance:
    """Build a ball pressed with 8 and pushed with 12.5 along (3, 4)/5, μ = 1, μ_r = 5/8: v = (12.5 − 5)/(3/2) = 5."""
    M, H = _ball()
    v = np.array([3.0, 4.0, 0.0, -4.0, 3.0, 0.0])
    r = np.array([8.0, -4.5, -6.0, 4.0, -3.0])
    problem = GlobalRollingFrictionContact(
        M=M, H=H, f=[7.5, 10.0, -8.0, 0, 0, 0], w=np.zeros(5), mu=[1.0], mu_r=[0.625], name="ball-rolls"
    )
    return Instance(problem, GFCPoint(v=v, r=r), "closed form", properties={"state": "rolls"})


def _contacts(rng: np.random.Generator, states: Sequence[str]) -> tuple[Dense, Dense]:
    """Return r and u, shape (nc, 5) each, of contacts in these states, μ = 5/8, μ_r = 5/16."""
    r, u = np.zeros((len(states), 5)), np.zeros((len(states), 5))
    for c, state in enumerate(states):
        direction, spin = DIRECTIONS[rng.integers(8, size=2)]
        if state == "open":
            u[c] = np.r_[2.0, direction / 16, spin / 16]
            continue
        slides, rolls = state in ("slide", "both"), state in ("roll", "both")
        r[c] = np.r_[8.0, direction * (1.0 if slides else 0.5), spin * (0.5 if rolls else 0.25)]
        u[c] = np.r_[0.0, -direction * slides / 4, -spin * rolls / 8]
    return r, u


STATES = ("stick", "slide", "roll", "both", "open")


def _planted_global(bodies: int) -> Instance:
    """Plant balls on the floor in a row, in contact with the next one too, in all states; v is planted."""
    rng = generator(3100 + bodies)
    pairs = [(b, -1) for b in range(bodies)] + [(b, b + 1) for b in range(bodies - 1)]
    states = [STATES[c % 5] for c in range(len(pairs))]
    large = bodies > 100
    H = (sp.lil_array if large else np.zeros)((6 * bodies, 5 * len(pairs)))
    for c, (first, second) in enumerate(pairs):
        for body, sign in ((first, 1.0), (second, -1.0)):
            if body >= 0:
                H[6 * body : 6 * body + 6, 5 * c : 5 * c + 5] = sign * dyadic(rng, (6, 5), -1, 1, 4)
    mass = np.tile([1.0, 1, 1, BALL_INERTIA, BALL_INERTIA, BALL_INERTIA], bodies)
    M = sp.csr_array(sp.diags_array(mass)) if large else np.diag(mass)
    H = sp.csr_array(H) if large else H
    r, u = _contacts(rng, states)
    v, nc = dyadic(rng, 6 * bodies, -2, 2), len(pairs)
    problem = GlobalRollingFrictionContact(
        M=M, H=H, f=M @ v - H @ r.ravel(), w=u.ravel() - H.T @ v, mu=np.full(nc, 0.625), mu_r=np.full(nc, 0.3125),
        name=f"balls-{bodies}",
    )  # fmt: skip
    properties = {"bodies": bodies, "states": {s: states.count(s) for s in STATES}}
    return Instance(problem, GFCPoint(v=v, r=r.ravel()), "planted", properties=properties)


def _condensed(whole: Instance, facts: Mapping[str, object] | None = None) -> Instance:
    """Return the local form, with more facts; all sums are exact."""
    p = whole.problem
    assert isinstance(p, GlobalRollingFrictionContact)
    assert isinstance(whole.solution, GFCPoint)
    inverse = 1.0 / sp.csr_array(p.M).diagonal()
    W = sp.csr_array(p.H.T @ (sp.diags_array(inverse) @ p.H)) if sp.issparse(p.H) else p.H.T @ (inverse[:, None] * p.H)
    q = p.H.T @ (inverse * p.f) + p.w
    problem = RollingFrictionContact(W=W, q=q, mu=p.mu, mu_r=p.mu_r, name=p.name)
    return Instance(problem, FCPoint(r=whole.solution.r), whole.known, properties={**whole.properties, **(facts or {})})


def _planted(name: str, nc: int) -> Instance:
    """Plant contacts that stick, slide, roll, do both or are open, W of full rank."""
    rng = generator(31)
    states = [STATES[c % 5] for c in range(nc)]
    r, u = _contacts(rng, states)
    B = dyadic(rng, (5 * nc, 5 * nc), -1, 1)
    W = B @ B.T / 8 + np.eye(5 * nc)
    problem = RollingFrictionContact(
        W=W, q=u.ravel() - W @ r.ravel(), mu=np.full(nc, 0.625), mu_r=np.full(nc, 0.3125), name=name
    )
    properties = {"rank": 5 * nc, "symmetric": True, "states": {s: states.count(s) for s in dict.fromkeys(states)}}
    return Instance(problem, FCPoint(r=r.ravel()), "planted", properties=properties)
