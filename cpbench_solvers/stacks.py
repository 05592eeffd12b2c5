"""Many small problems of one size by one compiled call: what the automatic choices begin with, without their checks.

Answers are what the loops end in, right or not: the caller measures them.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from cpbench.formulations.stack import Stack
from cpbench.foundation.matrices import power_of_two
from cpbench_solvers.contact.sweeps import MEMORY
from cpbench_solvers.kernels import anderson, contact_batch, mlcp_batch, pivoting_batch
from cpbench_solvers.lcp.lemke_run import LemkeOptions, pivot_limit
from cpbench_solvers.mlcp.claims import equilibration
from cpbench_solvers.mlcp.pivoting import LemkeMLCPOptions

Answers: TypeAlias = dict[str, np.ndarray[Any, np.dtype[np.float64]]]
SWEEPS = 1000
"""Of a contact problem; one that needs more is solved sooner by other methods."""
CONTACT_SHARES = (0.1, 1e-3)
"""Of the tolerance, that sweeps are asked for at first and again: another error decides, which is a few times as large
for most problems, and a hundred times where contacts that only slide or open move the most."""
PIECE = 4096
"""Problems whose scaled data are made at once: they stay in the cache until they are read."""


def solve_lcp(stack: Stack, tolerance: float, threads: int) -> Answers:
    """Pivot by Lemke's method, which ends in a basis: the tolerance is not asked."""
    M, q = stack.arrays["M"], stack.arrays["q"]
    pivoting, options = pivoting_batch.lemke_batch, LemkeOptions()
    limit, tolerances = pivot_limit(q.shape[1]), (options.pivot_tolerance, options.tie_tolerance)
    z = np.zeros(q.shape)
    in_parts(stack.count, threads, lambda some: pivoting(M[some], q[some], z[some], limit, *tolerances))
    return {"z": z}


def solve_fc(stack: Stack, tolerance: float, threads: int) -> Answers:
    """Sweep with Anderson's acceleration until the error of a solver is within the tolerance."""
    W, q, mu = (stack.arrays[name] for name in ("W", "q", "mu"))
    dimension, r = stack.others.get("dimension", 3), np.zeros(q.shape)
    sweeps = contact_batch.contact_batch
    memory = min(MEMORY, q.shape[1])
    size = anderson.work_size(q.shape[1], mu.shape[1], memory)

    def part(some: slice) -> None:
        sweeps(W[some], q[some], mu[some], dimension, memory, tolerance, SWEEPS, np.empty(size), r[some])

    in_parts(stack.count, threads, part)
    return {"r": r}


def solve_mlcp(stack: Stack, tolerance: float, threads: int) -> Answers:
    """Bring the free unknowns into the basis, then pivot by Lemke's method on the pairs."""
    A, B, C, D, a, b = (stack.arrays[name] for name in "ABCDab")

    def data(some: slice) -> tuple[Any, Any]:
        return np.block([[A[some], C[some]], [D[some], B[some]]]), np.concatenate([a[some], b[some]], axis=1)

    n = a.shape[1]
    x = _mixed(stack.count, n, n + b.shape[1], data, threads)
    return {"u": x[:, :n], "v": x[:, n:]}


def solve_qp(stack: Stack, tolerance: float, threads: int) -> Answers:
    """Solve the conditions of optimality, an MLCP that is monotone where the program is convex.

    Free are z and the multipliers of equalities; the pairs are those of the inequalities and of the bounds that are
    finite in some problem. Where one is not, its multiplier is alone in a row ν + 1 ≥ 0, and so is 0.
    """
    Q, p, A, b, C, d, lb, ub = (stack.arrays[name] for name in ("Q", "p", "A", "b", "C", "d", "lb", "ub"))
    n, k = p.shape[1], d.shape[1]
    lower, upper = (np.flatnonzero(np.isfinite(bound).any(axis=0)) for bound in (lb, ub))
    pairs = b.shape[1] + lower.size + upper.size

    def data(some: slice) -> tuple[Any, Any]:
        count, N = some.stop - some.start, n + k + pairs
        K, c = np.zeros((count, N, N)), np.zeros((count, N))
        K[:, :n, :n], c[:, :n] = Q[some], p[some]
        rows = n + k + b.shape[1]
        for at, matrix, side in ((n, C, d), (n + k, A, b)):
            to = at + side.shape[1]
            K[:, at:to, :n], c[:, at:to] = matrix[some], -side[some]
            K[:, :n, at:to] = -matrix[some].transpose(0, 2, 1)
        for sign, bound, places in ((1.0, lb, lower), (-1.0, ub, upper)):
            at, side = np.arange(rows, rows + places.size), bound[some][:, places]
            finite = np.isfinite(side)
            K[:, at, places] = np.where(finite, sign, 0.0)
            K[:, places, at] = np.where(finite, -sign, 0.0)
            K[:, at, at] = np.where(finite, 0.0, 1.0)
            c[:, at] = np.where(finite, -sign * np.where(finite, side, 0.0), 1.0)
            rows += places.size
        return K, c

    x = _mixed(stack.count, n + k, n + k + pairs, data, threads)
    nu, rows = np.zeros(p.shape), n + k + b.shape[1]
    nu[:, lower] = x[:, rows : rows + lower.size]
    nu[:, upper] -= x[:, rows + lower.size :]
    return {"z": x[:, :n], "lam": x[:, n + k : rows], "mu": x[:, n : n + k], "nu": nu}


def _mixed(count: int, free: int, N: int, data: Callable[[slice], tuple[Any, Any]], threads: int) -> Any:
    """Return x (count, N) of Kx + k, zero beside the first `free` x, which are free, complementary to the others.

    data : makes K (p, N, N) and k (p, N) of some problems.
    """
    options, x = LemkeMLCPOptions(), np.zeros((count, N))
    pivoting = mlcp_batch.mlcp_batch
    head = np.array([free, 1.0, 0.0, options.rank_tolerance, options.pivot_tolerance, options.tie_tolerance])

    def part(some: slice) -> None:
        for begin in range(some.start, some.stop, PIECE):
            piece = slice(begin, min(begin + PIECE, some.stop))
            K, k = data(piece)
            row, column = equilibration(K, free)
            K *= row[:, :, None]
            K *= column[:, None, :]
            k *= row
            tops = np.abs(k).max(axis=1, initial=0.0)
            size = power_of_two(np.where(tops > 0.0, tops, 1.0))[:, None]
            pivoting(K, size * k, 1.0 / (size * row), column / size, head, pivot_limit(N - free), x[piece])

    in_parts(count, threads, part)
    return x


def in_parts(count: int, threads: int, part: Callable[[slice], object]) -> None:
    """Call `part` with slices of `count` things that are as long as each other, one a thread: compiled loops do not
    hold the interpreter's lock."""
    bounds = np.linspace(0, count, max(min(threads, count), 1) + 1).astype(int).tolist()
    *others, last = [slice(*pair) for pair in pairwise(bounds)]
    if not others:
        part(last)
        return
    with ThreadPoolExecutor(len(others)) as pool:
        begun = [pool.submit(part, some) for some in others]
        part(last)
        for other in begun:
            other.result()
