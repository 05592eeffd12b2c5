"""A problem as a picture of a few centimetres: the numbers that it is drawn from, few enough for a page of hundreds.

Everywhere where the matrices have entries; for contacts also which of them stick, slip or are open in an answer; for
an LCP with two unknowns its complementary cones and q instead.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.analysis.coarse import arranged, coarsened
from cpbench.analysis.complementary_cones import complementary_cones, is_p_matrix, solutions
from cpbench.analysis.contact_states import ContactStates, State, contact_states
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.lcp import LCP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Matrix, Vector, max_abs, norm

CELLS = 48
"""Cells a side of the largest matrix, at most."""
LEAST = 8
"""Cells a side that a matrix may have however small it is beside the largest."""
DECADES = 6
"""Shades: the largest entries have the last, and each below it is for a tenth; still smaller ones have the first."""
CONTACTS = 150
"""Contacts that are drawn, those with the largest reactions."""
FARTHEST = 2.0
"""Reactions farther outside the disk (of answers that are hardly admissible) are brought there."""

Thumbnail = dict[str, Any]
"""Plain data, as JSON holds them; `api.thumbnails` adds `licence`, `source` and `citation` of the problem."""


def thumbnail(problem: Problem, point: Point | None = None, tolerance: float = 1e-6) -> Thumbnail:
    """Summarise a problem for its thumbnail: `cones` of an LCP with n = 2; else `blocks`, and `contacts` (or
    `unanswered`) of a contact problem.

    Raises what `contact_states` raises of an answer that is none.

    >>> from cpbench.formulations.lcp import LCP
    >>> thumbnail(LCP(M=np.diag([100.0, 0.0, -1.0]), q=np.ones(3)))["blocks"]
    [[{'name': 'M', 'rows': 3, 'cols': 3, 'nonzeros': 2, 'step': 1, 'cells': '600000004'}]]
    """
    if isinstance(problem, LCP) and problem.q.size == 2:
        return {"cones": _cones(problem)}
    result: Thumbnail = {"blocks": _blocks(problem)}
    if isinstance(problem, ContactProblem) and problem.nc:
        summary = (
            {"unanswered": True}
            if point is None
            else {"contacts": _contacts(contact_states(problem, point, tolerance))}
        )
        result |= summary
    return result


def _blocks(problem: Problem) -> list[list[dict[str, Any] | None]]:
    """Shade the matrices, in rows as they stand in the equations."""
    data: dict[str, Any] = problem.data()
    places = arranged(problem)
    there: dict[str, Matrix] = {name: data[name] for row in places for name in row if name}
    largest = max((matrices.max_abs(M) for M in there.values()), default=0.0)
    longest = max((max(M.shape) for M in there.values()), default=1)
    size = problem.dimension if isinstance(problem, ContactProblem) else 1

    def block(name: str) -> dict[str, Any]:
        M = there[name]
        cells = max(LEAST, round(CELLS * max(M.shape) / longest))
        # a cell of whole contacts, where these are fewer than the cells
        coarse = coarsened(M, cells, size if max(M.shape) > cells else 1)
        return {
            "name": name,
            "rows": int(M.shape[0]),
            "cols": int(M.shape[1]),
            "nonzeros": int(matrices.nnz(M)),
            "step": int(coarse.step),
            "cells": _shades(coarse.largest, largest),
        }

    return [[block(name) if name else None for name in row] for row in places]


def _shades(values: Dense, largest: float) -> str:
    """Encode a digit a cell, row by row: 0 of zeros, DECADES of the largest.

    >>> _shades(np.array([[1.0, 0.1], [0.0, 1e-9]]), 1.0)
    '6501'
    """
    with np.errstate(divide="ignore"):
        below = np.floor(-np.log10(values / (largest or 1.0)))
    shade = np.where(values > 0, np.clip(DECADES - below, 1, DECADES), 0)
    return "".join(map(str, shade.astype(int).ravel()))


def _contacts(states: ContactStates) -> dict[str, Any]:
    """Count the states, and the contacts that push r_T/(μ r_N) and r_N over the largest, in thousandths."""
    pushing = np.flatnonzero(states.state != str(State.OPEN))
    normal = states.r[:, 0]
    shown = np.sort(pushing[np.argsort(-normal[pushing], kind="stable")[:CONTACTS]])
    share = states.share[shown]
    size = np.linalg.norm(share, axis=1, keepdims=True)
    within = share * np.minimum(1.0, FARTHEST / np.maximum(size, FARTHEST))
    most = float(normal[pushing].max(initial=0.0))
    return {
        "counts": {str(state): states.count(state) for state in State},
        "largest": most,
        "place": shown.tolist(),
        "slips": [int(state == str(State.SLIP)) for state in states.state[shown]],
        "force": _thousandths(normal[shown] / (most or 1.0)),
        "share": [_thousandths(column) for column in within.T],
    }


def _cones(problem: LCP) -> dict[str, Any]:
    """Return unit vectors along the edges of the cones, the direction of q, the solutions."""
    cones = complementary_cones(problem)
    edges = [cone.generators / np.maximum(np.linalg.norm(cone.generators, axis=0), 1e-300) for cone in cones]
    return {
        "cones": [
            {
                "active": list(cone.active),
                "edges": [_thousandths(edge) for edge in edges[k].T],
                "flat": bool(cone.degenerate),
                "holds": cone.z is not None,
            }
            for k, cone in enumerate(cones)
        ],
        "q": _thousandths(problem.q / (max_abs(problem.q) or 1.0)),
        "solutions": [[float(f"{value:.4g}") for value in z] for z in solutions(cones)],
        "p": is_p_matrix(problem),
        "zero": not norm(problem.q),
    }


def _thousandths(values: Vector) -> list[int]:
    return [int(value) for value in np.round(1000.0 * values)]
