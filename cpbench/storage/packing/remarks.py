"""Remarks on packed contacts: oddities that may be meant, so that they are reported and never changed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cpbench.foundation import matrices
from cpbench.foundation.plurals import counted

SLIPPERY = 3.0
"""μ above this is not a pair of materials: rubber on dry concrete has about 1."""
ROUNDED = 1e-9


def remarks(problem: Any) -> Iterator[str]:
    """Yield sentences on a frictional contact problem."""
    mu = np.asarray(problem.mu, dtype=float)
    if mu.size and mu.max() > SLIPPERY:
        many, c = int((mu > SLIPPERY).sum()), int(mu.argmax())
        where = counted(many, "contact")
        yield f"mu is above {SLIPPERY:g} at {where}, {mu[c]:.3g} at contact {c}: is it an angle or in percent?"
    if problem.node != "fc":
        return
    asymmetry = matrices.asymmetry(problem.W)
    if asymmetry > ROUNDED:
        yield f"W is not symmetric (asymmetry {asymmetry:.1e}): a Delassus matrix H M^-1 H' is"
    trace = problem.mobility.sum(axis=1)
    if (trace < 0).any():
        c = int(trace.argmin())
        where = counted(int((trace < 0).sum()), "contact")
        yield f"W has a negative trace at {where}, the worst is {c}: is its sign right?"
