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

TOL = ε/10 in all of them: the factor is what norms of the sum and of the parts may differ by on data of size 1. No
factor mends the units of an error; the cases in which a solver is wrong for that reason stand in its known_failures
(Siconos' `rescaling` is an option of its users, not a part of its test). A NaN passes Siconos' tests `error > tol`.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

from cpbench.solvers.base import Budget

FACTOR = 0.1


class Bound(IntEnum):
    """iparam[MAX_ITER] where the budget has no bound on iterations (a limit of time holds beside it)."""

    SWEEPS = 20_000
    """Sweeps, projections, gradient steps, pivots: Siconos' default of the variational inequalities."""
    SPLITTING = 5_000
    """Steps of ADMM on the global form, each of which solves with M."""
    NEWTON = 1_000
    OUTER = 200
    """Loops with a solver inside that has a bound of its own."""


def translate(budget: Budget, bound: Bound) -> Mapping[str, Any]:
    """Return the two settings under the names of the guest's options."""
    limit = int(bound) if budget.iterations is None else budget.iterations
    return {"tolerance": FACTOR * budget.tolerance, "max_iter": limit}
