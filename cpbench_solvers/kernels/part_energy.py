"""The error of reactions of every connected part of a contact problem, in sizes that its contacts in use set.

Norms over a part count the free velocities of contacts that stay open, however fast these are, and then say little of
the contacts that carry something. Here the size of the part is s = ‖D max(Σ_b ‖W_cb‖‖r_b‖, ‖q_c‖)‖, without q_c where
the other terms of contact c are below a tenth of q_c (it is open or slides). D makes the rows of ‖W_cb‖ + ‖W_bc‖ on
average 1 (`equilibration`). A reaction is compared in its largest effect on a row.
"""

import numpy as np
from numba import int64, njit, void

from cpbench_solvers.kernels.array_types import COLUMN, DATA, DATA_2D, INDEX, KEPT, START, VECTOR
from cpbench_solvers.kernels.contact_error import velocity_2d, velocity_3d
from cpbench_solvers.kernels.contact_law import miss, velocity
from cpbench_solvers.kernels.equilibration import equilibrate
from cpbench_solvers.kernels.vectors import square

EVEN = 1e-6
"""Share by which norms of blocks that are transposed to each other may differ: nothing beside what D is known to."""
BALANCED = 0.1
"""Share of the free velocity of a contact that the other terms must reach for it to give a size."""


@njit(error_model="numpy")
def _symmetric(start, column, sizes):
    """Return whether ‖W_bc‖ is ‖W_cb‖ to rounding; columns are sorted."""
    at = start[:-1].copy()
    for i in range(at.size):
        for k in range(start[i], start[i + 1]):
            j = column[k]
            other = at[j]  # the next entry of row j must be the transposed one: columns are sorted
            if other == start[j + 1] or column[other] != i or abs(sizes[other] - sizes[k]) > EVEN * sizes[k]:
                return False
            at[j] += 1
    return True


@njit(error_model="numpy")
def _both_ways(start, column, sizes, own):
    """Return ‖W_bc‖ in CSR without zeros where that is symmetric, else its entries and those of the transposed matrix
    side by side, which D makes 1 on average as it would half of their sums."""
    nc, many = own.size, 1 if _symmetric(start, column, sizes) else 2
    begin = np.zeros(nc + 1, np.int64)
    for i in range(nc):
        begin[i + 1] += many if own[i] > 0.0 else 0
        for k in range(start[i], start[i + 1]):
            if sizes[k] > 0.0:
                begin[i + 1] += 1
                begin[column[k] + 1] += many - 1
    for i in range(nc):
        begin[i + 1] += begin[i]
    at, beside, both = begin[:-1].copy(), np.empty(begin[nc], np.int64), np.empty(begin[nc])
    for i in range(nc):
        for _ in range(many if own[i] > 0.0 else 0):
            beside[at[i]], both[at[i]] = i, own[i]
            at[i] += 1
        for k in range(start[i], start[i + 1]):
            if sizes[k] > 0.0:
                j = np.int64(column[k])
                beside[at[i]], both[at[i]] = j, sizes[k]
                at[i] += 1
                if many == 2:
                    beside[at[j]], both[at[j]] = i, sizes[k]
                    at[j] += 1
    return begin, beside, both


@njit(void(START, COLUMN, DATA, DATA_2D, int64, VECTOR, VECTOR, VECTOR, VECTOR), **KEPT)
def weights(start, column, blocks, diagonal, dimension, sizes, own, D, reach):
    """Write the norms of the blocks beside the diagonal and on it, D, and the largest D_b‖W_bc‖ of contact c.

    sizes : (blocks,). own, D, reach : (nc,). Blocks of 0 and their transposed ones do not count.
    """
    nc, d2 = own.size, dimension * dimension
    for k in range(sizes.size):
        total = 0.0
        for e in range(d2 * k, d2 * k + d2):
            total += blocks[e] ** 2
        sizes[k] = np.sqrt(total)
    for i in range(nc):
        total = 0.0
        for e in range(d2):
            total += diagonal[i, e] ** 2
        own[i] = np.sqrt(total)
    begin, beside, both = _both_ways(start, column, sizes, own)
    equilibrate(begin, beside, both, nc, D)
    D *= np.sqrt(0.5)  # of ‖W_cb‖ + ‖W_bc‖, twice the matrix that was given
    for i in range(nc):
        reach[i] = D[i] * own[i]
    for i in range(nc):
        for k in range(start[i], start[i + 1]):
            j = column[k]
            reach[j] = max(reach[j], D[i] * sizes[k])


@njit(error_model="numpy")
def _velocity(start, column, blocks, diagonal, q, r, c, rolling, u):
    """Set u to row c of Wr + q."""
    d = u.size
    if rolling:
        velocity(start, column, blocks, q, r, c, u)
    elif d == 3:
        u[0], u[1], u[2] = velocity_3d(start, column, blocks, q, r, c)  # the fast one, for blocks by columns
    else:
        u[0], u[1] = velocity_2d(start, column, blocks, q, r, c)
    for a in range(d):
        for b in range(d):
            u[a] += diagonal[c, d * a + b] * r[d * c + b]


@njit(void(START, COLUMN, DATA, DATA_2D, DATA, DATA, DATA, DATA, int64, DATA, DATA, DATA, DATA, INDEX, VECTOR), **KEPT)
def part_energy(start, column, blocks, diagonal, q, mu, mu_r, r, dimension, sizes, own, D, reach, part, errors):
    """Write the error of r in every part; NaN when anything is. Parts without constants are measured in units of D.

    Parameters
    ----------
    blocks : by columns for contacts in space, else by rows. mu_r : (nc,), none without rolling friction. q, r : with
    moments in units of a length of the contact. part : (nc,), the number of the part of each contact. errors : as many
    as there are parts.
    """
    nc, d, many, rolling = mu.size, dimension, errors.size, mu_r.size > 0
    u, lengths = np.empty((nc, d)), np.empty(nc)
    zero, x = np.zeros(d), np.empty(d - 1)
    for i in range(nc):
        lengths[i] = np.sqrt(square(r[d * i : d * i + d]))
    with_terms, with_all, constants = np.zeros(many), np.zeros(many), np.zeros(many)
    closing, counted = np.zeros(many), np.zeros(many, np.bool_)
    for i in range(nc):
        p, roll = part[i], mu_r[i] if rolling else 0.0
        _velocity(start, column, blocks, diagonal, q, r, i, rolling, u[i])
        free = np.sqrt(square(q[d * i : d * i + d]))
        terms = own[i] * lengths[i]  # norms of blocks bound what the others do to this contact
        for k in range(start[i], start[i + 1]):
            terms += sizes[k] * lengths[column[k]]
        if terms > BALANCED * free or square(u[i]) == 0.0:
            counted[p] = counted[p] or free > 0.0
            with_terms[p] += (D[i] * max(terms, free)) ** 2  # a contact that something balances gives a size
        else:
            with_terms[p] += (D[i] * terms) ** 2
        with_all[p] += (D[i] * max(terms, free)) ** 2
        constants[p] += (D[i] * free) ** 2
        lacks = np.sqrt(miss(zero, u[i], mu[i], roll, rolling, 1.0, x))
        if mu[i] > 1.0:  # a steep cone hides how fast the contact closes
            lacks = max(lacks, -u[i, 0])
        closing[p] = max(closing[p], D[i] * lacks)
    errors[:] = 0.0
    for i in range(nc):
        roll, reaction = mu_r[i] if rolling else 0.0, r[d * i : d * i + d]
        weight = reach[i]
        rho = D[i] / weight if weight > 0.0 else 1.0  # both defects in energy: no choice of units changes the error
        law = weight * np.sqrt(miss(reaction, u[i], mu[i], roll, rolling, rho, x))
        if mu[i] + roll > 0.0:  # what sticks is off by no more than its distance from the cone and its velocity
            sticks = weight * np.sqrt(miss(reaction, zero, mu[i], roll, rolling, 1.0, x))
            law = min(law, sticks + D[i] * np.sqrt(square(u[i])))
        errors[part[i]] += law * law
    for p in range(many):
        size = with_terms[p] if counted[p] else with_all[p]
        error = np.sqrt(errors[p] / (size if size > 0.0 else 1.0))
        # a reaction too large hides what it lacks: against the constants alone it cannot
        grown = min(closing[p] / np.sqrt(constants[p]), 1.0) if constants[p] > 0.0 else 0.0
        errors[p] = error if not error < grown * grown else grown * grown
