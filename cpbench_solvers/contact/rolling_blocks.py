"""W of a problem with rolling friction by rows of blocks, moments in units of a length of their contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.local_contact import RollingFrictionContact
from cpbench.foundation.matrices import Vector, entries
from cpbench_solvers.kernels import block_layout, rolling_layout


@dataclass(frozen=True)
class RollingBlocks:
    """The problem with moments in units of `lengths`, W by rows of blocks.

    Attributes
    ----------
    lengths : (nc·d,), 1 in rows of forces. matrix : start, column and blocks beside the diagonal, blocks on it. law :
    q, μ, μ_r, ρ and the length of every contact. local : what the one-contact problem needs of its block.
    """

    problem: RollingFrictionContact
    lengths: Vector
    matrix: tuple[Any, ...]
    law: tuple[Any, ...]
    local: tuple[Any, ...]


def rolling_blocks(problem: RollingFrictionContact) -> RollingBlocks:
    """Return W by rows of blocks."""
    d, nc = problem.dimension, problem.nc
    n, start = d - 1, np.zeros(nc + 1, np.uint64)
    lengths, rho, D = np.empty((nc, d)), np.empty(nc), np.zeros((nc, d, d))
    local = np.empty((nc, n * n)), np.empty((nc, n)), np.empty((nc, n)), np.empty((nc, 3))
    rows = entries(problem.W)
    if nc:
        block_layout.count(*rows[:2], d, True, start)
    column = np.empty(int(start[nc]), np.uint32)
    blocks = np.zeros(column.size * d * d)
    rolling_layout.from_rows(*rows, start, column, blocks, D, lengths, rho, *local)
    unit, every = lengths[:, n].copy(), lengths.ravel()
    law = every * problem.q, problem.mu, problem.mu_r / unit, rho, unit
    return RollingBlocks(problem, every, (start, column, blocks, D.reshape(nc, d * d)), law, local)
