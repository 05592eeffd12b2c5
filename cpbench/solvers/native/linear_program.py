"""Linear programs by SciPy, for certificates and vertices.

SciPy's `optimize` takes longer to import than most problems take to solve: a solver that may need it loads it in its
warm-up, so that the import is on nobody's clock.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any


@cache
def load() -> Callable[..., Any]:
    """Return SciPy's `linprog`, imported on the first call."""
    from scipy.optimize import linprog

    return linprog
