"""How wrong an answer to any formulation is, by pairs (a, b) with a = P(a − b) that share nothing with the judge.

The pairs are those of `tests/invariance/inclusions.py`; dense, so for problems of at most a few thousand unknowns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from inclusions import pairs_of
from pairs import Pairs, groups

Array = np.ndarray


def vector(problem: Any, point: Any) -> Array:
    """Return the parts of a point one after the other."""
    return np.concatenate([getattr(point, name) for name in problem.point_sizes])


def _terms(pairs: Pairs) -> tuple[Array, Array]:
    """Return the size of each a and each b: of an unknown itself, of a row the sum of its terms."""
    n = pairs.x.size
    known = np.concatenate([np.abs(pairs.x), pairs.sizes(gross=True)])
    a, b = known[pairs.a_is], known[pairs.b_is]
    beyond = pairs.b_is >= n
    # û of a contact has the sliding speed in it
    return a, np.where(beyond, np.maximum(b, np.abs(pairs.b)), b)


def _blocks(problem: Any, pairs: Pairs) -> Array:
    """Return which part of the answer each pair belongs to."""
    ends = np.cumsum(list(problem.point_sizes.values()))
    n = pairs.x.size
    own = np.where(pairs.a_is < n, pairs.a_is, np.where(pairs.b_is < n, pairs.b_is, 0))
    return np.searchsorted(ends, own, side="right")


def _by_block(sizes: Array, blocks: Array) -> Array:
    """Return for each entry the largest size of its block; 1 where that is 0."""
    most = np.zeros(blocks.max(initial=0) + 1)
    np.maximum.at(most, blocks, sizes)
    return np.where(most[blocks] > 0, most[blocks], 1.0)


def by_largest(problem: Any, right: Any) -> Callable[[Any], float]:
    """Return the function that gives an answer's worst pair, in units in which the largest a and b of its part are 1.

    Sizes are those at the answer or at `right`, the larger.
    """
    a_right, b_right = _terms(pairs_of(problem, right))

    def worst(point: Any) -> float:
        found = pairs_of(problem, point)
        blocks = _blocks(problem, found)
        a, b = _terms(found)
        unit_a = 1.0 / _by_block(np.maximum(a, a_right), blocks)
        unit_b = 1.0 / _by_block(np.maximum(b, b_right), blocks)
        return float(np.max(found.defects(unit_a, unit_b), initial=0.0))

    return worst


def by_row(problem: Any, point: Any) -> float:
    """Return the worst pair in units in which the largest a of its part and the terms of each row of its own are 1."""
    found = pairs_of(problem, point)
    a, b = _terms(found)
    blocks = _blocks(problem, found)
    own = np.zeros(b.size)
    for rows, _ in found.factors:
        own[rows] = b[rows].max()
    unit_b = 1.0 / np.where(own > 0, own, _by_block(b, blocks))
    return float(np.max(found.defects(1.0 / _by_block(a, blocks), unit_b), initial=0.0))


def changed(rng: np.random.Generator, problem: Any, right: Any, most: int) -> Iterator[tuple[str, Any]]:
    """Yield answers beside a right one: one of `most` groups of unknowns zeroed, doubled, halved or turned round."""
    x = vector(problem, right)
    loaded = [g for g in groups(pairs_of(problem, right)) if np.abs(x[g]).max() > 0]
    for k in rng.permutation(len(loaded))[:most]:
        for name, factor in (("zeroed", 0.0), ("doubled", 2.0), ("halved", 0.5), ("turned round", -1.0)):
            y = x.copy()
            y[loaded[k]] *= factor
            yield f"{loaded[k][0]} {name}", problem.point_from_vector(y)
    for name, factor in (("all by 1.01", 1.01), ("nothing", 0.0)):
        yield name, problem.point_from_vector(factor * x)
