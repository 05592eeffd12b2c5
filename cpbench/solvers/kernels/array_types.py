"""The types of arrays in the signatures of kernels, all contiguous, and what fast arithmetic may do."""

from numba import float64, int64, types, uint32, uint64

DATA = types.Array(float64, 1, "C", readonly=True)
DATA_2D = types.Array(float64, 2, "C", readonly=True)
INDEX = types.Array(int64, 1, "C", readonly=True)
START = types.Array(uint64, 1, "C", readonly=True)
COLUMN = types.Array(uint32, 1, "C", readonly=True)
"""What a kernel only reads; START and COLUMN are those of block-CSR."""
VECTOR = float64[::1]
"""What it writes."""
FAST = {"reassoc", "contract", "arcp", "nsz"}
"""Reassociation, contraction, reciprocals and the sign of zero: NaN and infinity keep their meaning."""
