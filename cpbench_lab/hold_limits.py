"""The least friction, or the largest load, with which forces at the contacts hold bodies at rest, by bisection."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from cpbench.errors import CpbenchError, ProblemError
from cpbench.formulations.base import Problem
from cpbench.foundation.matrices import Vector
from cpbench_lab.certifying import require_flint
from cpbench_lab.sweeping import with_value

if TYPE_CHECKING:
    from cpbench_lab.certificates.holding import HoldAnswer

Decide: TypeAlias = "Callable[[float], HoldAnswer]"
_At: TypeAlias = "tuple[float, HoldAnswer]"
STEPS = 20
"""Doublings of 1 after which the search for the end of an interval stops."""
PARTS = (0.5, 0.4, 0.6)
"""Where an interval is divided: at the first of these parts at which the question is decided."""
_PROOFS = {True: "forces in rational arithmetic", False: "a motion that gains by the load and that no force is against"}


@dataclass(frozen=True, eq=False)
class HoldLimit:
    """Two values of a parameter, between which the bodies begin to move.

    Attributes
    ----------
    name : `mu` or `load`. holding, moving : the values at which forces hold the bodies, and at which none do.
    at_holding, at_moving : the answers there, with their proofs. width : the difference of the values that was asked
    for, over the larger one.
    """

    name: str
    holding: float
    moving: float
    at_holding: HoldAnswer
    at_moving: HoldAnswer
    width: float

    @property
    def narrow(self) -> bool:
        """Whether the values are as near to each other as was asked for."""
        return abs(self.holding - self.moving) <= self.width * max(self.holding, self.moving)

    def lines(self, title: str) -> Iterator[str]:
        """Yield the limit, and the two values with what is proved of each."""
        kind = "least friction that holds: mu" if self.name == "mu" else "largest load that holds: factor"
        wide = "" if self.narrow else f", which is not decided to the asked {self.width:.3g}"
        yield f"{title}: {kind} = {self.holding:.9g}, to {abs(self.holding - self.moving):.2g}{wide}"
        for value, at, words in (
            (self.holding, self.at_holding, "holds"),
            (self.moving, self.at_moving, "does not hold"),
        ):
            proof = f"proved: {_PROOFS[bool(at.holds)]}" if at.proved else "by a linear program, to rounding; no proof"
            yield f"  {self.name} = {value:<18.12g} {words:<14} {proof}"

    def record(self) -> dict[str, Any]:
        """Return the two values with their proofs as exact fractions, as JSON takes them."""
        return {
            "parameter": self.name,
            "holds": {
                "value": self.holding,
                "proved": self.at_holding.proved,
                "forces": [str(value) for value in self.at_holding.forces],
            },
            "does not hold": {
                "value": self.moving,
                "proved": self.at_moving.proved,
                "motion": [str(value) for value in self.at_moving.motion],
            },
        }


def hold_limit(problem: Problem, load: Vector | None = None, width: float = 1e-6) -> HoldLimit:
    """Return the least coefficient of friction of all contacts that holds the load of a problem, or the largest factor.

    The question is that of limit analysis: are there forces in the cones of friction with which nothing moves? It is
    asked at each value anew, and both answers are proved in rational arithmetic where a proof is found, for the doubles
    of the problem at that value.

    Parameters
    ----------
    problem : fc, or gfc with w = 0 and b = 0. load : what the factor multiplies, added to f (n,) of gfc or q (m,) of
        fc; None: the friction is sought. width : of the interval, over its upper end.

    Raises ProblemError on another problem or load, CpbenchError where no value holds, or all do, and without
    python-flint.

    >>> import cpbench, numpy
    >>> block = cpbench.FrictionContact(W=numpy.eye(2), q=[-4.0, 3.0], mu=[0.5], dimension=2)
    >>> limit = hold_limit(block)
    >>> round(limit.holding, 5), limit.at_holding.proved, limit.at_moving.proved
    (0.75, True, True)
    """
    require_flint()
    from cpbench_lab.certificates.holding import balance_of, held

    balance = balance_of(problem)
    if load is None:
        return _least_friction(lambda value: held(balance_of(with_value(problem, "mu", value))), width)
    field = "q" if problem.node == "fc" else "f"
    if load.shape != balance.f.shape:
        raise ProblemError("load", f"has {load.size} numbers, expected {balance.f.size} as {problem.node}.{field} has")
    return _largest_load(lambda value: held(replace(balance, f=balance.f + value * load)), width)


def _least_friction(decide: Decide, width: float) -> HoldLimit:
    """Return the interval below which nothing holds; raises CpbenchError where there is none."""
    at = decide(0.0)
    if at.holds:
        raise CpbenchError("mu: the load is held without friction: there is no least coefficient to look for")
    low, high = (0.0, at), (1.0, decide(1.0))
    while not high[1].holds:
        low = high if high[1].holds is False else low
        high = _doubled(high[0], decide, "mu: nothing holds the load")
    if low[1].holds is None:
        raise CpbenchError("mu: rounding decides whether the load is held without friction")
    low, high = _divided(low, high, decide, width)
    return HoldLimit("mu", high[0], low[0], high[1], low[1], width)


def _largest_load(decide: Decide, width: float) -> HoldLimit:
    """Return the interval above which nothing holds: the factors that hold are an interval. Raises CpbenchError where
    there is none."""
    powers = [2.0**k for k in range(STEPS + 1)]
    tried = ((factor, decide(factor)) for factor in (0.0, *powers, *(1.0 / power for power in powers[1:])))
    low = next((found for found in tried if found[1].holds), None)
    if low is None:
        raise CpbenchError(
            f"load: no factor holds among 0 and the powers of 2 from {1 / powers[-1]:.2g} to {powers[-1]:.2g}"
        )
    high = (max(2.0 * low[0], 1.0), decide(max(2.0 * low[0], 1.0)))
    while high[1].holds is not False:
        low = high if high[1].holds else low
        high = _doubled(high[0], decide, "load: every factor holds")
    low, high = _divided(low, high, decide, width)
    return HoldLimit("load", low[0], high[0], low[1], high[1], width)


def _doubled(value: float, decide: Decide, words: str) -> tuple[float, HoldAnswer]:
    """Return twice the value with its answer; raises CpbenchError beyond the last power of 2."""
    if value >= 2.0**STEPS:
        raise CpbenchError(f"{words} up to {value:.6g}")
    return 2.0 * value, decide(2.0 * value)


def _divided(low: _At, high: _At, decide: Decide, width: float) -> tuple[_At, _At]:
    """Return the ends of the interval after it has been divided down to the width, or as far as answers are found."""
    while high[0] - low[0] > width * high[0]:
        for part in PARTS:
            value = low[0] + part * (high[0] - low[0])
            at = decide(value)
            if at.holds is not None and low[0] < value < high[0]:
                break
        else:
            break
        low, high = ((value, at), high) if at.holds == low[1].holds else (low, (value, at))
    return low, high
