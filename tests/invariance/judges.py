"""Judges for the suite to catch, and the definition of the measure written a second time, densely and slowly.

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


def _per_row(pairs: Pairs, sizes: np.ndarray) -> np.ndarray:
    """1/size of every row. One without constant holds with all its unknowns 0, too: it counts as much as the largest
    of them does in the rows with constants."""
    per_row = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0)
    bare = pairs.constants == 0.0
    effect = np.abs(pairs.J[~bare] * pairs.x * per_row[~bare, None]).max(axis=0, initial=0.0)
    counts = np.where(pairs.J[bare] != 0.0, effect, 0.0).max(axis=1, initial=0.0)
    per_row[bare] *= np.where(counts > 0.0, counts, 1.0)
    return per_row


def units(pairs: Pairs, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Units of a and b: an unknown is measured by its largest effect on a row, a row by its size; the unknowns and the
    rows of one factor have one unit each."""
    n = pairs.x.size
    per_row = _per_row(pairs, sizes)
    for rows, _ in pairs.factors:
        for index in (pairs.a_is[rows] - n, pairs.b_is[rows] - n):
            if index.min() >= 0:
                known = per_row[index][per_row[index] > 0]
                per_row[index] = known.min() if known.size else 0.0
    effect = np.abs(pairs.J * per_row[:, None]).max(axis=0, initial=0.0)
    for rows, _ in pairs.factors:
        for index in (pairs.a_is[rows], pairs.b_is[rows]):
            if index.max() < n:
                effect[index] = effect[index].max()
    unit = np.concatenate([effect, per_row])
    return unit[pairs.a_is], unit[pairs.b_is]


def _in_units(pairs: Pairs, sizes: np.ndarray) -> float:
    return float(pairs.defects(*units(pairs, sizes)).max(initial=0.0))


def _componentwise(_: Any, pairs: Pairs) -> float:
    return _in_units(pairs, pairs.sizes())


COMPONENTWISE: Judge = _by(_componentwise)
"""Componentwise backward error in its simplest form, for small problems."""


def _moderate(_: Any, pairs: Pairs) -> float:
    """Multipliers that are far beyond the constants are taken for growth without a solution."""
    grown = _top(pairs.x[pairs.multiplier]) > 100.0 * _top(pairs.constants)
    return 1.0 if grown else _in_units(pairs, pairs.sizes())


def _one_size(_: Any, pairs: Pairs) -> float:
    """The largest row is the scale of all."""
    sizes = pairs.sizes()
    return _in_units(pairs, np.full(sizes.size, sizes.max(initial=0.0) or 1.0))


def _plainly(pairs: Pairs, scale: float) -> float:
    """The natural map at ρ = 1 over one number, at least 1."""
    return float(pairs.defects().max(initial=0.0)) / max(1.0, scale)


def _top(values: Any) -> float:
    """The largest finite size."""
    sizes = np.abs(np.ravel(values))
    return float(sizes[np.isfinite(sizes)].max(initial=0.0))


def _prices(problem: Any, pairs: Pairs) -> float:
    """In programs, and inequalities with rows, a price is a size for all that a curvature couples to it.

    It is compared as the energy that it moves, p²/Q_ii, which is the same in all units of unknowns.
    """
    if problem.node not in ("qp", "avi", "coneqp"):
        return _in_units(pairs, pairs.sizes())
    from scipy.sparse.csgraph import connected_components

    sizes, n = pairs.sizes(), (problem.q if problem.node == "avi" else problem.p).size
    K = pairs.J[:n, :n]
    root = np.sqrt(np.abs(np.diag(K)))
    energy = np.divide(np.abs(pairs.constants[:n]), root, out=np.zeros(n), where=root > 0)
    part = connected_components(K != 0.0, directed=False)[1]
    top = np.array([energy[part == k].max() for k in part])
    sizes[:n] = np.maximum(sizes[:n], root * top)
    return _in_units(pairs, sizes)


def _sides(problem: Any) -> float:
    return max(_top(getattr(problem, name, ())) for name in ("b", "d", "lb", "ub"))


def _upwards(_: Any, pairs: Pairs) -> float:
    """Equations may be missed upwards."""
    found = [
        max(0.0, -float(pairs.b[rows[0]])) if project is identity else defect
        for (rows, project), defect in zip(pairs.factors, pairs.defects(), strict=True)
    ]
    return max(found, default=0.0)


def _all_but_the_last(_: Any, pairs: Pairs) -> float:
    return float(pairs.defects(*units(pairs, pairs.sizes()))[:-1].max(initial=0.0))


def _independent(_: Any, pairs: Pairs) -> float:
    """Multipliers are not measured where rows depend on each other."""
    rows = pairs.J[:, pairs.multiplier]
    free = np.linalg.matrix_rank(rows) == rows.shape[1] if rows.size else True
    return _in_units(pairs, pairs.sizes()) if free else 1.0


def _with_constants(_: Any, pairs: Pairs) -> float:
    """Rows without constant are left out."""
    per_factor = pairs.defects(*units(pairs, pairs.sizes()))
    bare = np.concatenate([np.zeros(pairs.x.size, dtype=bool), pairs.constants == 0.0])
    counted = [
        defect
        for (rows, _), defect in zip(pairs.factors, per_factor, strict=True)
        if not (bare[pairs.a_is[rows]] | bare[pairs.b_is[rows]]).all()
    ]
    return float(max(counted, default=0.0))


@dataclass(frozen=True)
class Broken:
    """A judge that is wrong in one way, and the invariance that finds it."""

    judge: Judge
    invariance: str


BROKEN: dict[str, Broken] = {
    "absolute": Broken(_by(lambda p, pairs: _plainly(pairs, 0.0)), "units"),
    "all but the last": Broken(_by(_all_but_the_last), "order"),
    "equations upwards": Broken(_by(_upwards), "signs"),
    "largest constant": Broken(_by(lambda p, pairs: _plainly(pairs, _top(pairs.constants))), "idle beside"),
    "largest price": Broken(_by(_prices), "idle price"),
    "largest row": Broken(_by(_one_size), "idle coupled"),
    "largest side": Broken(_by(lambda p, pairs: _plainly(pairs, _sides(p))), "idle sides"),
    "largest unknown": Broken(_by(lambda p, pairs: _plainly(pairs, _top(pairs.x))), "absent unknown"),
    "objective": Broken(
        _by(lambda p, pairs: _plainly(pairs, abs(p.objective(pairs.x[: p.start.size])) if p.node == "nlp" else 0.0)),
        "constants",
    ),
    "independent rows": Broken(_by(_independent), "repeated rows"),
    "moderate multipliers": Broken(_by(_moderate), "cancelling multipliers"),
    "largest row of all": Broken(_by(_one_size), "union"),
    "rows with constants": Broken(_by(_with_constants), "representation"),
}
"""Judges for the suite to catch, by answers that they are right about as they are first written."""
