"""One run of Lemke's method: where it begins, what it spends, and other ways where a beginning settles nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.foundation.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, SolverOutput
from cpbench_solvers.kernels import lemke_judged, lemke_pairs, pivoting
from cpbench_solvers.lcp.claims import after_ray, conclude, ended_in_basis, farkas
from cpbench_solvers.lcp.first_basis import DenseLCP
from cpbench_solvers.lcp.lemke_columns import PivotingState
from cpbench_solvers.lcp.principal_transform import PrincipalTransform, transformed

LARGER_PIVOTS = (1e-9, 1e-7)
"""Least pivots of the next runs, the data scaled to size one. Columns carry rounding errors that grow with the pivots
before; an entry that is nothing else must not be pivoted on, and half of the digits is as far as data can be told."""
PAIRS = 20
"""First bases that are tried: two of three lead to a solution where no ray is in the way of the first, as in games."""


def pairs(M: np.ndarray[Any, Any]) -> Iterator[tuple[int, int]]:
    """Yield pairs (r, i) whose principal block can be a basis, in an order that is drawn once and for all.

    After a first pivot in row r the unknown z_r enters; where its column is not negative anywhere and M_rr = 0, nothing
    blocks it, and every covering vector ends in a ray. So it is in all bimatrix games (Cottle, Pang and Stone 1992,
    section 4.4). Lemke and Howson (1964) begin with z_r and the first unknown i of the other player that it serves
    least, which this does in general; the pivots then go on from the principal transform there.
    """
    least_served = lemke_pairs.least_served
    for r in order(len(M)):
        if (i := least_served(M, r)) >= 0:
            yield int(r), int(i)


@cache
def order(n: int) -> NDArray[np.int64]:
    """Return the first unknowns of the pairs."""
    return np.random.default_rng(0).permutation(n)[:PAIRS].astype(np.int64)


PIVOTING = "cpbench_solvers.kernels.pivoting"
SMALL = 250
"""Up to this size one compiled call makes all pivots; beyond it there is a look at the clock after CHUNK of them."""
CHUNK = 32
LEAST, MOST = 8, 48
"""How many columns of a transformed LCP are computed at once: as many as q' has negative components, within these."""
SETTLED = frozenset({Claim.SOLVED, Claim.INFEASIBLE})


@dataclass(frozen=True)
class LemkeOptions:
    """Options of lemke. `max_pivots` : 0 stands for 50n + 1000. `pivot_tolerance` : entries up to this, in data
    scaled to size one, do not block. `tie_tolerance` : rows that a step would bring this close to zero count as
    tied. `crash_sweeps` : projected Gauss-Seidel sweeps that guess the first basis beyond 250 unknowns where no
    start is given; 0 : none, pivoting begins at w = q."""

    max_pivots: int = 0
    pivot_tolerance: float = 1e-11
    tie_tolerance: float = 1e-13
    crash_sweeps: int = 20


def in_one_call(lcp: DenseLCP, limit: int, options: LemkeOptions) -> tuple[Vector, int, float]:
    """Return z, the kernel's code and the judged error, after all pivots from w = q in one compiled call."""
    problem = lcp.problem
    q = problem.q
    z = np.empty(q.size)
    code, error, _ = judged()[0](lcp.M, q, z, problem.z_unit, limit, options.pivot_tolerance, options.tie_tolerance)
    return z, code, error


@cache
def judged() -> tuple[Any, int]:
    return lemke_judged.lemke_judged, pivoting.CODES


def pivot_limit(n: int) -> int:
    """Return the limit of pivots where the budget sets none."""
    return 50 * n + 1000


class LemkeRun:
    """Counters of a solve, and the ways to begin."""

    def __init__(self, lcp: DenseLCP, budget: Budget, options: LemkeOptions) -> None:
        self._lcp, self._budget, self._options = lcp, budget, options
        self._kernel = pivoting
        self._asked = budget.iterations or options.max_pivots
        self._limit = self._asked or pivot_limit(lcp.problem.q.size)
        self._may_be_infeasible, self._ray_at_once = True, False
        self._deadline = time.monotonic() + budget.seconds
        self.counters = {"iterations": 0, "pivots": 0}

    @property
    def left(self) -> int:
        """Steps that may still be taken."""
        return self._limit - self.counters["iterations"]

    def from_support(self, z: Vector) -> SolverOutput | None:
        """Start from the basis that z points to; None where that basis or the way from there settles nothing."""
        lcp, problem = self._lcp, self._lcp.problem
        inside = lcp.points_to(z, lcp.M @ z + problem.q)
        self.counters["factorizations"] = 1
        seen = transformed(lcp, inside)
        if seen is None and (fewer := inside & (z > 0.0)).sum() < inside.sum():
            # w = 0 beside z = 0, as semidefinite problems have it, points nowhere
            self.counters["factorizations"] = 2
            seen = transformed(lcp, fewer)
        return None if seen is None else self._from_transform(seen)

    def _from_transform(self, seen: PrincipalTransform) -> SolverOutput | None:
        """Start from w = q' of a principal transform; None where the way from there settles nothing."""
        lcp = self._lcp
        if seen.q.min() >= 0.0:
            z = seen.lifted(seen.q, np.zeros_like(seen.q))
        else:
            likely = min(max(int((seen.q < 0.0).sum()), LEAST), MOST)
            run = PivotingState(self._kernel, lcp.columns, seen.q, source=seen.negated_columns, likely=likely)
            if self._pivoted(run, self._options, most=seen.q.size) != "complementary":
                return None
            z = seen.lifted(run.w, run.z)
        output = ended_in_basis(lcp.problem, z, np.flatnonzero(z), self._budget, self.counters)
        return output if output.claim is Claim.SOLVED else None

    def from_origin(self, z: Vector | None = None, code: int = 0) -> SolverOutput:
        """Start from w = q, or go on from z and the code that the compiled loop ended with there; then other ways,
        until one solves the problem or proves that nothing does."""
        output = self._plain(self._options) if z is None else self._after_loop(z, code)
        if self._asked or output.claim in SETTLED:  # a limit that was asked for is that of the way from w = q
            return output
        for attempt in self._other_ways():
            self._limit = self.counters["iterations"] + pivot_limit(self._lcp.problem.q.size)
            if time.monotonic() > self._deadline:
                break
            other = attempt()
            if other is not None and other.claim in SETTLED:
                return other
        return output

    def _other_ways(self) -> Iterator[Callable[[], SolverOutput | None]]:
        """Yield larger pivots from w = q, then other first bases; these first where nothing blocked the first pivot,
        for larger ones would not either."""
        M, problem, n = self._lcp.M, self._lcp.problem, self._lcp.problem.q.size
        larger = [
            partial(self._plain, replace(self._options, pivot_tolerance=least))
            for least in LARGER_PIVOTS
            if least > self._options.pivot_tolerance
        ]
        at_once = self._ray_at_once
        if not at_once:
            yield from larger
        if n <= SMALL:
            tried = 0
            while (tried := self._first_pair(tried)) >= 0:
                yield partial(ended_in_basis, problem, self._z, np.flatnonzero(self._z), self._budget, self.counters)
        else:
            for pair in pairs(M):
                if (seen := transformed(self._lcp, np.isin(np.arange(n), pair))) is not None:
                    yield partial(self._from_transform, seen)
        if at_once:
            yield from larger

    def _first_pair(self, tried: int) -> int:
        """Pivot from the pairs not yet tried until one ends in a complementary basis; return how many were, else -1."""
        lcp, options = self._lcp, self._options
        self._z, chosen = np.empty(lcp.problem.q.size), order(lcp.problem.q.size)
        rest = chosen, tried, lcp.problem.q.size, options.pivot_tolerance, options.tie_tolerance
        tried, pivots = lemke_pairs.from_pairs(lcp.M, lcp.problem.q, self._z, *rest)
        self._spend(pivots)
        return tried

    def _plain(self, options: LemkeOptions) -> SolverOutput:
        """Start from w = q, where a ray may be followed by a proof."""
        lcp, budget, counters = self._lcp, self._budget, self.counters
        problem = lcp.problem
        if problem.q.size <= SMALL:
            z, code, _ = in_one_call(lcp, self.left, options)
            return self._after_loop(z, code)
        if problem.q.min() >= 0.0:
            return conclude(problem, np.zeros_like(problem.q), budget, counters)
        p = max_abs(problem.q) or 1.0
        run = PivotingState(self._kernel, lcp.columns, problem.q / p, factor=-1.0 / lcp.unit)
        outcome = self._pivoted(run, options)
        return self._ended(run.z * (p / lcp.unit), outcome)

    def _after_loop(self, z: Vector, code: int) -> SolverOutput:
        """Conclude from the end of the compiled loop."""
        self._spend(code // self._kernel.CODES)
        return self._ended(z, self._word(code % self._kernel.CODES))

    def _ended(self, z: Vector, outcome: str) -> SolverOutput:
        problem, budget, counters = self._lcp.problem, self._budget, self.counters
        if outcome == "ray":
            self._ray_at_once |= self.counters["pivots"] <= 1
            certificate = farkas(problem, budget) if self._may_be_infeasible else None
            self._may_be_infeasible = False
            output, message = after_ray(counters, certificate, "y ≥ 0, Mᵀy ≤ 0, qᵀy < 0")
            return output or conclude(problem, z, budget, counters, otherwise=Claim.FAILED, message=message)
        if outcome != "complementary":
            claim = Claim.FAILED if outcome == "not finite" else Claim.MAX_ITER
            message = f"{outcome} after {counters['pivots']} pivots"
            return conclude(problem, z, budget, counters, otherwise=claim, message=message)
        return ended_in_basis(problem, z, np.flatnonzero(z), budget, counters)

    def _pivoted(self, run: PivotingState, options: LemkeOptions, most: int | None = None) -> str:
        """Pivot, at most `most` times; outcome in words."""
        kernel = self._kernel
        limit = self.left if most is None else min(self.left, most)
        word = ""
        while not word:
            until = min(limit, run.pivots + CHUNK)
            status = run.advance(until, options.pivot_tolerance, options.tie_tolerance)
            if status == kernel.BEHIND:
                run.bring_likely()
            elif status == kernel.FULL:
                run.forget_pivots()
            elif status != kernel.LIMIT or until == limit:
                word = self._word(status)
            if not word and time.monotonic() > self._deadline:
                word = "out of time"
        self._spend(run.pivots)
        return word

    def _spend(self, pivots: int) -> None:
        self.counters["pivots"] += pivots
        self.counters["iterations"] += pivots

    def _word(self, status: int) -> str:
        kernel = self._kernel
        words = {kernel.COMPLEMENTARY: "complementary", kernel.RAY: "ray", kernel.LIMIT: "pivot limit"}
        return words.get(status, "not finite")
