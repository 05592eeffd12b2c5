"""Judges for the suite to catch: the natural map over one number, or without a part of it.

A judge says whether an answer solves a problem at a tolerance: `judge(problem, point, tolerance) -> (solved, error)`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from inclusions import pairs_of
from pairs import Pairs, identity

from cpbench import verification
from cpbench.verification.nonlinear import row_errors
from cpbench.verification.rows import ROWS

Judge = Callable[[Any, Any, float], tuple[bool, float]]


def cpbench_judge(problem: Any, point: Any, tolerance: float) -> tuple[bool, float]:
    verdict = verification.judge(problem, point, tolerance)
    return verdict.within, verdict.error


def rows_one_by_one(problem: Any, point: Any, tolerance: float) -> tuple[bool, float]:
    """Formulations with nonlinear maps are measured row by row, also where they are linear."""
    if problem.node not in ROWS or not problem.has_maps():
        return cpbench_judge(problem, point, tolerance)
    with np.errstate(all="ignore"):
        error = row_errors(ROWS[problem.node](problem, point)).error
    return error <= tolerance, error


def _by(error: Callable[[Any, Pairs], float]) -> Judge:
    def judge(problem: Any, point: Any, tolerance: float) -> tuple[bool, float]:
        with np.errstate(all="ignore"):
            found = error(problem, pairs_of(problem, point))
        return bool(found <= tolerance), found

    return judge


def _top(values: Any) -> float:
    """The largest finite size."""
    sizes = np.abs(np.ravel(values))
    return float(sizes[np.isfinite(sizes)].max(initial=0.0))


def _plainly(pairs: Pairs, scale: float = 0.0) -> float:
    """The natural map at ρ = 1 over one number, at least 1."""
    return float(pairs.defects().max(initial=0.0)) / max(1.0, scale)


def _sides(problem: Any) -> float:
    return max(_top(getattr(problem, name, ())) for name in ("b", "d", "lb", "ub"))


def _upwards(_: Any, pairs: Pairs) -> float:
    """Equations may be missed upwards."""
    found = [
        max(0.0, -float(pairs.b[rows[0]])) if project is identity else defect
        for (rows, project), defect in zip(pairs.factors, pairs.defects(), strict=True)
    ]
    return max(found, default=0.0)


def _independent(_: Any, pairs: Pairs) -> float:
    """Multipliers are not measured where rows depend on each other."""
    rows = pairs.J[:, pairs.multiplier]
    free = np.linalg.matrix_rank(rows) == rows.shape[1] if rows.size else True
    return _plainly(pairs) if free else 1.0


CONSTANT = _by(lambda p, pairs: _plainly(pairs, _top(pairs.constants)))


@dataclass(frozen=True)
class Broken:
    """A judge that is wrong in one way, and the invariance that finds it."""

    judge: Judge
    invariance: str


BROKEN: dict[str, Broken] = {
    "absolute": Broken(_by(lambda p, pairs: _plainly(pairs)), "units"),
    "all but the last": Broken(_by(lambda p, pairs: float(pairs.defects()[:-1].max(initial=0.0))), "order"),
    "equations upwards": Broken(_by(_upwards), "signs"),
    "equations upwards elsewhere": Broken(_by(_upwards), "representation"),
    "largest constant": Broken(CONSTANT, "idle beside"),
    "largest constant coupled": Broken(CONSTANT, "idle coupled"),
    "largest price": Broken(CONSTANT, "idle price"),
    "largest constant of all": Broken(CONSTANT, "union"),
    "largest side": Broken(_by(lambda p, pairs: _plainly(pairs, _sides(p))), "idle sides"),
    "largest unknown": Broken(_by(lambda p, pairs: _plainly(pairs, _top(pairs.x))), "absent unknown"),
    "objective": Broken(
        _by(lambda p, pairs: _plainly(pairs, abs(p.objective(pairs.x[: p.start.size])) if p.node == "nlp" else 0.0)),
        "constants",
    ),
    "independent rows": Broken(_by(_independent), "repeated rows"),
    "independent multipliers": Broken(_by(_independent), "cancelling multipliers"),
}
"""Judges for the suite to catch, by answers that they are right about as they are first written."""
