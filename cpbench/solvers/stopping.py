"""How an adapter translates a tolerance: what its package is asked for, and the test by which the package ends.

Rules of every translation, which the conformance checks hold:

- no value is looser than the package's own default, nor than the tolerance that cpbench was asked for;
- only the problem's data enter, never its start: the value of a map there may be of any size;
- what the package's test does not see is named in `differs`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Stopping:
    """The test by which a package ends, as an adapter asks for it.

    Attributes
    ----------
    test : what the package compares with its tolerances, in words.
    settings : these tolerances by the package's own names, as they are passed; none where it has none.
    defaults : their values where they are not set; ∞ of a test that is off by default.
    differs : what this test does not see of the errors that cpbench measures, '' where it bounds them all.
    factor : by how much the measured error of an answer that passes the test may exceed the tolerance that cpbench was
        asked for; ∞ where nothing bounds it.
    """

    test: str
    settings: Mapping[str, float] = field(default_factory=dict)
    defaults: Mapping[str, float] = field(default_factory=dict)
    differs: str = ""
    factor: float = 1.0


def no_looser(settings: Mapping[str, float], defaults: Mapping[str, float]) -> dict[str, float]:
    """Return settings of which none is larger than its default.

    >>> no_looser({"eps_abs": 1e-5, "eps_rel": 1e-9}, {"eps_abs": 1e-8})
    {'eps_abs': 1e-08, 'eps_rel': 1e-09}
    """
    return {name: min(value, defaults.get(name, value)) for name, value in settings.items()}


def second_tolerance(
    translate: Callable[[float], Stopping | None], tolerance: float, claim: str, error: float | None
) -> float | None:
    """Return the tolerance for which a solver is asked once more, whose answer was claimed to be solved and is not: a
    hundredth of the tolerance, over the factor by which the answer missed it, and not below LEAST.

    None where it would be asked for the same (its package has no tolerance, or is at the least that it takes), and
    where the answer is not finite, which is no matter of tolerances.

    Parameters
    ----------
    translate : `Solver.stopping`. tolerance, error : of the first answer; the error is the larger.

    >>> package = lambda tolerance: Stopping(test="max|F|", settings={"abstol": 0.1 * tolerance})
    >>> second_tolerance(package, 1e-6, "solved", 5e-3)
    2e-12
    """
    first = translate(tolerance)
    if first is None or claim != "solved" or error is None or not tolerance < error < math.inf:
        return None
    smaller = max(MARGIN * tolerance * tolerance / error, LEAST)
    second = translate(smaller)
    return smaller if second is not None and second.settings != first.settings else None


MARGIN = 0.01
"""Part of the tolerance that is asked for beyond the miss: a default that was tighter takes a tenth of it, and there is
no third time. The row keeps what it costs."""
LEAST = 1e-14
"""Least tolerance that a solver is asked for once more: below, rounding decides."""
