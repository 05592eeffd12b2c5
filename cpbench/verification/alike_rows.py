"""Rows of a program that are nearly the same, and what follows of their difference.

Where aᵀz = b and (a + δd)ᵀz ≥ b + δc, dᵀz ≥ c follows, exactly. An answer that misses the second row by ε of its terms
may miss this by ε/δ of its own: as a solution of data that are changed by ε it is right, and of the data as they are it
has no digit. Such an answer is named, not accepted; one that keeps the difference is as good as any.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector

ALIKE = 1e-2
"""Share of their length by which rows that are nearly the same differ at most."""
BESIDE = 4
"""Rows are compared with so many that follow where they are sorted by their products with one vector."""
ROUNDING, SAME = 8.0 * float(np.finfo(np.float64).eps), 64.0 * float(np.finfo(np.float64).eps)
"""Share of its terms that rounding may make of a row; of their length by which rows differ that are the same."""


@dataclass(frozen=True, eq=False)
class AlikeRows:
    """Pairs of rows, brought to units, to length 1 and to one side.

    Attributes
    ----------
    first, second : (p,) their numbers. by_first, by_second : (p,) times which they are taken. difference : (p, n) sizes
        of the entries of the second less the first, of unknowns as they are. constant : (p,) that of their constants.
    """

    first: Any
    second: Any
    by_first: Vector
    by_second: Vector
    difference: Any
    constant: Vector

    @classmethod
    def of(cls, G: Any, signed: Any, D: Vector, C: Vector) -> AlikeRows | None:
        """Find them among the rows of G; None where there are none.

        Parameters
        ----------
        signed : constants of the gradient and of the rows. D, C : units of rows and of unknowns.
        """
        m, n = G.shape
        scaled = sp.csr_array(sp.diags_array(D[n:]) @ G @ sp.diags_array(C[:n]))
        length = np.sqrt(np.asarray(scaled.multiply(scaled).sum(axis=1)).ravel())
        unit = np.divide(1.0, length, out=np.zeros(m), where=length > 0)
        along = unit * (scaled @ np.random.default_rng(0).standard_normal(n))
        unit, order = np.copysign(unit, along), np.argsort(np.abs(along))
        scaled, along = sp.csr_array(sp.diags_array(unit) @ scaled), np.abs(along)[order]
        near = [np.flatnonzero(along[k:] - along[:-k] <= ALIKE * np.sqrt(n)) for k in range(1, min(BESIDE, m - 1) + 1)]
        i = np.concatenate([order[:0], *(order[at] for at in near)])
        j = np.concatenate([order[:0], *(order[at + k + 1] for k, at in enumerate(near))])
        apart = np.sqrt(np.asarray((scaled[i] - scaled[j]).power(2).sum(axis=1)).ravel())
        some = (apart <= ALIKE) & (apart > SAME) & (unit[i] != 0) & (unit[j] != 0)
        if not some.any():
            return None
        i, j, factor = i[some], j[some], unit * D[n:]
        difference = abs(sp.csr_array((scaled[j] - scaled[i]) @ sp.diags_array(1.0 / C[:n])))
        constant = np.abs(factor[j] * signed[n + j] - factor[i] * signed[n + i])
        return cls(i, j, factor[i], factor[j], difference, constant)

    def missed(self, z: Vector, rows: Vector, sums: Vector, equality: Any) -> Vector:
        """Return the share of its own terms by which each difference is missed, beyond rounding; shape (p,).

        Parameters
        ----------
        z : (n,). rows, sums : (m,) values of the rows, ≥ 0 or where `equality` says so 0, and sizes of their terms.
        """
        one, other = self.by_first * rows[self.first], self.by_second * rows[self.second]
        equal, also_equal = equality[self.first], equality[self.second]
        at_least = (equal | (self.by_first < 0)) & (also_equal | (self.by_second > 0))
        at_most = (equal | (self.by_first > 0)) & (also_equal | (self.by_second < 0))
        missed = np.maximum(np.where(at_least, one - other, 0.0), np.where(at_most, other - one, 0.0))
        noise = np.abs(self.by_first) * sums[self.first] + np.abs(self.by_second) * sums[self.second]
        missed, terms = missed - ROUNDING * noise, self.difference @ np.abs(z) + self.constant
        return np.divide(missed, terms, out=np.zeros_like(terms), where=(terms > 0) & (missed > 0))
