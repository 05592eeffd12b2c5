"""Gauss–Seidel sweeps over contacts by colours: contacts of one colour share no block, whatever their order.

The kernels leave Python's lock alone while they run.
"""

import numpy as np
from numba import int64, njit, uint32, void

from cpbench_solvers.kernels.array_types import COLUMN, DATA, DATA_2D, QUICK, START, VECTOR
from cpbench_solvers.kernels.gauss_seidel import sweep_2d, sweep_3d


@njit(int64(START, COLUMN, int64[::1]), cache=True)
def colours(start, column, colour):
    """Colour greedily: every contact has the first colour that no neighbour before it has; return their number.

    start, column : the neighbours, j of i where i is one of j.
    """
    nc = start.size - 1
    last = np.full(nc + 1, -1)  # contact that last found this colour taken
    most = 0
    for i in range(nc):
        for k in range(start[i], start[i + 1]):
            j = np.int64(column[k])
            if j < i:
                last[colour[j]] = i
        mine = 0
        while last[mine] == i:
            mine += 1
        colour[i] = mine
        most = max(most, mine + 1)
    return most


@njit(void(START, COLUMN, DATA, int64[::1], int64[::1], int64, START, uint32[::1], VECTOR), cache=True)
def reorder(start, column, blocks, contacts, place, size, new_start, new_column, new_blocks):
    """Write the rows of `contacts` one after another, their columns renamed to `place`; `size` numbers a block."""
    for i in range(contacts.size):
        to = np.int64(new_start[i])
        for k in range(start[contacts[i]], start[contacts[i] + 1]):
            new_column[to] = place[column[k]]
            for a in range(size):
                new_blocks[size * to + a] = blocks[size * np.int64(k) + a]
            to += 1


@njit(
    void(START, COLUMN, DATA, DATA_2D, DATA_2D, DATA, DATA, DATA, VECTOR, VECTOR, int64[::1], int64),
    **QUICK,
    nogil=True,
)
def part(start, column, blocks, diagonal, local, q, mu, rho, r, lam, order, dimension):
    """Sweep over the contacts of `order`, in place on r; see `gauss_seidel`."""
    if dimension == 3:
        sweep_3d(start, column, blocks, diagonal, local, q, mu, rho, r, lam, order, 1.0)
    else:
        sweep_2d(start, column, blocks, diagonal, q, mu, rho, r, order, 1.0)
