"""The error of reactions of every connected part of a contact problem, in sizes that its contacts in use set.

Norms over a part count the free velocities of contacts that stay open, however fast these are, and then say little of
the contacts that carry something. Here the size of the part is s = ‖D max(Σ_b ‖W_cb‖‖r_b‖, ‖q_c‖)‖, without q_c where
the other terms of contact c are below a tenth of q_c (it is open or slides). D makes the rows of ‖W_cb‖ + ‖W_bc‖ on
average 1 (Sinkhorn and Knopp 1967). A reaction is compared in its largest effect on a row.
"""

import numpy as np
from numba import int64, njit, void

from cpbench.solvers.kernels.array_types import COLUMN, DATA, DATA_2D, INDEX, START, VECTOR
from cpbench.solvers.kernels.contact_error import velocity_2d, velocity_3d
from cpbench.solvers.kernels.one_contact import natural_step, projected

SWEEPS = 100
ENOUGH = 1e-3
"""Sweeps of the equilibration at most, and the change of D at which it ends."""
BALANCED = 0.1
"""Share of the free velocity of a contact that the other terms must reach for it to give a size."""


@njit(
    void(START, COLUMN, DATA, DATA_2D, int64, VECTOR, VECTOR, VECTOR, VECTOR),
    cache=True,
    error_model="numpy",
)
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
        D[i] = 1.0 / np.sqrt(2.0 * own[i]) if own[i] > 0.0 else 1.0
    sums, counts = np.empty(nc), np.empty(nc)
    for _ in range(SWEEPS):
        for i in range(nc):
            sums[i], counts[i] = 2.0 * own[i] * D[i], 1.0 if own[i] > 0.0 else 0.0
        for i in range(nc):
            for k in range(start[i], start[i + 1]):
                if sizes[k] > 0.0:
                    j = column[k]
                    sums[i] += sizes[k] * D[j]
                    sums[j] += sizes[k] * D[i]
                    counts[i] += 1.0
        change = 0.0
        for i in range(nc):
            if counts[i] > 0.0 and sums[i] > 0.0:
                new = np.sqrt(D[i] * counts[i] / sums[i])
                change = max(change, abs(new / D[i] - 1.0))
                D[i] = new
        if change < ENOUGH:
            break
    for i in range(nc):
        reach[i] = D[i] * own[i]
    for i in range(nc):
        for k in range(start[i], start[i + 1]):
            j = column[k]
            reach[j] = max(reach[j], D[i] * sizes[k])


@njit(
    void(START, COLUMN, DATA, DATA_2D, DATA, DATA, DATA, int64, DATA, DATA, DATA, DATA, INDEX, VECTOR),
    cache=True,
    error_model="numpy",
)
def part_energy(start, column, blocks, diagonal, q, mu, r, dimension, sizes, own, D, reach, part, errors):
    """Write the error of r in every part; NaN when anything is. Parts without constants are measured in units of D.

    part : (nc,), the number of the part of each contact. errors : as many as there are parts.
    """
    nc, d, many = mu.size, dimension, errors.size
    u, lengths = np.zeros((nc, 3)), np.empty(nc)
    for i in range(nc):
        total = 0.0
        for a in range(d):
            total += r[d * i + a] ** 2
        lengths[i] = np.sqrt(total)
    with_terms, with_all, constants = np.zeros(many), np.zeros(many), np.zeros(many)
    closing, counted = np.zeros(many), np.zeros(many, np.bool_)
    for i in range(nc):
        p = part[i]
        if d == 3:
            u[i, 0], u[i, 1], u[i, 2] = velocity_3d(start, column, blocks, q, r, i)
        else:
            u[i, 0], u[i, 1] = velocity_2d(start, column, blocks, q, r, i)
        free = 0.0
        for a in range(d):
            for b in range(d):
                u[i, a] += diagonal[i, d * a + b] * r[d * i + b]
            free += q[d * i + a] ** 2
        free = np.sqrt(free)
        slide = np.sqrt(u[i, 1] ** 2 + u[i, 2] ** 2)
        terms = own[i] * lengths[i]
        for k in range(start[i], start[i + 1]):
            terms += sizes[k] * lengths[column[k]]
        if terms > BALANCED * free or (u[i, 0] == 0.0 and slide == 0.0):
            counted[p] = counted[p] or free > 0.0
            with_terms[p] += (D[i] * max(terms, free)) ** 2
        else:
            with_terms[p] += (D[i] * terms) ** 2
        with_all[p] += (D[i] * max(terms, free)) ** 2
        constants[p] += (D[i] * free) ** 2
        lacks = 0.0
        if u[i, 0] < 0.0:
            p0, p1, p2 = projected(-u[i, 0] - mu[i] * slide, -u[i, 1], -u[i, 2], mu[i])
            lacks = np.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
            if mu[i] > 1.0:
                lacks = max(lacks, -u[i, 0])
        closing[p] = max(closing[p], D[i] * lacks)
    errors[:] = 0.0
    for i in range(nc):
        r0, r1 = r[d * i], r[d * i + 1]
        r2 = r[d * i + 2] if d == 3 else 0.0
        weight = reach[i]
        rho = D[i] / weight if weight > 0.0 else 1.0
        p0, p1, p2 = natural_step(r0, r1, r2, u[i, 0], u[i, 1], u[i, 2], mu[i], rho)
        law = weight * np.sqrt((r0 - p0) ** 2 + (r1 - p1) ** 2 + (r2 - p2) ** 2)
        if mu[i] > 0.0:
            p0, p1, p2 = projected(r0, r1, r2, mu[i])
            sticks = weight * np.sqrt((r0 - p0) ** 2 + (r1 - p1) ** 2 + (r2 - p2) ** 2)
            sticks += D[i] * np.sqrt(u[i, 0] ** 2 + u[i, 1] ** 2 + u[i, 2] ** 2)
            law = min(law, sticks)
        errors[part[i]] += law * law
    for p in range(many):
        square = with_terms[p] if counted[p] else with_all[p]
        error = np.sqrt(errors[p] / (square if square > 0.0 else 1.0))
        grown = min(closing[p] / np.sqrt(constants[p]), 1.0) if constants[p] > 0.0 else 0.0
        errors[p] = error if not error < grown * grown else grown * grown


READY = True
