"""The last digits of a QP on its active set: what holds with equality is taken from an answer, and solved exactly.

Bounds and rows whose multiplier is larger than what is left to their side are active, in data of size one. On them the
conditions of optimality are linear. Active sets follow each other, by the same rule, until one repeats itself (as in
the primal-dual active set method of Hintermüller, Ito and Kunisch 2002, SIAM J. Optim. 13:865).
"""

from __future__ import annotations

import math
import time

import numpy as np

from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation.matrices import transpose
from cpbench_solvers.qp.claims import ErrorMeasure, Parts
from cpbench_solvers.qp.kkt_system import KKT, entries
from cpbench_solvers.qp.scaling import scaled

ROUNDS, REFINEMENTS = 12, 4
"""Active sets at most, and solutions of the linear system with each: its regularization leaves a share of the error."""
GAIN = 0.5
"""The same active set is solved again while the error falls below this share: its system is regularized."""
REGULARIZATION = 1e-6
"""Large enough for rows that depend on others; what it leaves, the next solution takes out."""
FIXED, INACTIVE = 1e10, 1e20
"""Weights that keep unknowns at their bounds, and rows out of the system."""


def polish(problem: QP, answer: Parts, measure: ErrorMeasure, number: int, tolerance: float, deadline: float) -> int:
    """Show `measure` the answers of active sets, until one is within the tolerance; return how many systems were
    factorized. number : of the first answer, for a history."""
    form = scaled(problem, keep_sparse=True)
    kkt, Gt, n = KKT(entries(form.H), entries(form.G), REGULARIZATION), transpose(form.G), form.g.size
    x, y = form.start(QPPoint(*answer))
    lower, upper, equal = form.lower, form.upper, form.lower == form.upper
    before, last, error = None, math.inf, math.inf
    for done in range(ROUNDS):
        if time.monotonic() + kkt.seconds > deadline:
            return done
        s = np.concatenate([x, form.G @ x])
        below, above = equal | (y > s - lower), ~equal & (-y > upper - s)
        active = below | above
        if before is not None and (active == before).all() and error > GAIN * last:
            return done
        before, side = active, np.where(below, lower, np.where(above, upper, 0.0))
        fixed, held = active[:n], active[n:]
        x, y = np.where(fixed, side[:n], x), np.where(active, y, 0.0)
        if not kkt.factor(np.where(fixed, FIXED, 0.0), np.where(held, 0.0, INACTIVE)):
            return done
        for _ in range(REFINEMENTS):
            force = form.H @ x + form.g - Gt @ y[n:]
            left = np.where(held, side[n:] - form.G @ x, 0.0)
            dx, v = kkt.solve(np.where(fixed, 0.0, -force), left)
            x, y[n:] = x + np.where(fixed, 0.0, dx), np.where(held, y[n:] - v, 0.0)
        y[:n] = np.where(fixed, form.H @ x + form.g - Gt @ y[n:], 0.0)
        last, error = error, measure.see(number + done, form.parts(x, y))
        if error <= tolerance:
            return done + 1
    return ROUNDS
