"""Projected successive over-relaxation (Cryer 1971, SIAM J. Control 9:385; Cottle, Pang and Stone 1992, 5.2)."""

from collections.abc import Iterator

import numpy as np


def psor(M: np.ndarray, q: np.ndarray, omega: float, *, symmetric: bool = False) -> Iterator[np.ndarray]:
    """Yield z, shape (n,), after every sweep from 0: z_i ← max(0, z_i − ω (Mz + q)_i / M_ii), one i after the other.

    symmetric : whether each sweep is followed by one in the other order, as part of the same sweep.
    """
    z = np.zeros(q.size)
    forth = list(range(q.size))
    while True:
        for i in forth + forth[::-1] if symmetric else forth:
            residual = M[i] @ z + q[i]
            z[i] = max(0.0, z[i] - omega * residual / M[i, i])
        yield z.copy()
