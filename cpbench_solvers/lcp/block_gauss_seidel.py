"""Block Gauss–Seidel on an LCP: consecutive unknowns are solved together, exactly, one block after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.lcp import LCP
from cpbench.foundation.kernel_cache import load
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.lcp.claims import dense_obstacle
from cpbench_solvers.lcp.pgs import MatrixColumns, PGSOptions, SplittingSolver, Sweeps
from cpbench_solvers.traits import ITERATIVE

LARGEST = 64
"""The largest block: its tableau should stay in the fastest memory."""


@dataclass(frozen=True)
class BlockGSOptions(PGSOptions):
    """Options of block-gs. `block` : unknowns solved together, 1 to 64: for contacts, the rows of one of them.
    `omega` : relaxation, in ]0, 2[."""

    block: int = 6
    omega: float = 1.0


@dataclass(frozen=True, kw_only=True)
class DiagonalBlocks(MatrixColumns):
    """M by columns, with its diagonal blocks. `blocks` : of `size` unknowns each, by rows, one after the other."""

    size: int
    blocks: Vector


@register
class BlockGS(SplittingSolver):
    """z_B ← the solution of 0 ≤ z_B ⟂ M_BB z_B + (w_B − M_BB z_B^old) ≥ 0, by Lemke's method.

    Converges where pgs does (symmetric positive definite, H with positive diagonal), for symmetric M in no more work
    the better the blocks catch what couples strongly; zeros in the diagonal are allowed within a block. Blocks that
    Lemke's method does not solve are relaxed by components.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="block-gs",
        node="lcp",
        summary="block Gauss-Seidel, blocks solved by Lemke's method",
        method="splitting",
        citation="Cottle, Golub and Sacher 1978, Appl. Math. Optim. 4:347; Cottle, Pang and Stone 1992, section 5.2",
        traits=ITERATIVE,
        options=BlockGSOptions,
        by_default=False,
    )

    def obstacle(self, problem: LCP) -> str | None:
        return None if sp.issparse(problem.M) else dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: BlockGSOptions) -> DiagonalBlocks:
        size = min(max(options.block, 1), LARGEST)
        columns = super().setup(problem, budget, options)
        return DiagonalBlocks(**vars(columns), size=size, blocks=diagonal_blocks(problem, size))

    def sweeps(self, prepared: Any, options: BlockGSOptions) -> Sweeps:
        sweep = load("cpbench_solvers.kernels.block_splitting").sweeps
        law = prepared.matrix, prepared.blocks, prepared.size, prepared.problem.q
        rest = prepared.problem.z_unit, options.omega
        return lambda z, w, tolerance, errors: sweep(*law, z, w, *rest, tolerance, errors)


def diagonal_blocks(problem: LCP, size: int) -> Vector:
    """Return M_BB of `size` unknowns each, by rows, one after the other; the last one has the rest."""
    n = problem.q.size
    whole = n // size * size
    values = np.zeros(whole * size + (n - whole) ** 2)
    entries: Any = sp.coo_array(problem.M)
    row, column = entries.coords
    inside = row // size == column // size
    row, column = row[inside].astype(np.int64), column[inside].astype(np.int64)
    first = row // size * size
    width = np.where(first < whole, size, n - whole)
    values[first * size + (row - first) * width + column - first] = entries.data[inside]
    return values
