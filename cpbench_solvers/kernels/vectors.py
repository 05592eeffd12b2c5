"""Loops over vectors: what Numba takes seconds to compile as NumPy has it, for any shape and type."""

import math

import numpy as np

from cpbench.foundation.kernels import helper


@helper()
def unsigned(M):
    """Return a matrix (row pointers, columns, numbers) with unsigned indices: each signed one costs a test for negative
    ones, which takes as long as the rest of a product."""
    return M[0].view(np.uint32), M[1].view(np.uint32), M[2]


@helper()
def put(x, y):
    """Set x[:] = y."""
    for k in range(x.size):
        x[k] = y[k]


@helper()
def finite(x):
    """Return whether every number of x is finite."""
    odd = 0
    for value in x:
        odd += not math.isfinite(value)
    return odd == 0


@helper()
def square(x):
    """Return ‖x‖²."""
    total = 0.0
    for value in x:
        total += value * value
    return total
