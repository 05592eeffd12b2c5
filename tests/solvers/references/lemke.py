"""Lemke's method as Cottle, Pang and Stone (1992) state it: algorithm 4.4.5 with the lexicographic rule of section 4.9.

A tableau of dense rows; every step is one line of the algorithm.
"""

import numpy as np

TIE = 1e-12
"""Ratios closer than this are equal; the data has size one."""


def lemke(M: np.ndarray, q: np.ndarray, most: int = 10_000) -> tuple[np.ndarray | None, int]:
    """Return z, shape (n,), and the number of pivots; None in place of z where the path ends in a ray."""
    n = q.size
    if q.min() >= 0:
        return np.zeros(n), 0
    # (4.4.6)  w − Mz − e z₀ = q; the columns are w, z, z₀, q
    tableau = np.hstack([np.eye(n), -M, -np.ones((n, 1)), q[:, None]])
    basis, row, entering = np.arange(n), int(q.argmin()), 2 * n
    # row `row` is negative before its pivot: as the last column it leaves every other row lexicographically positive
    order = [-1, *(j for j in range(n) if j != row), row]
    for pivots in range(1, most):
        leaving = basis[row]
        pivot(tableau, row, entering)
        basis[row] = entering
        if leaving == 2 * n:  # step 3: z₀ has left
            z = np.zeros(2 * n + 1)
            z[basis] = tableau[:, -1]
            return z[n : 2 * n], pivots
        entering = leaving + n if leaving < n else leaving - n  # step 1: the complement of what has left drives
        blocking = np.flatnonzero(tableau[:, entering] > 1e-11)
        if blocking.size == 0:  # step 2: a ray
            return None, pivots
        row = least(tableau, blocking, entering, order, basis == 2 * n)
    raise RuntimeError(f"{most} pivots")


def pivot(tableau: np.ndarray, row: int, column: int) -> None:
    """Exchange the basic variable of a row with the variable of a column."""
    tableau[row] /= tableau[row, column]
    for i in range(len(tableau)):
        if i != row:
            tableau[i] -= tableau[i, column] * tableau[row]


def least(tableau: np.ndarray, blocking: np.ndarray, entering: int, order: list[int], is_z0: np.ndarray) -> int:
    """Return the lexicographically least of the blocking rows, each over its entry of the entering column (4.9);
    z₀ leaves where its ratio is among the least."""
    for column in order:
        ratios = tableau[blocking, column] / tableau[blocking, entering]
        blocking = blocking[ratios <= ratios.min() + TIE]
        if is_z0[blocking].any():
            return int(blocking[is_z0[blocking]][0])
        if blocking.size == 1:
            break
    return int(blocking[0])
