"""The least friction, or the largest load, with which forces at the contacts hold bodies at rest."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.hold_programs import Balance, Distance, distance, for_any_friction, nearest_factor
from cpbench_lab.certifying import require_flint
from cpbench_lab.sweeping import with_value

if TYPE_CHECKING:
    from cpbench_lab.certificates.holding import HoldAnswer

_At: TypeAlias = "tuple[float, HoldAnswer]"
Given: TypeAlias = "Callable[[float], Balance]"
LARGEST = 2.0**40
"""The value, in the units of the parameter, at which the search for the end of an interval stops."""
WIDE = 0.01
"""An interval that is wider, over its upper end, is undecided."""
_PROOFS = {True: "forces in rational arithmetic", False: "a motion that gains by the load and that no force is against"}
_LIMITS = {"mu": "least friction that holds: mu", "load": "largest load that holds: factor"}


@dataclass(frozen=True, eq=False)
class HoldLimit:
    """Answer to the question from which value of a parameter on the bodies begin to move.

    Attributes
    ----------
    name : `mu` or `load`. answer : `limit`, `undecided`, or in words why there is no limit between two values.
    holding, moving : the values at which forces hold the bodies, and at which none do; NaN where there is none.
    at_holding, at_moving : the exact answers there, with their proofs. width : the difference of the values that was
    asked for, over the larger one.
    """

    name: str
    answer: str
    holding: float
    moving: float
    at_holding: HoldAnswer
    at_moving: HoldAnswer
    width: float

    @property
    def narrow(self) -> bool:
        """Whether the question has an answer, and the values are as near to each other as was asked for."""
        if self.answer not in ("limit", "undecided"):
            return True
        return abs(self.holding - self.moving) <= self.width * max(self.holding, self.moving)

    def lines(self, title: str) -> Iterator[str]:
        """Yield the limit, or what is there instead, and the values with what is proved of each."""
        headline = self.answer
        if self.answer == "limit":
            wide = "" if self.narrow else f", which is not decided to the asked {self.width:.3g}"
            headline = f"{_LIMITS[self.name]} = {self.holding:.9g}, to {abs(self.holding - self.moving):.2g}{wide}"
        if self.answer == "undecided":
            low, high = sorted((self.holding, self.moving))
            headline = f"{_LIMITS[self.name]} is undecided between {low:.9g} and {high:.9g}"
        yield f"{title}: {headline}"
        for value, at, holds in ((self.holding, self.at_holding, True), (self.moving, self.at_moving, False)):
            if not math.isnan(value):
                proof = (
                    f"proved: {_PROOFS[holds]}"
                    if at.proved and at.holds is holds
                    else "by a cone program, to rounding; no proof"
                )
                yield f"  {self.name} = {value:<18.12g} {'holds' if holds else 'does not hold':<14} {proof}"
        if not math.isnan(self.holding):
            yield "  holds: some forces keep all at rest; it may move as well, as `cpbench solve` then says"

    def record(self) -> dict[str, Any]:
        """Return the answer and the two values with their proofs as exact fractions, as JSON takes them."""
        record: dict[str, Any] = {"parameter": self.name, "answer": self.answer}
        if self.answer == "limit":
            record["value"] = self.holding
        for key, value, at, part in (
            ("holds", self.holding, self.at_holding, "forces"),
            ("does not hold", self.moving, self.at_moving, "motion"),
        ):
            if not math.isnan(value):
                proof = [str(number) for number in getattr(at, part)]
                record[key] = {"value": value, "proved": bool(proof), part: proof}
        return record


def hold_limit(problem: Problem, load: Vector | None = None, width: float = 1e-6) -> HoldLimit:
    """Return the least coefficient of friction of all contacts that holds the load of a problem, or the largest factor.

    The question is that of limit analysis: are there forces in the cones of friction with which nothing moves? A cone
    program decides it at each value, to rounding; at the two ends of the last interval the answer is proved in rational
    arithmetic where a proof is found, for the doubles of the problem at that value.

    Parameters
    ----------
    problem : fc, or gfc with w = 0 and b = 0. load : what the factor multiplies, added to f (n,) of gfc or q (m,) of
        fc; None: the friction is sought. width : of the interval, over its upper end.

    Raises ProblemError on another problem or load, and CpbenchError without python-flint.

    >>> import cpbench, numpy
    >>> block = cpbench.FrictionContact(W=numpy.eye(2), q=[-4.0, 3.0], mu=[0.5], dimension=2)
    >>> limit = hold_limit(block)
    >>> round(limit.holding, 5), limit.at_holding.proved, limit.at_moving.proved
    (0.75, True, True)
    """
    require_flint()
    from cpbench_lab.certificates.holding import balance_of

    balance = balance_of(problem)
    if load is None:
        with_value(problem, "mu", 1.0)  # refuses what has no coefficients of contacts alone
        return _least_friction(lambda mu: replace(balance, mu=np.full(balance.mu.size, mu)), width)
    field = "q" if problem.node == "fc" else "f"
    if load.shape != balance.f.shape:
        raise ProblemError("load", f"has {load.size} numbers, expected {balance.f.size} as {problem.node}.{field} has")
    return _largest_load(balance, load, width)


def _least_friction(given: Given, width: float) -> HoldLimit:
    """Return the limit of the coefficients that hold: with one all larger ones do, since the cones grow."""
    without = distance(given(0.0))
    if without.holds is not False:
        return _settled("mu", "held without friction: any mu >= 0 holds", given, 0.0, math.nan, width, without)
    if distance(for_any_friction(given(0.0))).holds:
        return _settled("mu", "any mu > 0 holds; mu = 0 does not", given, 2.0**-10, 0.0, width)
    if distance(given(np.inf)).holds is False:
        return _settled("mu", "no mu holds, however large", given, math.nan, 1.0, width)
    return _between("mu", given, 0.0, 1.0, width)


def _largest_load(balance: Balance, load: Vector, width: float) -> HoldLimit:
    """Return the upper end of the factors ≥ 0 that hold, which are an interval, since the loads that hold are convex.
    It has no end where the load alone is held, too."""

    def given(factor: float) -> Balance:
        return replace(balance, f=balance.f + factor * load)

    start, nearest = nearest_factor(balance, load)
    if nearest.holds is False:
        return _settled("load", "no factor >= 0 holds", given, math.nan, 0.0, width)
    unit = (matrices.max_abs(balance.f) or 1.0) / (matrices.max_abs(load) or 1.0)
    start = 0.0 if distance(given(0.0)).holds else start
    at_start = distance(given(start))
    if distance(replace(balance, f=load)).holds:
        first = _divided(0.0, start, lambda value: not distance(given(value)).holds, width)[1]
        words = "holds at any load: every factor" + (f" from {first:.6g} on" if first else "")
        return _settled("load", words, given, start + unit, math.nan, width)
    if not at_start.holds or distance(given(start + 1e-8 * unit)).holds is False:
        return _settled("load", f"no factor above {start:.6g} holds", given, start, math.nan, width, at_start)
    return _between("load", given, start, max(2.0 * start, start + unit), width)


def _settled(
    name: str, words: str, given: Given, holding: float, moving: float, width: float,
    rounding: Distance | None = None,
) -> HoldLimit:  # fmt: skip
    """Return an answer in words, with what is proved at two values. With `rounding`, the distance at the first one, it
    stands only where forces there are exact."""
    from cpbench_lab.certificates.holding import HoldAnswer, held

    at_holding, at_moving = (
        HoldAnswer(None) if math.isnan(value) else held(given(value)) for value in (holding, moving)
    )
    if rounding is not None and not (at_holding.proved and at_holding.holds):
        words = (
            f"by rounding alone: undecided; at {name} = {holding:.6g} forces balance the load to {rounding.above:.1e} "
            "of it, and none was found that does exactly"
        )
        holding = math.nan
    return HoldLimit(name, words, holding, moving, at_holding, at_moving, width)


def _between(name: str, given: Given, low: float, high: float, width: float) -> HoldLimit:
    """Return the limit above `low`; the values below it hold the load, or those above it where `name` is mu."""
    from cpbench_lab.certificates.holding import HoldAnswer, held

    tried: dict[float, bool | None] = {}

    def answer(value: float) -> bool | None:
        if value not in tried:
            tried[value] = distance(given(value)).holds
        return tried[value]

    below = name == "load"  # what holds at `low`
    end = high
    while answer(end) is not (not below):
        low = end if answer(end) is below else low
        if end >= high * LARGEST:
            sides = (low, end) if below else (end, low)
            return HoldLimit(name, "undecided", *sides, HoldAnswer(None), HoldAnswer(None), width)
        end *= 2.0
    first = _divided(low, end, lambda value: answer(value) is below, 0.1 * width)[0]
    end = min(value for value, holds in tried.items() if holds is not below and holds is not None and value > first)
    last = _divided(first, end, lambda value: answer(value) is not (not below), 0.1 * width)[1]
    # the ends are moved apart, by what rounding leaves open at least: a distance that grows slowly is taken as 0 early
    room = max(last - first, 0.3 * width * last)
    start, stop = ((value, held(given(value))) for value in (max(first - room, low), last + room))
    ends = _narrowed(start, stop, below, lambda value: held(given(value)), width)
    (holding, at_holding), (moving, at_moving) = ends if below else ends[::-1]
    wide = abs(holding - moving) > WIDE * max(holding, moving)
    refuted = (at_holding.proved and not at_holding.holds) or (at_moving.proved and at_moving.holds)
    return HoldLimit(name, "undecided" if wide or refuted else "limit", holding, moving, at_holding, at_moving, width)


def _divided(low: float, high: float, at_low: Callable[[float], bool], width: float) -> tuple[float, float]:
    """Return neighbours, to a width over the upper one, of which `at_low` is true and false."""
    while high - low > width * high:
        middle = 0.5 * (low + high)
        if not low < middle < high or high < 1.0 / LARGEST:
            break
        low, high = (middle, high) if at_low(middle) else (low, middle)
    return low, high


def _narrowed(low: _At, high: _At, below: bool, decide: Callable[[float], HoldAnswer], width: float) -> list[_At]:
    """Return the ends of an interval after it was divided by exact proofs and their hints, as far as they decide;
    `below` : whether the lower end is what holds."""
    while high[0] - low[0] > width * high[0]:
        value = 0.5 * (low[0] + high[0])
        at = decide(value)
        if at.holds is None or not low[0] < value < high[0]:
            break
        low, high = ((value, at), high) if at.holds is below else (low, (value, at))
    return [low, high]
