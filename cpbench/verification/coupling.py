"""Small rows that are coupled to large ones only by terms too small for an answer to feel.

A part has one size, for an error in one of its rows is felt in the others. Where a coupling is so weak that nothing is
felt, a large row would hide any error in a small one. A term |K_ij| e_j counts as felt from `FELT` of the sum of row i
on; e_j is |x_j|, or what would make up one whole row where that is more: an unknown that is 0 is coupled, too. This is
the same in all units. No answer can choose its parts: unknowns that a larger row feels are so large themselves that
their errors are measured by at least `FELT` of what they are beside their own row.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench.matrices import Vector
from cpbench.verification.backward_error import EPS
from cpbench.verification.frame import Terms, inverse, segment_max
from cpbench.verification.parts import Measure, Parts
from cpbench.verification.sets import Flags

FELT = 1e-3
"""Share of a row from which on a term is felt, and of a part's size below which a row is small."""


def felt_parts(parts: Parts, sizes: Vector, gross: Vector, held: Flags) -> Parts:
    """Part off small blocks that no felt term couples to the others, by the sizes of an answer.

    `sizes` are those of the unknowns, `gross` the sums of the rows. What would have no size by itself stays, and so
    does what has only sides that are rounding beside its part; `held` unknowns have a size, at a bound that is not 0.
    Rows beside z and rows beside multipliers are compared apart: the objective's unit is in one of them only.
    """
    compared = gross * parts.per_row
    prices, sides = (group.largest(compared[group.at]) for group in (parts.z, parts.multipliers))
    scale = np.zeros(compared.size)
    for group, largest in ((parts.z, prices), (parts.multipliers, sides)):
        scale[group.at] = group.spread(largest)
    small = np.flatnonzero(compared < FELT * scale)
    if not small.size:
        return parts
    pairs = _felt_pairs(parts.frame.terms, small, sizes, gross)
    number = np.full(sizes.size, -1)
    number[small] = np.arange(small.size)
    ends = number[pairs]
    nodes = small.size + parts.count  # what is not small is one node a part
    linked = np.zeros(small.size, dtype=bool)
    if parts.measure is Measure.PAIRS:  # an unknown is where it is felt, whatever the size of the row beside it
        row, unknown = ends[0], pairs[1]
        beside_large = np.zeros(sizes.size, dtype=bool)
        beside_large[unknown[row < 0]] = True
        linked[row[(row >= 0) & beside_large[unknown]]] = True
    else:
        low, high = ends.min(axis=0), ends.max(axis=0)
        linked[high[(low < 0) & (high >= 0)]] = True
    if linked.all():  # each to what is not small
        return parts
    row, column = np.where(ends < 0, small.size + parts.part[pairs], ends)
    if parts.measure is Measure.PAIRS:
        found, column = np.unique(pairs[1], return_inverse=True)
        column = column + nodes
        nodes += found.size
    graph = sp.coo_array((np.ones(row.size), (row, column)), shape=(nodes, nodes))
    count, label = connected_components(graph, directed=False)
    own = np.full(count, -1)
    own[label[small.size : small.size + parts.count]] = np.arange(parts.count)
    new = own[label[: small.size]] < 0
    if not new.any():
        return parts
    apart = _with(parts, small[new], parts.count + label[: small.size][new])
    sided = apart.every.spread(apart.sides) > EPS * parts.every.spread(sides)
    priced = apart.every.spread((apart.prices > 0) & apart.curved)
    new &= (sided | priced | apart.every.spread(apart.every.any(held)))[small]
    return _with(parts, small[new], parts.count + label[: small.size][new]) if new.any() else parts


def _felt_pairs(terms: Terms, small: Any, sizes: Vector, gross: Vector) -> Any:
    """Return rows and unknowns of the terms that are felt, of the unknowns of small rows and pairs; shape (2,
    count)."""
    asked = np.zeros(sizes.size, dtype=bool)
    asked[small] = True
    asked[_segments(terms.rows, small)[0]] = True
    per_row = inverse(gross)
    of_unknown = np.flatnonzero(asked)
    rows, terms_of, indptr = _segments(terms.columns, of_unknown)
    share = terms_of * per_row[rows]
    extent = np.maximum(sizes[of_unknown], inverse(segment_max(share, indptr)))
    lengths = np.diff(indptr)
    felt = ~(share * np.repeat(extent, lengths) < FELT)
    return np.stack([rows[felt], np.repeat(of_unknown, lengths)[felt]])


def _segments(matrix: Any, which: Any) -> tuple[Any, Vector, Any]:
    """Places and values of some rows of a CSR or columns of a CSC matrix, and where each begins."""
    starts = matrix.indptr[which]
    lengths = matrix.indptr[which + 1] - starts
    indptr = np.concatenate([[0], np.cumsum(lengths)])
    at = np.repeat(starts - indptr[:-1], lengths) + np.arange(indptr[-1])
    return matrix.indices[at], matrix.data[at], indptr


def _with(parts: Parts, blocks: Any, labels: Any) -> Parts:
    """Return the parts, with some blocks in others of their own."""
    part = parts.part.copy()
    part[blocks] = labels
    found, part = np.unique(part, return_inverse=True)
    return dataclasses.replace(parts, part=part, count=found.size, split=True)
