"""Nonsmooth Gauss–Seidel on frictional contact in space (Jean and Moreau 1987; Jourdan, Alart and Jean 1998, CMAME
155:31): contact after contact is solved exactly, with the others held."""

from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq


def nsgs(W: np.ndarray, q: np.ndarray, mu: np.ndarray) -> Iterator[np.ndarray]:
    """Yield r, shape (3·nc,), after every sweep from 0."""
    r = np.zeros(q.size)
    while True:
        for c in range(mu.size):
            at = slice(3 * c, 3 * c + 3)
            D = W[at, at]
            r[at] = one_contact(D, W[at] @ r + q[at] - D @ r[at], mu[c])
        yield r.copy()


def one_contact(D: np.ndarray, v: np.ndarray, mu: float) -> np.ndarray:
    """Return the reaction of u = Dr + v, shape (3,), by the three cases of Coulomb's law."""
    if v[0] >= 0:  # take-off: r = 0, u_N ≥ 0
        return np.zeros(3)
    r = np.linalg.solve(D, -v)  # sticking: u = 0
    if np.hypot(r[1], r[2]) <= mu * r[0]:
        return r

    def sliding(lam: float) -> np.ndarray:
        """Return r with u_N = 0 and u_T = −λ r_T."""
        return np.linalg.solve(D + np.diag([0.0, lam, lam]), -v)

    def outside(lam: float) -> float:
        x = sliding(lam)
        return np.hypot(x[1], x[2]) - mu * x[0]

    top = 1.0
    while outside(top) > 0:
        top *= 4.0
    return sliding(brentq(outside, 0.0, top, xtol=1e-15, rtol=1e-14))
