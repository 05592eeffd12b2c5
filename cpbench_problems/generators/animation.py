"""LCPs with the random matrices by which solvers for physics-based animation are compared (Erleben 2013, num4lcp).

Bands stand for the pressures of a fluid on a grid, blocks for contacts with a friction cone of four facets. What
num4lcp draws from a continuous distribution is drawn from multiples of 1/8 or 1/64 here, so that all sums are exact.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import Dense, Matrix
from cpbench.generators.base import Instance, collection, dyadic, generator

BANDS, BLOCK = 3, 6
"""Bands on each side of the diagonal; rows of a contact: normal, four of friction, slack."""
LEAST = 0.5
"""Least eigenvalue to which matrices are shifted."""
FILL, ZEROS = 0.5, {"fluid": 0.25, "contact": 0.5}
"""Share of blocks that are not zero, and of unknowns that are zero in the solution."""


@collection(
    "animation",
    "lcp",
    "random LCPs with the patterns of fluid and contact problems of physics-based animation",
    "Erleben 2013, Numerical Methods for Linear Complementarity Problems in Physics-Based Animation, SIGGRAPH courses "
    "(num4lcp: make_fluid_matrix, make_contact_matrix)",
    tier="standard",
)
def build() -> list[Instance]:
    return [*(fluid(side) for side in (4, 10, 20)), *(contact(count) for count in (10, 100, 200))]


def fluid(side: int) -> Instance:
    """Build side³ unknowns with M of three negative bands on both sides of the diagonal, drawn from (0, 1].

    num4lcp shifts the diagonal until the least eigenvalue, as computed, is 1/2. Here it is 1/2 + 2·(sum of the bands),
    which gives this for infinitely many unknowns, and is exact.
    """
    rng = generator(3300 + side)
    n, bands = side**3, rng.integers(1, 9, BANDS) / 8.0
    steps = np.arange(1, BANDS + 1)
    parts = [np.full(n, LEAST + 2.0 * bands.sum()), *(np.full(n - k, -bands[k - 1]) for k in (*steps, *steps))]
    M = sp.csr_array(sp.diags_array(parts, offsets=[0, *steps.tolist(), *(-steps).tolist()]))
    facts = {"class": "SPD M-matrix", "symmetric": True}
    return _planted(f"fluid-{side}", M, rng, ZEROS["fluid"], facts)


def contact(count: int) -> Instance:
    """Build `count` contacts of six unknowns; M is no positive definite matrix, and other solutions may exist."""
    rng = generator(3400 + count)
    M = contact_pattern(blocked(rng, count))
    facts = {"class": "random, not symmetric", "contacts": count}
    return _planted(f"contact-{count}", sp.csr_array(M), rng, ZEROS["contact"], facts)


def blocked(rng: np.random.Generator, count: int) -> Dense:
    """Return a symmetric matrix of count² blocks, about half of them zero, with entries in [0, 1].

    The diagonal is shifted so that the least eigenvalue is at least LEAST. The shift is rounded up to a multiple of
    1/8: eigenvalues differ in the last digits between machines.
    """
    n = BLOCK * count
    R = rng.integers(0, 65, (n, n)) / 64.0
    A: Dense = 0.5 * (R + R.T)
    centre = BLOCK // 2
    kept = A[centre::BLOCK, centre::BLOCK] <= FILL
    A = A * np.kron(kept, np.ones((BLOCK, BLOCK)))
    least = float(np.linalg.eigvalsh(A)[0])
    return A + np.eye(n) * np.ceil(8.0 * (LEAST - least)) / 8.0 if least <= 0.0 else A


def contact_pattern(A: Dense) -> Dense:
    """Return A with the entries of Stewart and Trinkle's contact model in each block whose first entry is not zero.

    In a block the last row has μ = 1/2, −eᵀ and 0, the last column 0, e and 0.
    """
    M, count = A.copy(), A.shape[0] // BLOCK
    blocks = M.reshape(count, BLOCK, count, BLOCK)
    i, j = np.nonzero(blocks[:, 0, :, 0])
    blocks[i, -1, j, 0] = 0.5
    blocks[i, -1, j, 1:-1] = -1.0
    blocks[i, 0, j, -1] = 0.0
    blocks[i, 1:-1, j, -1] = 1.0
    blocks[i, -1, j, -1] = 0.0
    return M


def _planted(name: str, M: Matrix, rng: np.random.Generator, zeros: float, facts: dict[str, object]) -> Instance:
    """Plant z, about `zeros` of it 0, and w > 0 there.

    num4lcp takes w = Mz there, which may be negative; then its z is no solution.
    """
    n = M.shape[0]
    z = rng.integers(1, 65, n) / 64.0
    z[rng.random(n) < zeros] = 0.0
    w = np.where(z > 0.0, 0.0, dyadic(rng, n, 0, 2) + 0.125)
    problem = LCP(M=M, q=w - M @ z, name=name)
    return Instance(problem, LCPPoint(z=z), "planted", properties=facts)
