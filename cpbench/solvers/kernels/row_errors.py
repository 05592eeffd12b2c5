"""The largest error of a row of a linear complementarity problem, by what the rows feel: it hides in norms over all.

Rows are w_i = Σ_j K_ij x_j + k_i. Divided by R_i = √(Σ_j K_ij²) they are of like size, S = max_i max(Σ_j |K_ij x_j|,
|k_i|)/R_i. The constant of an idle row, x_i = 0 < w_i, gives no size: one that is large would hide what is wrong in the
others. An unknown has its unit from its largest effect on a row, E_i = max_d |K_di|/(R_d S). The error of a pair 0 ≤
x_i ⟂ w_i ≥ 0 is then |min(E_i x_i, w_i/(R_i S))|, that of an equality |w_i|/(R_i S). Rows
without a constant do not count: where all of their unknowns should vanish, they have no size.
"""

import math

import numpy as np
from numba import float64, int32, int64, njit, types

from cpbench.solvers.kernels.array_types import COMPILED, DATA, DATA_2D, VECTOR

FAST = {"reassoc", "contract"}
"""Reassociation and contraction only, so that NaN, infinity and divisions keep their meaning."""
INDICES = [(types.Array(index, 1, "C", readonly=True),) * 2 for index in (int32, int64)]
"""Types of the row starts and columns of a CSR matrix."""


@njit(float64(DATA_2D, DATA, DATA, int64, VECTOR, VECTOR), fastmath=FAST, **COMPILED)
def rows_dense(K, k, x, free, w, unit):
    """Write the rows w = Kx + k and R, and return S.

    Parameters
    ----------
    free : the first rows are equalities, beside free unknowns.
    """
    S = 0.0
    for i in range(k.size):
        total, terms, squares = k[i], 0.0, 0.0
        for j in range(k.size):
            term = K[i, j] * x[j]
            total += term
            terms += abs(term)
            squares += K[i, j] * K[i, j]
        w[i], unit[i] = total, math.sqrt(squares)
        if unit[i] > 0.0:
            idle = i >= free and x[i] == 0.0 and total > 0.0
            S = max(S, (terms if idle else max(terms, abs(k[i]))) / unit[i])
    return S


@njit(
    [float64(*index, DATA, DATA, DATA, int64, VECTOR, VECTOR) for index in INDICES],
    fastmath=FAST,
    **COMPILED,
)
def rows_sparse(start, columns, values, k, x, free, w, unit):
    """Write as `rows_dense` does; row i of K has values[start[i]:start[i+1]] in columns[start[i]:start[i+1]]."""
    S = 0.0
    for i in range(k.size):
        total, terms, squares = k[i], 0.0, 0.0
        for e in range(start[i], start[i + 1]):
            term = values[e] * x[columns[e]]
            total += term
            terms += abs(term)
            squares += values[e] * values[e]
        w[i], unit[i] = total, math.sqrt(squares)
        if unit[i] > 0.0:
            idle = i >= free and x[i] == 0.0 and total > 0.0
            S = max(S, (terms if idle else max(terms, abs(k[i]))) / unit[i])
    return S


@njit(float64(DATA_2D, DATA, DATA, int64, DATA, DATA, float64, float64), **COMPILED)
def largest_dense(K, k, x, free, w, unit, S, error):
    """Return the largest error of a row, at least `error`, which is returned where it is no number.

    Parameters
    ----------
    w, unit, S : of `rows_dense`.
    """
    if not S > 0.0:
        return error
    for i in range(x.size):
        if k[i] != 0.0 and unit[i] > 0.0 and (i < free or x[i] > 0.0 or w[i] < 0.0):
            miss = abs(w[i]) / (unit[i] * S)
            if miss > error:
                if i >= free and w[i] > 0.0:
                    effect = 0.0
                    for d in range(x.size):
                        if unit[d] > 0.0:
                            effect = max(effect, abs(K[d, i]) / (unit[d] * S))
                    miss = min(miss, effect * x[i])
                error = max(error, miss)
    return error


@njit([VECTOR(*index, DATA, DATA, float64) for index in INDICES], **COMPILED)
def _effects(start, columns, values, unit, S):
    """Return (n,) the largest effect of each unknown on a row."""
    effect = np.zeros(unit.size)
    for d in range(unit.size):
        for e in range(start[d], start[d + 1]):
            if values[e] != 0.0:
                effect[columns[e]] = max(effect[columns[e]], abs(values[e]) / (unit[d] * S))
    return effect


@njit([float64(*index, DATA, DATA, DATA, int64, DATA, DATA, float64, float64) for index in INDICES], **COMPILED)
def largest_sparse(start, columns, values, k, x, free, w, unit, S, error):
    """Return as `largest_dense` does."""
    if not S > 0.0:
        return error
    effect = np.empty(0)
    for i in range(x.size):
        if k[i] != 0.0 and unit[i] > 0.0 and (i < free or x[i] > 0.0 or w[i] < 0.0):
            miss = abs(w[i]) / (unit[i] * S)
            if miss > error:
                if i >= free and w[i] > 0.0:
                    if effect.size == 0:
                        effect = _effects(start, columns, values, unit, S)
                    miss = min(miss, effect[i] * x[i])
                error = max(error, miss)
    return error


READY = True
