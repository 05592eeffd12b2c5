"""The tests by which the solvers of GAMS end, and what they are asked for."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from cpbench.solvers.stopping import Stopping, no_looser

TESTS: Mapping[str, Stopping] = {
    "path": Stopping(test="residual of its normal map, absolute", defaults={"convergence_tolerance": 1e-6}),
    "miles": Stopping(test="deviation in the 1-norm, absolute", defaults={"contol": 1e-6}),
    "nlpec": Stopping(
        test="complementarity, absolute",
        defaults={"testTol": 1e-5},
        differs="CONOPT, which solves the programs, keeps its own tolerances",
        factor=float("inf"),
    ),
}
"""By the guest's name in GAMS; `settings` are left out, which depend on the tolerance."""


def stopping(guest: str, tolerance: float) -> Stopping:
    """Return the test of a solver of GAMS that is asked for `tolerance`, in its own measure."""
    test = TESTS[guest]
    return dataclasses.replace(test, settings=no_looser(dict.fromkeys(test.defaults, tolerance), test.defaults))
