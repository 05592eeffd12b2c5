"""The cell of a problem among all problems: its facts, each in a few steps, so that a search can see where it was."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench_lab.reduction.numbers import OPERATORS, ROUNDING
from cpbench_lab.reduction.reduce import unknowns

Cell = tuple[int, ...]
AXES = ("size", "conditioning", "rank", "units", "friction", "degeneracy")
"""Facts of a cell, in their order."""
DECADES = 3
"""Powers of ten of a step of conditioning, units and friction."""
PAIRED = {"lcp": "z", "ncp": "z", "mlcp": "v"}
"""The unknowns that are complementary to w, by formulation."""
ZERO = 1e-6
"""Share of the largest up to which a number of a pair is 0."""


def cell(problem: Problem, solution: Any = None) -> Cell:
    """Return the steps of the facts: powers of 4 of the unknowns, decades by threes of the operator's singular values
    and of its diagonal and of μ, quarters of the rank that lacks and of the pairs that are both 0.

    >>> import cpbench
    >>> cell(cpbench.LCP(M=[[1.0, 0.0], [0.0, 1e-7]], q=[-1.0, -1.0]))
    (0, 2, 0, 2, 0, 0)
    """
    size = int(math.log(max(unknowns(problem), 1), 4))
    M: Any = next((problem.data()[name] for name in OPERATORS if name in problem.data()), np.zeros((0, 0)))
    array = matrices.dense(M)
    values = np.linalg.svd(array, compute_uv=False) if array.size else np.zeros(0)
    there = values[values > ROUNDING * values.max(initial=0.0)]
    rank = int(4 * (1 - there.size / values.size)) if values.size else 0
    mu = np.asarray(matrices.dense(problem.data()["mu"])).ravel() if "mu" in problem.data() else np.zeros(0)
    friction = 0 if not mu.size else 1 + _decades(mu) + 4 * int(mu.max() > 1.0)
    return size, _decades(there), rank, _decades(np.abs(np.diagonal(array))), friction, _degenerate(problem, solution)


def _decades(values: Any) -> int:
    """Return the decades between the least and the largest positive number, in steps."""
    positive = values[values > 0]
    return int(math.log10(positive.max() / positive.min()) / DECADES) if positive.size else 0


def _degenerate(problem: Problem, solution: Any) -> int:
    """Return the share of pairs z ⟂ w that are both 0 at a solution, beside the largest, in quarters."""
    if solution is None or problem.node not in PAIRED:
        return 0
    z, w = solution.arrays()[PAIRED[problem.node]], problem.slacks(solution)["w"]
    zero = (np.abs(z) <= ZERO * matrices.max_abs(z)) & (np.abs(w) <= ZERO * matrices.max_abs(w))
    return 4 * int(zero.sum()) // max(z.size, 1)
