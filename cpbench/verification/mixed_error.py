"""Error of an answer to a problem with a nonlinear map: linear parts as linear problems, other rows one by one.

A connected part of which all rows are linear, and the sets stay where they are, is an LCP, MLCP or affine inequality
however it is written, and has the error that it has as such (`part_error`). The rows of other parts are measured each
by its own terms (`backward_error`): a Jacobian says nothing of the units elsewhere.

Unknowns that grow without bound while they cancel would pass there, too, on problems without a solution, as (s, s) does
in z₁ − z₂ − 1 + exp(−z₁) beside z₂ − z₁ − 1. So the same holds as in linear parts: the square of what no answer may
have, over constants of the part, must be within ε. What is constant in a nonlinear row is what its terms leave at the
answer, F − F′z, with as much of the terms as is not linear along the answer, (F′(2z) − F′(z))z: a row that goes on as a
straight line hides nothing by growth, and one that bends has a size where it is. No constant is larger than the terms
of its row. A row that says that an unknown is 0 (`vanishing`) has its terms for a constant: it vanishes, and does not
grow.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.sparse.csgraph import connected_components

from cpbench.formulations.base import squared
from cpbench.matrices import Vector
from cpbench.verification.backward_error import EPS, ROUNDINGS, BackwardError, row_errors
from cpbench.verification.frame import Frame, System, inverse, largest
from cpbench.verification.part_error import EXPLAINED, beyond, block_errors, part_error, parts_of, term_sums
from cpbench.verification.parts import Measure, Parts
from cpbench.verification.sets import Flags


def mixed_error(system: System) -> BackwardError:
    """Measure an answer."""
    frame = system.frame
    if not frame.k or frame.steady is None:
        return part_error(system, parts_of(frame, Measure.PAIRS))
    rows, sums, linear = row_errors(system), term_sums(system), _linear_parts(frame)
    if not np.isfinite(sums).all():  # squares of such unknowns are no numbers any more
        return BackwardError(np.inf, False, 0.0)
    whole = dataclasses.replace(frame, constants=_constants(frame, frame.steady, sums), caps=None)
    system = dataclasses.replace(system, frame=whole)
    if not linear.any() and _within_rows(system, sums, float(rows.blocks.max())):
        return BackwardError(largest(float(rows.blocks.max())), rows.absolute, rows.floor)
    found = block_errors(system, Parts.of(whole, whole.terms.rows, Measure.PAIRS), sums)
    errors = np.where(linear, found.blocks, rows.blocks)
    error = largest(float(errors.max()), squared(largest(float(found.beyond.max()))))
    floor = max(0.0 if linear.all() else rows.floor, float(found.floors[linear].max(initial=0.0)))
    if found.explained.any():
        floor = max(floor, EXPLAINED**2)
    return BackwardError(error, rows.absolute or (found.absolute and bool(linear.any())), floor)


def _within_rows(system: System, sums: Vector, error: float) -> bool:
    """Return whether the constants of each row by themselves, no larger than those of its part, are enough."""
    constants = system.frame.constants
    if (constants == 0).any():
        return False
    excess, explained = beyond(system, ROUNDINGS * EPS * (sums + constants), inverse(constants))
    return not explained.any() and squared(largest(float(excess.max()))) <= error


def _constants(frame: Frame, steady: Vector, sums: Vector) -> Vector:
    """Return the constants of rows that no growth hides."""
    constants = np.minimum(steady, sums + frame.constants)
    if frame.caps is None:
        return constants
    row = np.repeat(np.arange(frame.k), np.diff(frame.terms.rows.indptr))
    vanishes = np.isfinite(frame.caps.constants)
    vanishes[row[np.isfinite(frame.caps.entries)]] = True
    return np.where(vanishes, sums + frame.constants, constants)


def _linear_parts(frame: Frame) -> Flags:
    """Return which blocks are in connected parts that are linear altogether."""
    affine = frame.affine
    if affine is None or not affine.any():
        return np.zeros(frame.k, dtype=bool)
    label = connected_components(frame.terms.rows, directed=False)[1]
    bent = np.zeros(frame.k, dtype=bool)
    bent[label[~affine]] = True
    return ~bent[label]
