"""Lemke's method on many small LCPs of one size, in one call."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.errors import ProblemError
from cpbench.foundation.kernel_cache import compiled, load
from cpbench_solvers.lcp.lemke_run import PIVOTING, LemkeOptions, pivot_limit
from cpbench_solvers.threads import in_parts


@dataclass(frozen=True)
class Batch:
    """Answers to many LCPs: z (k, n), which runs ended in a complementary basis, and pivots (k,) of each.

    Where `complementary` is false (a ray, too many pivots) z is that of the last basis and answers nothing.
    """

    z: np.ndarray[Any, Any]
    complementary: np.ndarray[Any, Any]
    pivots: np.ndarray[Any, Any]


def batch(
    M: np.ndarray[Any, Any], q: np.ndarray[Any, Any], options: LemkeOptions | None = None, *, threads: int = 1
) -> Batch:
    """Solve many small LCPs of one size at once, without the overhead of a call for each.

    Parameters
    ----------
    M : (k, n, n). q : (k, n). threads : over how many the k problems are spread.

    Raises ProblemError where the shapes do not fit together. Data are not checked otherwise.
    """
    kernel = load(PIVOTING)
    every = compiled(load("cpbench_solvers.kernels.pivoting_batch").lemke_batch)
    options = options or LemkeOptions()
    M, q = (np.ascontiguousarray(a, dtype=float) for a in (M, q))
    if q.ndim != 2 or M.shape != (*q.shape, q.shape[-1]):
        raise ProblemError("batch", f"M must be (k, n, n) and q (k, n), got {M.shape} and {q.shape}")
    k, n = q.shape
    z, codes = np.zeros((k, n)), np.zeros(k, np.int64)
    limit = options.max_pivots or pivot_limit(n)

    def part(some: slice) -> None:
        every(M[some], q[some], z[some], codes[some], limit, options.pivot_tolerance, options.tie_tolerance)

    in_parts(k, threads, part)
    return Batch(z=z, complementary=codes % kernel.CODES == kernel.COMPLEMENTARY, pivots=codes // kernel.CODES)
