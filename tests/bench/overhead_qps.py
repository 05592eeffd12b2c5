"""The quadratic programs that all three harnesses solve, and how many: min ½xᵀPx + qᵀx subject to Gx ≤ h."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from cpbench.solvers.adapters.qp_tolerances import translate
from cpbench.solvers.base import Budget

BACKENDS = ("daqp", "piqp", "proxqp")
"""Dense backends that come with cpbench, each called through qpsolvers by every harness."""
TOLERANCE = 1e-6
SETTINGS = {name: translate(name, Budget(tolerance=TOLERANCE, seconds=10.0)) for name in BACKENDS}
"""What cpbench gives each backend, so that all harnesses ask for the same solves."""
COUNT = "CPBENCH_OVERHEAD_PROBLEMS"
"""Environment variable with the number of problems, for the harnesses that make them in their own process."""


def count() -> int:
    return int(os.environ[COUNT])


def random_qp(seed: int, n: int = 20, m: int = 30) -> dict[str, Any]:
    """A strictly convex QP of n unknowns and m constraints; a random point satisfies them."""
    rng = np.random.default_rng(seed)
    F, G = rng.standard_normal((n, n)), rng.standard_normal((m, n))
    return {
        "P": F @ F.T + np.eye(n),
        "q": rng.standard_normal(n),
        "G": G,
        "h": G @ rng.standard_normal(n) + rng.random(m),
    }
