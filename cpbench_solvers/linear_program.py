"""Linear programs by SciPy, for certificates and vertices."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget


def linprog(c: Vector, **program: Any) -> Any:
    """Return what SciPy's `linprog` does. Its import takes longer than most problems take to solve: here it is
    done by the first program only, in a run before anything is timed."""
    from scipy.optimize import linprog as solve

    return solve(c, **program)


def multipliers(c: Vector, budget: Budget, **program: Any) -> Vector | None:
    """Return the x of least cᵀx of a linear program of `linprog` in the seconds of a budget; None without one.

    Its conditions hold to 1e-10: x is to prove something.
    """
    options: dict[str, Any] = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    if np.isfinite(budget.seconds):
        options["time_limit"] = budget.seconds
    return linprog(c, method="highs", options=options, **program).x
