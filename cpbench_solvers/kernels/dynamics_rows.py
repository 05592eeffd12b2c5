"""Rows of dynamics, joints and contacts as they are felt: the sizes of their terms, and the units that make these even.

Blocks are the contacts, then the velocities, then the joints, numbered in this order. The matrix of a global contact
problem by blocks, [[0, Hᵀ, 0], [H, M, G], [0, Gᵀ, 0]], is in CSR, with the norm of every block.
"""

import numpy as np
from numba import boolean, int64, njit, types, void

from cpbench_solvers.kernels.array_types import COMPILED, DATA, INDEX, VECTOR
from cpbench_solvers.kernels.row_errors import joined, root

BOOLEAN = types.Array(boolean, 1, "C", readonly=True)
HEARD = 0.1
"""Share of the constant of an idle contact that the other terms must reach for it to give a size."""


@njit(void(INDEX, INDEX, DATA, INDEX, INDEX, DATA, INDEX, INDEX, DATA, int64, int64, int64[::1]), **COMPILED)
def label(M_start, M_column, M, H_start, H_column, H, G_start, G_column, G, width, contacts, part):
    """Write the least number of the connected part of every block; stored zeros join nothing."""
    n = M_start.size - 1
    for i in range(part.size):
        part[i] = i
    for e in range(n):
        own = contacts + e
        for k in range(M_start[e], M_start[e + 1]):
            if M[k] != 0.0:
                joined(part, own, contacts + M_column[k])
        for k in range(H_start[e], H_start[e + 1]):
            if H[k] != 0.0:
                joined(part, own, H_column[k] // width)  # all d columns of a contact are one node
        for k in range(G_start[e], G_start[e + 1]):
            if G[k] != 0.0:
                joined(part, own, contacts + n + G_column[k])
    for i in range(part.size):
        part[i] = root(part, i)


@njit(int64(INDEX, INDEX, INDEX, INDEX, INDEX, INDEX, int64, int64, int64[::1]), **COMPILED)
def count(M_start, M_column, H_start, H_column, G_start, G_column, width, contacts, start):
    """Set start[i + 1] to the number of blocks in the rows before and of block i; return how many there are.

    Parameters
    ----------
    M, H, G : in CSR with sorted columns; `width` columns of H a contact. start : (blocks + 1,) of zeros.
    """
    n = M_start.size - 1
    for e in range(n):
        own = contacts + e
        start[own + 1] += M_start[e + 1] - M_start[e]
        last = -1
        for k in range(H_start[e], H_start[e + 1]):
            c = H_column[k] // width
            if c != last:  # columns are sorted: a new contact begins
                start[own + 1] += 1
                start[c + 1] += 1
                last = c
        for k in range(G_start[e], G_start[e + 1]):
            start[own + 1] += 1
            start[contacts + n + G_column[k] + 1] += 1
    for i in range(start.size - 1):
        start[i + 1] += start[i]
    return start[start.size - 1]


@njit(
    void(
        INDEX, INDEX, DATA, INDEX, INDEX, DATA, INDEX, INDEX, DATA, DATA, int64, int64, INDEX, int64[::1], VECTOR
    ),
    **COMPILED,
)  # fmt: skip
def fill(
    M_start, M_column, M, H_start, H_column, H, G_start, G_column, G, unit, width, contacts, start, column, size
):  # fmt: skip
    """Write columns and norms of the blocks that `count` counted.

    Parameters
    ----------
    unit : times these the columns of H are of one unit in every contact.
    """
    n = M_start.size - 1
    at = start[:-1].copy()
    for e in range(n):
        own = contacts + e
        k = H_start[e]
        while k < H_start[e + 1]:
            c = H_column[k] // width
            square = 0.0
            while k < H_start[e + 1] and H_column[k] // width == c:
                # Frobenius' norm of the block, in units that make moments comparable
                square += (H[k] * unit[H_column[k]]) ** 2
                k += 1
            column[at[own]], size[at[own]] = c, np.sqrt(square)
            # Hᵀ in the same pass: rows of contacts are filled in order of bodies
            column[at[c]], size[at[c]] = own, np.sqrt(square)
            at[own] += 1
            at[c] += 1
        for k in range(M_start[e], M_start[e + 1]):
            column[at[own]], size[at[own]] = contacts + M_column[k], abs(M[k])
            at[own] += 1
        for k in range(G_start[e], G_start[e + 1]):
            joint = contacts + n + G_column[k]
            column[at[own]], size[at[own]] = joint, abs(G[k])
            column[at[joint]], size[at[joint]] = own, abs(G[k])
            at[own] += 1
            at[joint] += 1


@njit(
    void(INDEX, INDEX, DATA, DATA, INDEX, DATA, int64, int64, BOOLEAN, DATA, VECTOR, VECTOR, VECTOR, VECTOR), **COMPILED
)
def felt_units(
    start, column, size, D, part, constants, contacts, n, idle, x, per_unknown, per_row, per_constant, sums
):  # fmt: skip
    """Write 1/size of the reactions of every contact, of every row, and of the constants of every row's part, 0 where
    there are none; and the sums of the sizes of the terms of every row.

    Forces are relative to those of their part and velocities to velocities, both in energy, by the sums of the terms of
    the rows. The constant of an idle contact gives no size where others have one. Velocities are at least as large as
    those of the bodies, and as those of the loads where no contact and no joint moves by itself. What has no size is
    measured as it is.

    Parameters
    ----------
    part : (blocks,), of `row_errors.label_parts`. constants : (blocks,), sizes of f, w and b. idle : (contacts,),
    whether a contact is open. x : (blocks,), sizes of the unknowns.
    """
    parts = x.size  # as many as there may be
    forces, velocities, bodies, loads = np.zeros(parts), np.zeros(parts), np.zeros(parts), np.zeros(parts)
    drifts, tight, heard = np.zeros(parts), np.zeros(parts, np.bool_), np.zeros(parts, np.bool_)
    for i in range(x.size):
        sums[i] = 0.0
        for k in range(start[i], start[i + 1]):
            sums[i] += size[k] * x[column[k]]
        p = part[i]
        if contacts <= i < contacts + n:
            forces[p] += (D[i] * max(sums[i], constants[i])) ** 2  # D makes sums of energies of them
            bodies[p] += (x[i] / D[i]) ** 2
            loads[p] += (D[i] * constants[i]) ** 2
        elif constants[i] > 0.0:
            drifts[p] += (D[i] * constants[i]) ** 2
            if i >= contacts or not idle[i]:
                tight[p] = heard[p] = True
            elif sums[i] > HEARD * constants[i]:
                heard[p] = True
    for i in range(x.size):
        if not contacts <= i < contacts + n:
            quiet = i < contacts and idle[i] and heard[part[i]]
            velocities[part[i]] += (D[i] * (sums[i] if quiet else max(sums[i], constants[i]))) ** 2
    for p in range(parts):
        velocities[p] = max(velocities[p], bodies[p])  # contacts of a moving body may stand still to rounding
        if not tight[p]:
            velocities[p] = max(velocities[p], loads[p])
    for i in range(x.size):
        square = (forces if contacts <= i < contacts + n else velocities)[part[i]]
        per_row[i] = D[i] / np.sqrt(square) if square > 0.0 else 1.0
        square = (loads if contacts <= i < contacts + n else drifts)[part[i]]
        per_constant[i] = D[i] / np.sqrt(square) if square > 0.0 else 0.0
    for c in range(contacts):
        effect = 0.0
        for k in range(start[c], start[c + 1]):
            effect = max(effect, size[k] * per_row[column[k]])  # a reaction is as wrong as what it does to a body
        per_unknown[c] = effect if effect > 0.0 else 1.0
