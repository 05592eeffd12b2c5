"""Linear programs by SciPy, for certificates and vertices.

SciPy's `optimize` takes longer to import than most problems take to solve: a solver that may need it loads it in its
warm-up, or off the clock where it was warmed up for one problem only.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget
from cpbench.solvers.clock import off_the_clock


@cache
def load() -> Callable[..., Any]:
    """Return SciPy's `linprog`, imported on the first call."""
    with off_the_clock():
        from scipy.optimize import linprog

    return linprog


def multipliers(c: Vector, budget: Budget, **program: Any) -> Vector | None:
    """Return the x of least cᵀx of a linear program of `linprog` in the seconds of a budget; None without one.

    Its conditions hold to 1e-10: x is to prove something.
    """
    options: dict[str, Any] = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    if np.isfinite(budget.seconds):
        options["time_limit"] = budget.seconds
    return load()(c, method="highs", options=options, **program).x
