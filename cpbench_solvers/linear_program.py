"""Linear programs by SciPy, for certificates and vertices.

SciPy's `optimize` takes longer to import than most problems take to solve: a solver that may need it loads it in its
warm-up, or off the clock where it was warmed up for one problem only.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from cpbench.solvers.clock import off_the_clock


@cache
def load() -> Callable[..., Any]:
    """Return SciPy's `linprog`, imported on the first call."""
    with off_the_clock():
        from scipy.optimize import linprog

    return linprog
