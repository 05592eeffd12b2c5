"""Error of an answer to a problem with nonlinear rows: a componentwise backward error.

Every formulation is a list of unknowns x_c, each paired with a row f_c: x_c is in a set X_c and −f_c in its normal
cone there. A row is measured by the sum of the sizes of its terms, s_d = Σ_c |∂f_d/∂x_c||x_c| + |constant|, an unknown
by its largest effect on a row, E_c = max_d |∂f_d/∂x_c|/s_d, or by 1 over the size of X_c where that is finite and the
effect less. The error is the natural map in these units,

    error = max_c ‖x̂_c − P(x̂_c − f̂_c)‖,   x̂_c = E_c x_c,   f̂_c = f_c/s_c,   P the projection on E_c X_c.

A pair (x̂, f̂) is moved by that much to one that is exactly complementary; so the data, changed by at most that share
of every term, have an exact solution (Oettli and Prager 1964; Higham, Accuracy and Stability of Numerical Algorithms,
chapter 7).
The error is the same in all units of unknowns, rows and contacts, whatever stands beside, and in any order.

Rows without a constant need one more rule. Where all of their unknowns should be 0, an answer leaves 1e-12 in each, and
such a row has no size of its own. A row is therefore only as *definite* as what feeds it: a constant makes it
definite without limit, an unknown as far as it has an effect on another definite row. An error in a row counts up to
that, and so does an effect. What no constant feeds is homogeneous: 0 solves it, and it is measured absolutely.
What vanishes with an unknown that a nonlinear row says is 0 makes the row no more definite than that unknown is small
in it (`vanishing`).
"""

from __future__ import annotations

import heapq
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench.verification.rows import EPS, AnswerError, Frame, System, Terms
from cpbench.verification.sets import Flags, inverse


def row_errors(system: System) -> AnswerError:
    """Measure the answer of a system, block by block."""
    frame, none = system.frame, np.zeros(system.frame.k)
    if not frame.k:
        return AnswerError(none, none)
    sizes, fixed = system.sizes, system.fixed
    scale = frame.terms.sums(sizes) + frame.constants
    if not np.isfinite(scale).all():  # squares of such unknowns are no numbers any more
        return AnswerError(np.full(frame.k, np.inf), none)
    definite = _definite(frame, sizes, scale, fixed)
    homogeneous = (definite == 0) & (scale > 0)
    if homogeneous.any():
        sure, by_itself = np.where(homogeneous, np.inf, definite), np.where(homogeneous, 1.0, scale)
        error = _measure(system, sizes, by_itself, sure, homogeneous)
    else:
        error = _measure(system, sizes, scale, definite)
    floors = np.full(frame.k, EPS * (4.0 + frame.terms.lengths.max(initial=0)))
    return AnswerError(error, floors, bool(homogeneous.any()))


def _measure(system: System, sizes: Vector, scale: Vector, definite: Vector, absolute: Flags | None = None) -> Vector:
    """Return the natural map of every block; unknowns of `absolute` rows are measured by themselves."""
    frame = system.frame
    f_unit = np.divide(1.0, scale, out=np.ones_like(scale), where=scale > 0)
    share = frame.norms(system.f) * f_unit
    sure = np.isfinite(definite)
    if sure.any():
        cut = np.divide(definite, share, out=np.ones_like(share), where=share > definite)
        f_unit = np.where(sure, f_unit * cut, f_unit)
    x_unit = _units(frame.terms, sizes, scale, definite)
    if absolute is not None:
        x_unit = np.where(absolute, 1.0, x_unit)
    # a set of finite size is data: an unknown beyond it is wrong even where no row feels that
    x_unit = np.maximum(x_unit, frame.largest(frame.sets.own_unit))
    if frame.moving is not None:
        x_unit = np.where(frame.moving > 0, np.minimum(x_unit, inverse(frame.moving)), x_unit)
    return system.defect(x_unit, f_unit)


def _units(terms: Terms, sizes: Vector, scale: Vector, definite: Vector) -> Vector:
    """Return E_c: the largest effect on a row, per unit; 1 for one that no row has."""
    if not np.isfinite(definite).any():
        units = terms.effects(inverse(scale))
    else:
        effect, own, top = _effects(terms, scale), sizes[terms.rows.indices], terms.by_entry(definite)
        some = own > 0
        effect[some] = np.minimum(effect[some], top[some] / own[some])
        effect[~some & (top == 0)] = 0.0
        units = terms.largest(effect)
    return np.where(terms.alone, 1.0, units)


def _effects(terms: Terms, scale: Vector) -> Vector:
    """Return the effect of each entry's unknown on its row, per unit."""
    return terms.rows.data * terms.by_entry(inverse(scale))


def _definite(frame: Frame, sizes: Vector, scale: Vector, fixed: Flags) -> Vector:
    """Return how definite every row is: ∞ with a constant or a fixed unknown, else as far as an unknown is that it
    has."""
    rows, caps = frame.terms.rows, frame.caps
    definite = np.where(frame.constants > 0, np.inf if caps is None else caps.constants, 0.0)
    if ((definite > 0) | (scale <= 0)).all():
        return definite
    effect = _effects(frame.terms, scale) * sizes[rows.indices]
    own = frame.terms.largest(np.minimum(effect, frame.terms.by_entry(definite)))
    own = np.where(fixed & (sizes > 0), np.inf, own)
    lacking = np.flatnonzero(np.isfinite(definite) & (scale > 0))  # the others have given what they give
    top = np.where((rows.data > 0) & (sizes[rows.indices] > 0), np.inf if caps is None else caps.entries, 0.0)
    down, up = (sp.csr_array((data, rows.indices, rows.indptr), shape=rows.shape)[lacking] for data in (effect, top))
    up = up.tocsc()
    own = np.where(np.diff(up.indptr) > 0, own, 0.0)
    definite[lacking] = _widest([(down, down.data), (up, up.data)], [definite[lacking], own])[0]
    return definite


def _widest(steps: list[tuple[Any, Vector]], values: list[Vector]) -> list[Vector]:
    """Return the largest values that reach rows and unknowns from those given: an entry takes from its row to its
    unknown, or back, as much as it lets through.

    steps : for rows and for unknowns the places of their entries, by rows and by columns, and what these let through.
    """
    heap = [(-v, side, at) for side, known in enumerate(values) for at, v in enumerate(known.tolist()) if v > 0]
    heapq.heapify(heap)
    found = [known.tolist() for known in values]
    while heap:
        value, side, at = heapq.heappop(heap)
        if -value < found[side][at]:
            continue
        places, most = steps[side]
        span = slice(places.indptr[at], places.indptr[at + 1])
        beside = found[1 - side]
        for to, v in zip(places.indices[span].tolist(), np.minimum(most[span], -value).tolist(), strict=True):
            if v > beside[to]:
                beside[to] = v
                heapq.heappush(heap, (-v, 1 - side, to))
    return [np.array(known) for known in found]
