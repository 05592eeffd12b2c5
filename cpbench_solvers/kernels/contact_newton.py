"""Equations Φ(x, v) = 0 of frictional contact for semismooth Newton methods, and their Jacobian A + BW.

Every contact gives d equations φ(x_c, v_c) in its reaction x_c and velocity v_c, and a pair of blocks A = ∂φ/∂x,
B = ∂φ/∂v: those of `contact_functions`.

Reference in plain NumPy: `tests/solvers/references/newton_alart_curnier.py`.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, DATA_2D, DATA_3D, INDEX, boolean, float64, int32, int64, kernel, void
from cpbench_solvers.kernels.contact_functions import one_contact

BLOCKS = float64[:, :, ::1]


@kernel(void(int64, DATA, DATA, DATA, DATA_2D, float64[::1], BLOCKS, BLOCKS, boolean[::1]))
def evaluate(kind, x, v, mu, rho, phi, A, B, moves):
    """Evaluate Φ, and its derivatives by contacts.

    Parameters
    ----------
    x, v, phi : (nc·d,). rho : (nc, 2), ϱ_N and ϱ_T. A, B : (nc, d, d). moves : (nc,) false where φ is just x.
    """
    nc = mu.size
    d = x.size // max(nc, 1)
    p, w, f, e = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2)
    a, b = np.zeros((3, 3)), np.zeros((3, 3))
    for i in range(nc):
        for k in range(d):
            p[k], w[k] = x[d * i + k], v[d * i + k]
        one_contact(kind, p, w, mu[i], rho[i, 0], rho[i, 1], f, a, b, e)
        moves[i] = False
        for k in range(d):
            phi[d * i + k] = f[k]
            for m in range(d):
                A[i, k, m], B[i, k, m] = a[k, m], b[k, m]
                # open contacts: their rows are r = 0, and leave the system
                moves[i] |= b[k, m] != 0.0 or a[k, m] != (1.0 if k == m else 0.0)


@kernel(void(DATA_2D, DATA_3D, DATA_3D, INDEX, float64[:, ::1]))
def dense_jacobian(W, A, B, contacts, J):
    """Assemble A + BW over some contacts, J : (d·k, d·k)."""
    d = A.shape[1]
    for p in range(contacts.size):
        i = contacts[p]
        for a in range(d):
            row = J[d * p + a]
            for s in range(contacts.size):
                j = d * contacts[s]
                for b in range(d):
                    total = 0.0
                    for k in range(d):
                        total += B[i, a, k] * W[d * i + k, j + b]
                    row[d * s + b] = total
            for b in range(d):
                row[d * p + b] += A[i, a, b]


@kernel(int64(INDEX, INDEX, DATA_3D, DATA_3D, DATA_3D, INDEX, INDEX, int32[::1], int32[::1], float64[::1]))
def sparse_jacobian(first, row, W, A, B, contacts, number, start, index, value):
    """Return a + BW over some contacts by compressed columns; the number of its entries.

    Parameters
    ----------
    first, row, W : W by columns of blocks, the diagonal ones among them. contacts : (k,). number : (nc,) the place of
    a contact among these, −1 for the others. start : (d·k + 1,). index, value : room for the entries.
    """
    d = A.shape[1]
    filled = 0
    start[0] = 0
    for p in range(contacts.size):
        j = contacts[p]
        for b in range(d):
            for k in range(first[j], first[j + 1]):
                i = row[k]
                if number[i] < 0:  # a contact that is out of the system has d known
                    continue
                for a in range(d):
                    total = A[i, a, b] if i == j else 0.0
                    for m in range(d):
                        total += B[i, a, m] * W[k, m, b]
                    index[filled] = d * number[i] + a
                    value[filled] = total
                    filled += 1
            start[d * p + b + 1] = filled
    return filled
