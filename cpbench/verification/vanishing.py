"""Rows of a nonlinear map that say that an unknown is 0, and how definite what else is in them makes them.

Fischer and Burmeister's function of a pair a, b with a = 0 < b says a = 0: its row is a + O(a²/b). At an answer with
a = 1e-15 the rest of the row is 1e-30, constants and unknowns alike, and tells nothing about the size of a; yet by the
linearization alone it would be what the row is measured by, and a = 1e-15 be wrong by as much as it is. In a product ab
all terms vanish with a, at one rate.

So a row that is less without one of its terms is looked at again where the unknown of that term is halved, and where it
is 0. What vanishes there, but for rounding, makes the row as definite as its share changes in between, twice that
change, for half of a is left: this is the size of a over that at which the row is no more linear in it. What does not
vanish, as all of a linear row, counts in full. A row of which less than √eps of its terms is left tells nothing of one
unknown: any small term may be as large as what is left.

Without this rule answers to complementarity problems that are written as such equations are wrong where the problem
itself is solved: a pair of 1e-15 would be wrong by 1 (`tests/unit/test_vanishing.py`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench.verification.rows import EPS, ROUNDINGS, Caps
from cpbench.verification.sets import inverse


def caps(F: Any, z: Vector, value: Vector, slope: Any) -> Caps | None:
    """Find them for an answer z with F(z) and F′(z) as CSR; None where no row says that an unknown is 0."""
    terms = slope.data * z[slope.indices]
    row = np.repeat(np.arange(value.size), np.diff(slope.indptr))
    left = np.abs(value[row] - terms)
    best = np.full(value.size, np.inf)
    np.minimum.at(best, row, left)
    sums = np.bincount(row, np.abs(terms), value.size)
    resolved = np.abs(value) > np.sqrt(EPS) * sums
    explained = (left == best[row]) & (left < np.abs(value[row])) & resolved[row]
    faint = slope.indices[explained]
    if not faint.size:
        return None
    half, none = z.copy(), z.copy()
    half[faint] *= 0.5
    none[faint] = 0.0
    here, halfway, end = (_linearized(F, at) for at in (z, half, none))
    (entries, constants, shares, share), (_, _, half_shares, half_share) = here, halfway
    rows = np.zeros(value.size, dtype=bool)
    rows[row[explained]] = True
    for beside, at in (end[:2], halfway[:2]):
        rows &= np.isfinite(at) & (np.bincount(row, ~np.isfinite(beside), value.size) == 0)
    gone = rows & (end[1] < ROUNDINGS * EPS * constants)
    thin = rows[row] & (np.abs(end[0]) < ROUNDINGS * EPS * np.abs(entries))
    return Caps(
        constants=np.where(gone, 2.0 * np.abs(share - half_share), np.inf),
        entries=np.where(thin, 2.0 * np.abs(shares - half_shares), np.inf),
    )


def _linearized(F: Any, z: Vector) -> tuple[Vector, Vector, Vector, Vector]:
    """Return F(z) = F′(z)z + constants at a point: the entries of F′, which are the same ones everywhere, |constants|,
    and the shares of both in the terms of their rows."""
    slope = sp.csr_array(F.jacobian(z))
    constants = np.abs(F(z) - slope @ z)
    unit = inverse(abs(slope) @ np.abs(z) + constants)
    terms = np.abs(slope.data * z[slope.indices]) * np.repeat(unit, np.diff(slope.indptr))
    return slope.data, constants, terms, constants * unit
