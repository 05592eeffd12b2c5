"""Lemke's method on an LCP: cover q by z_0, then follow complementary pivots until z_0 leaves or a ray appears."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.lcp import LCP
from cpbench.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native.lcp.lcp_claims import ScaledLCP, conclude, dense_obstacle, ended_in_basis, farkas, scale
from cpbench.solvers.native.lcp.lemke_columns import Columns
from cpbench.solvers.options import fixed, searched

SMALL = 250
"""Up to this size columns are updated by vectors alone; beyond it those that lack many pivots by matrix products."""


@dataclass(frozen=True)
class LemkeOptions:
    """`max_pivots` : 0 stands for 50n + 1000. `pivot_tolerance` : entries up to this, in data scaled to size one,
    do not block. `tie_tolerance` : rows that a step would bring this close to zero count as tied."""

    max_pivots: int = fixed(0)
    pivot_tolerance: float = searched(1e-11, low=1e-13, high=1e-8, log=True)
    tie_tolerance: float = searched(1e-13, low=1e-15, high=1e-9, log=True)


@dataclass(frozen=True)
class Batch:
    """Answers to many LCPs: z (k, n), which runs ended in a complementary basis, and pivots (k,) of each.

    Where `complementary` is false (a ray, too many pivots) z is that of the last basis and answers nothing.
    """

    z: np.ndarray[Any, Any]
    complementary: np.ndarray[Any, Any]
    pivots: np.ndarray[Any, Any]


@register
class Lemke(Solver):
    """Complementary pivoting with covering vector e and the lexicographic ratio test, which excludes cycling.

    Ends in a solution for copositive-plus M (so for PSD M) when there is a feasible point, and for P and other
    Q_0 classes; elsewhere it may end in a ray, which by itself proves nothing. A ray is then followed by a linear
    program for a Farkas certificate.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="lemke",
        node="lcp",
        summary="Lemke's complementary pivoting, lexicographic ratio test",
        method="pivoting",
        citation="Lemke 1965; Cottle, Pang and Stone 1992, algorithm 4.4.5 and section 4.9",
        traits=frozenset({Trait.DETERMINISTIC}),
        options=LemkeOptions,
    )

    def obstacle(self, problem: LCP) -> str | None:
        return dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: LemkeOptions) -> ScaledLCP:
        return scale(problem)

    def warmup(self) -> None:
        self.run(LCP(M=np.eye(2), q=np.array([-1.0, -2.0])))

    def solve(
        self,
        prepared: ScaledLCP,
        budget: Budget,
        options: LemkeOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, q = prepared.problem, prepared.q
        n = q.size
        if n == 0 or q.min() >= 0.0:
            return conclude(problem, np.zeros(n), budget, {"pivots": 0})
        outcome, z, pivots = _pivot(prepared, budget, options)
        counters = {"pivots": pivots}
        if outcome == "ray":
            return _after_ray(problem, z, budget, counters)
        if outcome != "complementary":
            claim = Claim.FAILED if outcome == "not finite" else Claim.MAX_ITER
            return conclude(problem, z, budget, counters, otherwise=claim, message=f"{outcome} after {pivots} pivots")
        return ended_in_basis(problem, z, np.flatnonzero(z), budget, counters)


def batch(
    M: np.ndarray[Any, Any], q: np.ndarray[Any, Any], options: LemkeOptions | None = None, *, threads: int = 1
) -> Batch:
    """Solve many small LCPs of one size at once, without the overhead of a call for each.

    Parameters
    ----------
    M : (k, n, n). q : (k, n). threads : over how many the k problems are spread.

    Raises ProblemError where the shapes do not fit together. Data are not checked otherwise.
    """
    from cpbench.kernel_cache import load

    kernel = load("cpbench.solvers.kernels.pivoting")
    options = options or LemkeOptions()
    M, q = (np.ascontiguousarray(a, dtype=float) for a in (M, q))
    if q.ndim != 2 or M.shape != (*q.shape, q.shape[-1]):
        raise ProblemError("batch", f"M must be (k, n, n) and q (k, n), got {M.shape} and {q.shape}")
    k, n = q.shape
    z, codes = np.zeros((k, n)), np.zeros(k, np.int64)
    limit = options.max_pivots or _pivot_limit(n)

    def part(begin: int, end: int) -> None:
        cut = slice(begin, end)
        kernel.lemke_batch(M[cut], q[cut], z[cut], codes[cut], limit, options.pivot_tolerance, options.tie_tolerance)

    if threads > 1 and k > 1:
        bounds = np.linspace(0, k, threads + 1).astype(int).tolist()
        with ThreadPoolExecutor(threads - 1) as pool:
            others = [pool.submit(part, *pair) for pair in pairwise(bounds[:-1])]
            part(bounds[-2], k)
            for other in others:
                other.result()
    else:
        part(0, k)
    return Batch(z=z, complementary=codes % kernel.CODES == kernel.COMPLEMENTARY, pivots=codes // kernel.CODES)


def _pivot_limit(n: int) -> int:
    return 50 * n + 1000


def _pivot(prepared: ScaledLCP, budget: Budget, options: LemkeOptions) -> tuple[str, Vector, int]:
    """Outcome in words, z of the basis it ended in (unscaled), number of pivots."""
    from cpbench.kernel_cache import load

    kernel = load("cpbench.solvers.kernels.pivoting")
    n = prepared.q.size
    limit = budget.iterations or options.max_pivots or _pivot_limit(n)
    words = {kernel.COMPLEMENTARY: "complementary", kernel.RAY: "ray", kernel.LIMIT: "pivot limit"}
    if n <= SMALL:
        z = np.empty(n)
        code = kernel.lemke(prepared.M, prepared.q, z, limit, options.pivot_tolerance, options.tie_tolerance)
        return words.get(code % kernel.CODES, "not finite"), z * prepared.z_unit, code // kernel.CODES
    run = Columns(kernel, prepared.M, prepared.q)
    deadline = time.monotonic() + budget.seconds
    while True:
        status = run.advance(limit, options.pivot_tolerance, options.tie_tolerance)
        if status == kernel.BEHIND:
            run.bring_likely()
        elif status == kernel.FULL:
            run.forget_pivots()
        else:
            return words.get(status, "not finite"), run.z * prepared.z_unit, run.pivots
        if time.monotonic() > deadline:
            return "out of time", np.zeros(n), run.pivots


def _after_ray(problem: LCP, z: Vector, budget: Budget, counters: dict[str, int]) -> SolverOutput:
    """Infeasible when the certificate holds; otherwise failed, for a ray proves nothing by itself."""
    certificate = farkas(problem, budget)
    if certificate is not None:
        return SolverOutput(
            claim=Claim.INFEASIBLE,
            counters=counters,
            certificate=certificate,
            message=f"ray after {counters['pivots']} pivots; y ≥ 0, Mᵀy ≤ 0, qᵀy < 0 proves that there is no solution",
        )
    return conclude(
        problem,
        z,
        budget,
        counters,
        otherwise=Claim.FAILED,
        message=f"ray after {counters['pivots']} pivots, and no certificate of infeasibility: undecided",
    )
