"""Error of an answer to a problem with nonlinear rows: a componentwise backward error.

Every formulation is a list of unknowns x_c, each paired with a row f_c: x_c is in a set X_c and −f_c in its normal
cone there. A row is measured by the sum of the sizes of its terms, s_d = Σ_c |∂f_d/∂x_c||x_c| + |constant|, an unknown
by its largest effect on a row, E_c = max_d |∂f_d/∂x_c|/s_d. The error is the natural map in these units,

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

from typing import Any

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.verification.linear import by_own_terms
from cpbench.verification.rows import EPS, AnswerError, System, largest_of
from cpbench.verification.sets import inverse


def row_errors(system: System) -> AnswerError:
    """Measure the answer of a system, block by block."""
    frame, sizes, terms = system.frame, system.sizes, system.frame.terms
    none = np.zeros(frame.k)
    if not frame.k:
        return AnswerError(none, none)
    scale = terms @ sizes + frame.constants
    if not np.isfinite(scale).all():  # squares of such unknowns are no numbers any more
        return AnswerError(np.full(frame.k, np.inf), none)
    lengths = np.diff(terms.indptr)
    row = np.repeat(np.arange(frame.k), lengths)
    definite = _definite(system, row, scale)
    homogeneous = (definite == 0) & (scale > 0)
    definite, scale = np.where(homogeneous, np.inf, definite), np.where(homogeneous, 1.0, scale)
    f_unit = np.divide(1.0, scale, out=np.ones_like(scale), where=scale > 0)
    share = frame.norms(system.f) * f_unit
    f_unit *= np.divide(definite, share, out=np.ones_like(share), where=share > definite)
    # the largest effect on a row, per unit, as far as the row is definite
    size, top = sizes[terms.indices], definite[row]
    most = np.divide(top, size, out=np.where(top > 0, np.inf, 0.0), where=size > 0)
    x_unit = largest_of(terms.indices, np.minimum(terms.data * inverse(scale)[row], most), frame.k)
    alone = largest_of(terms.indices, terms.data, frame.k) == 0
    x_unit = np.maximum(np.where(alone | homogeneous, 1.0, x_unit), _bound_units(system))
    errors = system.defect(x_unit, f_unit)
    return AnswerError(errors, np.full(frame.k, EPS * (4.0 + lengths.max())), bool(homogeneous.any()))


def _bound_units(system: System) -> Vector:
    """Return by what an unknown beyond a bound is measured at least, so that it is missed by at most 10 ε of the sides
    that the unknown has and of itself, as of linear rows; 0 for others.

    A row with a large constant holds an unknown at its bound, and hardly feels where it is. What is far below other
    unknowns of its connected part may be their rounding.
    """
    frame, x = system.frame, system.x
    sides = frame.largest(frame.sets.sides)
    missed = frame.any((x < frame.sets.lb) | (x > frame.sets.ub)) & (sides > 0)
    if not missed.any():
        return np.zeros(frame.k)
    of, C = frame.layout.of, frame.layout.C
    terms = np.where(missed, sides + frame.norms(x), 0.0)
    return by_own_terms(terms, inverse(C * of.spread(of.largest(system.sizes / C))))


def _definite(system: System, row: Any, scale: Vector) -> Vector:
    """Return how definite every row is: ∞ with a constant or a fixed unknown, else as far as an unknown is that it
    has. row : of each term."""
    frame, terms, caps = system.frame, system.frame.terms, system.frame.caps
    definite = np.where(frame.constants > 0, np.inf if caps is None else caps.constants, 0.0)
    if ((definite > 0) | (scale <= 0)).all():
        return definite
    sizes = system.sizes[terms.indices]
    effect = terms.data * inverse(scale)[row] * sizes
    top = np.where((terms.data > 0) & (sizes > 0), np.inf if caps is None else caps.entries, 0.0)
    by_unknown = np.where(system.fixed & (system.sizes > 0), np.inf, 0.0)
    while True:  # each unknown and row gives what it has been given, as far as it goes
        by_unknown = np.maximum(by_unknown, largest_of(terms.indices, np.minimum(effect, definite[row]), frame.k))
        wider = np.maximum(definite, largest_of(row, np.minimum(top, by_unknown[terms.indices]), frame.k))
        if not (wider > definite).any():
            return definite
        definite = wider
