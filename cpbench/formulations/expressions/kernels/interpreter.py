"""Interpreter of all maps: it goes through a list of operations, so that no map is ever compiled by itself.

The numbers of the operators are those of `cpbench.formulations.expressions.operators`, written out: as constants they
become one jump table.
"""

import math

import numpy as np

from cpbench.foundation.kernels import float64, int64, kernel, read_only, void

_FLOATS = read_only(float64)
_TABLE = read_only(int64, 2)
_NUMBERS = read_only(int64)


# No fastmath: comparisons must see NaN and infinity as NumPy does. LLVM makes a switch of the tests.


@kernel(void(_TABLE, _FLOATS, _FLOATS, _NUMBERS, float64[::1], float64[::1]))
def run(operations, z, constants, outputs, values, result):
    """Set result[i] to the value of number outputs[i]; operations : rows (head, left, right); values : work, one a
    value.
    """
    n = z.size
    for k in range(n):
        values[k] = z[k]
    for k in range(constants.size):
        values[n + k] = constants[k]
    at = n + constants.size
    for k in range(operations.shape[0]):
        head = operations[k, 0]
        a = values[operations[k, 1]]
        b = values[max(operations[k, 2], 0)]
        if head == 32:
            c = a + b
        elif head == 33:
            c = a - b
        elif head == 34:
            c = a * b
        elif head == 35:
            c = a / b
        elif head == 0:
            c = -a
        elif head == 1:
            c = abs(a)
        elif head == 2:
            c = np.sqrt(a)
        elif head == 3:
            c = np.exp(a)
        elif head == 4:
            c = np.log(a)
        elif head == 5:
            c = np.expm1(a)
        elif head == 6:
            c = np.log1p(a)
        elif head == 7:
            c = np.sin(a)
        elif head == 8:
            c = np.cos(a)
        elif head == 9:
            c = np.tan(a)
        elif head == 10:
            c = np.arcsin(a)
        elif head == 11:
            c = np.arccos(a)
        elif head == 12:
            c = np.arctan(a)
        elif head == 13:
            c = np.sinh(a)
        elif head == 14:
            c = np.cosh(a)
        elif head == 15:
            c = np.tanh(a)
        elif head == 16:
            c = np.arcsinh(a)
        elif head == 17:
            c = np.arccosh(a)
        elif head == 18:
            c = np.arctanh(a)
        elif head == 19:
            c = math.erf(a)
        elif head == 20:
            c = np.floor(a)
        elif head == 21:
            c = np.ceil(a)
        elif head == 22:
            c = 1.0 if a == 0.0 else 0.0
        elif head == 36:
            c = np.power(a, b)
        elif head == 37:
            c = np.arctan2(a, b)
        elif head == 38:
            c = np.fmin(a, b)
        elif head == 39:
            c = np.fmax(a, b)
        elif head == 40:
            c = 1.0 if a < b else 0.0
        elif head == 41:
            c = 1.0 if a <= b else 0.0
        elif head == 42:
            c = 1.0 if a == b else 0.0
        elif head == 43:
            c = 1.0 if a != 0.0 and b != 0.0 else 0.0
        elif head == 44:
            c = 1.0 if a != 0.0 or b != 0.0 else 0.0
        elif head == 45:
            c = b if a != 0.0 else 0.0
        else:
            c = np.nan
        values[at + k] = c
    for k in range(outputs.size):
        result[k] = values[outputs[k]]
