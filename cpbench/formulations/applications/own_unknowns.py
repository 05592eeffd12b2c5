"""The unknowns of a game, of least squares or of a boxed LCP in an answer to the problem that was made of it."""

from __future__ import annotations

from cpbench.errors import PointError
from cpbench.formulations.applications.boxed import rows_of
from cpbench.formulations.applications.game import game_sizes, strategies
from cpbench.formulations.applications.least_squares import columns_of
from cpbench.formulations.base import Point, Problem
from cpbench.foundation.matrices import Vector


def own_unknowns(problem: Problem, point: Point) -> dict[str, Vector] | None:
    """Return x and y of a game, x and the residual r of least squares, or x of a boxed LCP; None of any other problem,
    and where the answer has no probabilities."""
    if game_sizes(problem) is not None:
        try:
            x, y = strategies(problem, point)
        except PointError:
            return None
        return {"x": x, "y": y}
    z = point.arrays().get("z")
    if z is not None and (columns := columns_of(problem)) is not None:
        return {"x": z[:columns], "r": z[columns:]}
    if z is not None and (rows := rows_of(problem)) is not None:
        return {"x": z[:rows]}
    return None
