"""The one table that turns our budget into dparam[SICONOS_DPARAM_TOL] and iparam[SICONOS_IPARAM_MAX_ITER].

Both are set for every solver: the defaults lie between 2e-14 and 1e-3, and 0 and 10 million. Our tolerance ε bounds
every judged number of the node; Siconos' own errors (numerics/src/*_compute_error.c, version 4.4) are

=======  ================================================================  ====================================
node     Siconos' error                                                    beside our judged numbers
=======  ================================================================  ====================================
lcp      ‖min(z, w)‖/‖q‖                                                   our `natural`; no `unit_free`
mlcp     Σ|Au+Cv+a|, Σ of violations and of products v·w, each over        ours is over ‖(a, b)‖ alone: false
         2 + norms (the 1 counted twice)                                   where the data are far below 1
relay    ‖z − P(z − w)‖/(1 + ‖q‖)                                          our `natural`; no `unit_free`
fc, rfc  ‖r − P_K(r − û)‖/max(‖q‖, ‖r‖, ‖u‖) with ρ = 1                    adds a force to a velocity: says nothing
                                                                           where one is far below the other
gfc,     the same with u = Hᵀv + w, plus ‖Mv − Hr − f‖/max of its terms    as fc
grfc
soclcp   ‖x − P_K(x − w)‖/(1 + ‖q‖)                                        ours is over ‖q‖
=======  ================================================================  ====================================

TOL = ε/10 in all of them, and never more than the solver's own default: the factor is what norms of the sum and of the
parts may differ by on data of size 1. Where a test adds 1 to the size of the constants (mlcp, relay, soclcp), TOL is
smaller by that size where it is below 1. No factor mends a sum of a force and a velocity, and of a map (ncp, micp, vi)
no size is known before it is solved: `differs` says so, and cases in which a solver is wrong for that reason stand in
its known_failures (Siconos' `rescaling` is an option of its users, not a part of its test). A NaN passes Siconos'
tests `error > tol`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from cpbench.foundation.matrices import max_abs, norm
from cpbench.solvers.base import Budget
from cpbench.solvers.stopping import Stopping, no_looser

FACTOR = 0.1
NAME = "dparam[SICONOS_DPARAM_TOL]"
SUM = "adds a force to a velocity: it may pass too early where the matrix is far from 1, by that factor"
MAP = "absolute: it may pass too early where F is below 1, whose size is not known before it is solved"


@dataclass(frozen=True)
class ErrorTest:
    """Siconos' test of the problems of one formulation.

    Attributes
    ----------
    text : the error that it compares. differs : what it does not see. constants : vectors of the problem whose size
    and 1 it divides by, where it does.
    """

    text: str
    differs: str = SUM
    constants: tuple[str, ...] = ()


class Bound(IntEnum):
    """iparam[MAX_ITER] where the budget has no bound on iterations (a limit of time holds beside it)."""

    SWEEPS = 20_000
    """Sweeps, projections, gradient steps, pivots: Siconos' default of the variational inequalities."""
    SPLITTING = 5_000
    """Steps of ADMM on the global form, each of which solves with M."""
    NEWTON = 1_000
    OUTER = 200
    """Loops with a solver inside that has its own bound."""


def stopping(test: ErrorTest, default: float, tolerance: float, problem: Any = None) -> Stopping:
    """Return the test of a solver of Siconos and its tolerance. default : the solver's own."""
    defaults = {NAME: default}
    return Stopping(
        test=test.text,
        settings=no_looser({NAME: FACTOR * tolerance * _share(test, problem)}, defaults),
        defaults=defaults,
        differs=test.differs,
        factor=math.inf if test.differs == MAP else _excess(problem),
    )


def limit(budget: Budget, bound: Bound) -> int:
    """Return the most iterations."""
    return int(bound) if budget.iterations is None else budget.iterations


def _share(test: ErrorTest, problem: Any) -> float:
    """Return the size of the constants that a test compares with 1 + itself, at most 1."""
    if problem is None or not test.constants:
        return 1.0
    return min(1.0, norm(np.concatenate([getattr(problem, name) for name in test.constants])) or 1.0)


def _excess(problem: Any) -> float:
    """Return by what the matrix of a problem makes one of force and velocity smaller than the other; 1 without one."""
    names = ("M",) if hasattr(problem, "M") else ("W",) if hasattr(problem, "W") else ("A", "B")
    size = max((max_abs(getattr(problem, name)) for name in names if hasattr(problem, name)), default=1.0)
    return max(size, 1.0 / size) if size > 0 else math.inf
