"""Where pivoting begins: an LCP with its matrix by rows and by columns, and the active set that sweeps point to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cpbench.formulations.linear import LCP
from cpbench.foundation.matrices import Vector, dense, max_abs
from cpbench_solvers.kernels import splitting

FIRST, GAIN = 2, 0.7
"""Sweeps after which they begin anew with ω < 1 unless the second has left no more than this share of the error."""
CHUNK = 5
"""Sweeps between two looks at the active set they point to."""
SETTLED = 0.02
"""Share of components that change sides within a chunk of sweeps and count as few."""
SLOW = 4.0
"""How many times longer a sweep takes than a factorization for the same number of multiplications."""


@dataclass(frozen=True)
class DenseLCP:
    """M (n, n), dense and in C's order, and what is only found out where somebody asks for it.

    Not scaled: the sweeps, the factorizations and the judge read the same 8n² bytes, which may stay in the cache.
    """

    problem: LCP
    M: np.ndarray[Any, Any]

    @cached_property
    def size(self) -> float:
        """max|M|, 1 for M = 0."""
        return max_abs(self.M) or 1.0

    @property
    def unit(self) -> float:
        """The power of two above max|M|: what is divided by it is not rounded."""
        return math.ldexp(1.0, math.frexp(self.size)[1])

    @cached_property
    def columns(self) -> np.ndarray[Any, Any]:
        """(n, n), row j is column j of M."""
        return self.M if self.problem.symmetric else np.ascontiguousarray(self.M.T)

    def points_to(self, z: Vector, w: Vector) -> np.ndarray[Any, Any]:
        """Return components that are positive in the solution near to z: z > w in data scaled to size one."""
        return z * self.size > w


def dense_lcp(problem: LCP, *, by_columns: bool = True) -> DenseLCP:
    """Return the problem with M dense, and its columns too where a solver is going to need them."""
    lcp = DenseLCP(problem, np.array(dense(problem.M), order="C"))
    if by_columns:
        _ = lcp.columns, lcp.size
    return lcp


def swept(prepared: DenseLCP, limit: int, omega: float, tolerance: float = 0.0, most: int = 0) -> tuple[Vector, int]:
    """Return z after projected Gauss–Seidel sweeps that go on while the active set moves, and how many there were.

    At most `limit`; up to `most` where `tolerance` is reached sooner so than by a factorization. The best z where
    they diverge; z = 0 where the diagonal is not positive. omega : relaxation where M is not symmetric and 1
    does not do.
    """
    problem, q, diagonal = prepared.problem, prepared.problem.q, prepared.M.diagonal().copy()
    z, w = np.zeros(q.size), q.copy()
    if limit <= 0 or not (diagonal > 0.0).all():
        return z, 0
    kernel = splitting
    best, least, inside, relaxation, sweeps = z.copy(), math.inf, q < 0.0, 1.0, 0
    while sweeps < limit:
        errors = np.empty(min(CHUNK if sweeps else FIRST, limit - sweeps))
        rest = (diagonal, q, z, w, problem.z_unit, relaxation, False, tolerance, errors)
        done = kernel.sweeps((prepared.columns,), *rest)
        sweeps, error = sweeps + done, float(errors[done - 1])
        if sweeps == FIRST and not problem.symmetric and not error < GAIN * errors[0]:
            z[:], w[:], relaxation = 0.0, q, omega
            continue
        if not error < least:
            return best, sweeps
        best, least = z.copy(), error
        before, inside = inside, prepared.points_to(z, w)
        if error <= tolerance:
            break
        active = int(inside.sum())
        rate = (error / errors[0]) ** (1.0 / max(done - 1, 1))
        left = math.log(tolerance / error) / math.log(rate) if rate < 1.0 and tolerance > 0.0 else math.inf
        factorization = active**3 / (6.0 if problem.symmetric else 3.0)
        if left * SLOW * q.size * active <= factorization:
            limit = min(most, max(limit, sweeps + math.ceil(left) + 1))
        elif np.count_nonzero(before != inside) <= SETTLED * q.size:
            break
    return best, sweeps
