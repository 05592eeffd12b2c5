"""What numba takes seconds to compile as NumPy has it, for any shape and type: loops over vectors."""

import math

import numpy as np
from numba import njit


@njit(error_model="numpy")
def unsigned(M):
    """Return a matrix (row pointers, columns, numbers) with unsigned indices: each signed one costs a test for negative
    ones, which takes as long as the rest of a product."""
    return M[0].view(np.uint32), M[1].view(np.uint32), M[2]


@njit(error_model="numpy")
def put(x, y):
    """Set x[:] = y."""
    for k in range(x.size):
        x[k] = y[k]


@njit(error_model="numpy")
def finite(x):
    """Return whether every number of x is finite."""
    odd = 0
    for value in x:
        odd += not math.isfinite(value)
    return odd == 0


@njit(error_model="numpy")
def square(x):
    """Return ‖x‖²."""
    total = 0.0
    for value in x:
        total += value * value
    return total
