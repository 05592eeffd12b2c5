"""Error of an answer to a problem with a nonlinear map: linear parts as linear problems, other rows one by one.

A connected part of which all rows are linear, and the sets stay where they are, is an LCP, MLCP or affine inequality
however it is written, and has the error that it has as such (`part_error`). The rows of other parts are measured each
by its own terms (`backward_error`): a Jacobian says nothing of the units elsewhere.

Unknowns that grow without bound while they cancel would pass there, too, on problems without a solution, as (s, s) does
in z₁ − z₂ − 1 + exp(−z₁) beside z₂ − z₁ − 1. So the same holds as in linear parts: the square of what no answer may
have, over constants of the part, must be within ε. What is constant in a nonlinear row is what its terms leave at the
answer, F − F′z, with as much of the terms as is not linear along the answer, (F′(2z) − F′(z))z: a row that goes on as a
straight line hides nothing by growth, and one that bends has a size where it is. No constant is larger than the terms
of its row. A row that says that an unknown is 0 (`vanishing`) vanishes, and does not grow, and in units of a Jacobian
that holds elsewhere only a row with a constant of its own has a size: others are not asked.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from cpbench.verification.backward_error import EPS, BackwardError, BlockErrors, row_errors
from cpbench.verification.frame import Frame, System
from cpbench.verification.part_error import block_errors, part_error, parts_of
from cpbench.verification.parts import Measure, Parts, connected
from cpbench.verification.sets import Flags


def mixed_error(system: System) -> BackwardError:
    """Measure an answer."""
    frame = system.frame
    if not frame.k or frame.steady is None:
        return part_error(system, parts_of(frame, Measure.PAIRS))
    rows, linear = row_errors(system), _linear_parts(frame)
    sums = frame.terms.sums(system.sizes)
    if not np.isfinite(sums).all():  # squares of such unknowns are no numbers any more
        return BackwardError(np.inf, False, 0.0)
    asked = _asked(frame)
    constants = np.where(asked, np.minimum(frame.steady, sums + frame.constants), 0.0)
    whole = dataclasses.replace(frame, constants=np.where(linear, frame.constants, constants), caps=None)
    parts = Parts.of(whole, whole.terms.sizes, Measure.PAIRS)
    least = float(rows.errors.max()) if not linear.any() else EPS
    found = block_errors(dataclasses.replace(system, frame=whole), parts, sums, least)
    counted = linear | (asked & (constants > 0))
    return BlockErrors(
        np.where(linear, found.errors, rows.errors),
        np.where(counted, found.grown, 0.0),
        np.maximum(np.where(linear, 0.0, rows.floors), np.where(counted, found.floors, 0.0)),
        rows.absolute or (found.absolute and bool(linear.any())),
    ).worst()


def _asked(frame: Frame) -> Flags:
    """Return which rows do not say that an unknown is 0."""
    asked = np.ones(frame.k, dtype=bool)
    if frame.caps is not None:
        row = np.repeat(np.arange(frame.k), frame.terms.lengths)
        asked &= ~np.isfinite(frame.caps.constants)
        asked[row[np.isfinite(frame.caps.entries)]] = False
    return asked


def _linear_parts(frame: Frame) -> Flags:
    """Return which blocks are in connected parts that are linear altogether."""
    affine = frame.affine
    if affine is None or not affine.any():
        return np.zeros(frame.k, dtype=bool)
    label = connected(frame.terms.rows)
    if label is None:
        return np.full(frame.k, affine.all())
    bent = np.zeros(frame.k, dtype=bool)
    bent[label[~affine]] = True
    return ~bent[label]
