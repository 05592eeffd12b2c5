"""Other ways for Lemke's method where the first settles nothing: larger pivots, and first bases of two unknowns."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.foundation.kernel_cache import load

PAIRS_KERNEL = "cpbench_solvers.kernels.lemke_pairs"

LARGER_PIVOTS = (1e-9, 1e-7)
"""Least pivots of the next runs, the data scaled to size one. Columns carry rounding errors that grow with the pivots
before; an entry that is nothing else must not be pivoted on, and half of the digits is as far as data can be told."""
PAIRS = 20
"""First bases that are tried: two of three lead to a solution where no ray is in the way of the first, as in games."""


def pairs(M: np.ndarray[Any, Any]) -> Iterator[tuple[int, int]]:
    """Yield pairs (r, i) whose principal block can be a basis, in an order that is drawn once and for all.

    After a first pivot in row r the unknown z_r enters; where its column is not negative anywhere and M_rr = 0, nothing
    blocks it, and every covering vector ends in a ray. So it is in all bimatrix games (Cottle, Pang and Stone 1992,
    section 4.4). Lemke and Howson (1964) begin with z_r and the first unknown i of the other player that it serves
    least, which this does in general; the pivots then go on from the principal transform there.
    """
    least_served = load(PAIRS_KERNEL).least_served
    for r in order(len(M)):
        if (i := least_served(M, r)) >= 0:
            yield int(r), int(i)


@cache
def order(n: int) -> NDArray[np.int64]:
    """Return the first unknowns of the pairs."""
    return np.random.default_rng(0).permutation(n)[:PAIRS].astype(np.int64)
