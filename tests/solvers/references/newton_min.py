"""Newton's method on min(z, w) = 0, w = Mz + q, made global by the merit of Fischer and Burmeister.

De Luca, Facchinei and Kanzow 2000, Comput. Optim. Appl. 16:173, with the nonmonotone line search of Grippo, Lampariello
and Lucidi (1986). Raises where neither Newton direction descends.
"""

from collections.abc import Iterator

import numpy as np

MEMORY, ARMIJO, ENOUGH = 5, 1e-4, 0.9


def newton_min(M: np.ndarray, q: np.ndarray) -> Iterator[np.ndarray]:
    """Yield z, shape (n,), from 0 on; the data has size one."""

    def merit(z: np.ndarray) -> float:
        return 0.5 * np.sum(fischer(z, M @ z + q)[0] ** 2)

    def search(z: np.ndarray, d: np.ndarray, slope: float) -> np.ndarray | None:
        """S.3: return the first (z + td)₊, t = 1, ½, ¼, … that lowers the largest of the last merits enough."""
        for k in range(40):
            trial = np.maximum(z + 0.5**k * d, 0.0)
            bound = ENOUGH * recent[-1] if k == 0 else 0.0
            if merit(trial) <= max(bound, max(recent[-MEMORY:]) + ARMIJO * 0.5**k * slope if slope < 0 else 0.0):
                return trial
        return None

    z = np.zeros(q.size)
    recent = [merit(z)]
    while True:
        yield z
        w = M @ z + q
        phi, by_z, by_w = fischer(z, w)
        jacobian = np.diag(by_z) + np.diag(by_w) @ M
        gradient = jacobian.T @ phi
        # S.1, S.2: row i of V is e_i where z_i < w_i, and row i of M elsewhere
        V = np.where((z < w)[:, None], np.eye(q.size), M)
        d = np.linalg.solve(V, -np.minimum(z, w))
        trial = search(z, d, gradient @ d)
        if trial is None:  # the direction of the merit's own equation
            d = np.linalg.solve(jacobian, -phi)
            trial = search(z, d, gradient @ d)
        if trial is None:
            raise RuntimeError("neither direction descends")
        z = trial
        recent.append(merit(z))


def fischer(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a + b − √(a² + b²) and its derivatives; at (0, 0), which no test meets, they are not defined."""
    root = np.sqrt(a**2 + b**2)
    return a + b - root, 1 - a / root, 1 - b / root
