"""Nonsmooth Gauss–Seidel sweeps that keep the velocities of the bodies up to date instead of reading a row of W.

With M = LLᵀ and A = L⁻¹H, u = Aᵀy + w for y = Lᵀv, and a change Δ of the reaction of contact c is y += A_cΔ: only the
unknowns of the bodies that c touches. Contact c has the unknowns unknown[start[c]:start[c+1]] and d numbers of A each.
"""

import numpy as np

from cpbench.foundation.kernels import COLUMN, DATA, DATA_2D, FAST, START, VECTOR, float64, int64, kernel, void
from cpbench_solvers.kernels.one_contact import PROJECT, natural_step, one_contact_2d, one_contact_3d


@kernel(void(START, DATA, float64[:, :, ::1]), fast=FAST)
def diagonal_blocks(start, A, D):
    """Set D, shape (nc, d, d), to A_cᵀA_c."""
    d = D.shape[1]
    for i in range(D.shape[0]):
        D[i] = 0.0
        for k in range(start[i], start[i + 1]):
            for a in range(d):
                for b in range(d):
                    D[i, a, b] += A[d * k + a] * A[d * k + b]


@kernel(void(START, COLUMN, DATA, DATA, int64, VECTOR), fast=FAST)
def push(start, unknown, A, r, d, y):
    """Add y += Ar."""
    for i in range(start.size - 1):
        for k in range(start[i], start[i + 1]):
            moved = 0.0
            for a in range(d):
                moved += A[d * k + a] * r[d * i + a]
            y[unknown[k]] += moved


@kernel(void(START, COLUMN, DATA, DATA_2D, DATA_2D, DATA, DATA, DATA, VECTOR, VECTOR, VECTOR, int64), fast=FAST)
def sweeps_3d(start, unknown, A, diagonal, local, w, mu, rho, r, lam, y, count):
    """Make `count` sweeps in place on r, y = L⁻¹(f + Hr) and λ; see `gauss_seidel` for diagonal, local and lam."""
    three, one, two = np.uint64(3), np.uint64(1), np.uint64(2)
    for _ in range(count):
        for i in range(mu.size):
            i3 = three * np.uint64(i)
            u0, u1, u2 = w[i3], w[i3 + one], w[i3 + two]  # unsigned indices throughout: signed ones are tested
            for k in range(start[i], start[i + 1]):
                k3, x = three * np.uint64(k), y[np.uint64(unknown[k])]
                u0 += A[k3] * x
                u1 += A[k3 + one] * x
                u2 += A[k3 + two] * x
            r0, r1, r2 = r[i3], r[i3 + one], r[i3 + two]
            found = False
            x0 = x1 = x2 = 0.0
            if local[i, PROJECT] == 0.0:
                # y has this contact's own reaction in it
                v0 = u0 - (diagonal[i, 0] * r0 + diagonal[i, 1] * r1 + diagonal[i, 2] * r2)
                v1 = u1 - (diagonal[i, 3] * r0 + diagonal[i, 4] * r1 + diagonal[i, 5] * r2)
                v2 = u2 - (diagonal[i, 6] * r0 + diagonal[i, 7] * r1 + diagonal[i, 8] * r2)
                found, x0, x1, x2, lam[i] = one_contact_3d(local, i, v0, v1, v2, mu[i], lam[i])
            if not found:
                x0, x1, x2 = natural_step(r0, r1, r2, u0, u1, u2, mu[i], rho[i])
            r[i3], r[i3 + one], r[i3 + two] = x0, x1, x2
            x0, x1, x2 = x0 - r0, x1 - r1, x2 - r2
            if x0 != 0.0 or x1 != 0.0 or x2 != 0.0:  # a contact that stays moves no body
                for k in range(start[i], start[i + 1]):
                    k3 = three * np.uint64(k)
                    y[np.uint64(unknown[k])] += A[k3] * x0 + A[k3 + one] * x1 + A[k3 + two] * x2


@kernel(void(START, COLUMN, DATA, DATA_2D, DATA, DATA, DATA, VECTOR, VECTOR, int64), fast=FAST)
def sweeps_2d(start, unknown, A, diagonal, w, mu, rho, r, y, count):
    """Sweep as `sweeps_3d` does; the local problem needs nothing but `diagonal`."""
    two, one = np.uint64(2), np.uint64(1)
    for _ in range(count):
        for i in range(mu.size):
            i2 = two * np.uint64(i)
            u0, u1 = w[i2], w[i2 + one]
            for k in range(start[i], start[i + 1]):
                k2, x = two * np.uint64(k), y[np.uint64(unknown[k])]
                u0 += A[k2] * x
                u1 += A[k2 + one] * x
            a, h, g, c = diagonal[i, 0], diagonal[i, 1], diagonal[i, 2], diagonal[i, 3]
            r0, r1 = r[i2], r[i2 + one]
            found, x0, x1 = one_contact_2d(a, h, g, c, u0 - (a * r0 + h * r1), u1 - (g * r0 + c * r1), mu[i])
            if not found:
                x0, x1, _ = natural_step(r0, r1, 0.0, u0, u1, 0.0, mu[i], rho[i])
            r[i2], r[i2 + one] = x0, x1
            x0, x1 = x0 - r0, x1 - r1
            if x0 != 0.0 or x1 != 0.0:
                for k in range(start[i], start[i + 1]):
                    k2 = two * np.uint64(k)
                    y[np.uint64(unknown[k])] += A[k2] * x0 + A[k2 + one] * x1
