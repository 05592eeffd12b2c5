"""Global contact problems Mv = Hr + f, u = Hᵀv + w: stacks of boxes under gravity, and planted scenes."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.global_contact import GFCPoint, GlobalFrictionContact
from cpbench.foundation.matrices import Dense
from cpbench.generators.base import Instance, collection, dyadic, generator
from cpbench_problems.generators.contact_planted import MU, between_pairs, contact_states

GRAVITY = 9.8125
"""[m/s²], a multiple of 1/16, so that the reactions of a stack are exact."""
STEP = 2.0**-8
"""Time step [s]."""


@collection(
    "contact-global",
    "gfc",
    "stacks of unit boxes at rest under gravity, and bodies with planted reactions",
    "planted by cpbench; the equilibrium of a stack: each level carries the weight above it",
)
def build() -> list[Instance]:
    return [*(box_stack(levels) for levels in (2, 5, 10)), _planted("bodies-8", 8, 12), _planted("bodies-20", 20, 24)]


@collection(
    "contact-stacks",
    "gfc",
    "stacks of up to 5500 boxes at rest, and up to 9000 bodies with planted reactions",
    "planted by cpbench; the equilibrium of a stack: each level carries the weight above it",
    tier="standard",
)
def build_high() -> list[Instance]:
    stacks = [box_stack(levels) for levels in (25, 50, 100, 200, 500, 5500)]
    return [*stacks, *(_planted(f"bodies-{b}", b, 5 * b // 3) for b in (60, 180, 300, 900, 9000))]


def box_stack(levels: int) -> Instance:
    """Stack unit cubes of 1 kg, each on four corner contacts: 4·levels contacts, 6·levels freedoms, rank deficient.

    At rest v = 0, and the corners of level k carry a quarter of the impulse of the boxes from k upwards. The
    angular velocity is scaled so that the inertia matrix is a power of two.
    """
    n, nc = 6 * levels, 4 * levels
    H = sp.lil_array((n, 3 * nc))
    corners = np.array([[x, y] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])
    for k in range(levels):
        for c, (x, y) in enumerate(corners):
            at = 3 * (4 * k + c)
            H[6 * k : 6 * k + 6, at : at + 3] = _corner(x, y, -0.5)
            if k > 0:
                H[6 * (k - 1) : 6 * k, at : at + 3] = -_corner(x, y, 0.5)
    M = sp.diags_array(np.tile([1.0, 1, 1, 0.125, 0.125, 0.125], levels))
    f = np.tile([0.0, 0, -GRAVITY * STEP, 0, 0, 0], levels)
    r = np.zeros((nc, 3))
    r[:, 0] = np.repeat(GRAVITY * STEP * np.arange(levels, 0, -1) / 4.0, 4)
    problem = GlobalFrictionContact(
        M=sp.csr_array(M), H=sp.csr_array(H), f=f, w=np.zeros(3 * nc), mu=np.full(nc, 0.5), name=f"box-stack-{levels}"
    )
    point = GFCPoint(v=np.zeros(n), r=r.ravel())
    return Instance(problem, point, "closed form", properties={"hyperstatic": True, "contacts": nc})


def _corner(x: float, y: float, z: float) -> Dense:
    """Return wrench of a unit impulse at (x, y, z) from the centre along the normal e_z and the tangents e_x, e_y."""
    arm = np.array([x, y, z])
    axes = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    return np.vstack([axes.T, np.cross(arm, axes).T])


def _planted(name: str, bodies: int, nc: int) -> Instance:
    """Plant bodies with full 6×6 inertia blocks and contacts between random pairs in all states; v is planted too."""
    rng = generator(100 + bodies)
    n = 6 * bodies
    blocks = [inertia(rng) for _ in range(bodies)]
    H = between_pairs(rng, nc, bodies, 3)
    states = [("stick", "slide", "open")[int(rng.integers(3))] for _ in range(nc)]
    r, u = contact_states(rng, states, MU, 3)
    M = sp.csr_array(sp.block_diag([sp.csr_array(block) for block in blocks]))
    v = dyadic(rng, n, -2, 2)
    f, w = M @ v - H @ r.ravel(), u.ravel() - H.T @ v
    problem = GlobalFrictionContact(M=M, H=H, f=f, w=w, mu=np.full(nc, MU), name=name)
    properties = {"states": {s: states.count(s) for s in ("stick", "slide", "open")}}
    return Instance(problem, GFCPoint(v=v, r=r.ravel()), "planted", properties=properties)


def inertia(rng: np.random.Generator) -> Dense:
    """Draw the inertia of a body."""
    G = dyadic(rng, (6, 6), -1, 1, 4)
    return G @ G.T + 4.0 * np.eye(6)
