"""The types of arrays in the signatures of kernels, all contiguous, and the options by which kernels are compiled."""

from numba import float64, int64, types, uint32, uint64

DATA = types.Array(float64, 1, "C", readonly=True)
DATA_2D = types.Array(float64, 2, "C", readonly=True)
INDEX = types.Array(int64, 1, "C", readonly=True)
START = types.Array(uint64, 1, "C", readonly=True)
COLUMN = types.Array(uint32, 1, "C", readonly=True)
"""Arrays that a kernel only reads; START and COLUMN are those of block-CSR."""
VECTOR = float64[::1]
"""An array that it writes."""
COMPILED = {"cache": True, "error_model": "numpy", "nogil": True}
"""Options of a kernel: kept on disk; a division by zero is ±∞ or NaN, since a check for it would keep loops from being
vectorised; and other threads go on, as those of a portfolio do."""
KEPT = {"cache": True, "error_model": "numpy"}
"""The same, with the lock of Python held."""
FAST = {"reassoc", "contract", "arcp", "nsz"}
"""Reassociation, contraction, reciprocals and the sign of zero: NaN and infinity keep their meaning."""
QUICK = {**KEPT, "fastmath": FAST}
"""Options of loops whose sums may be made in any order."""
