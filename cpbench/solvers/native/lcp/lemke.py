"""Lemke's method on an LCP: cover q by z_0, then follow complementary pivots until z_0 leaves or a ray appears."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.kernel_cache import compiled, load
from cpbench.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.native import linear_program
from cpbench.solvers.native.lcp.claims import conclude, dense_obstacle, ended_in_basis, error_of, farkas
from cpbench.solvers.native.lcp.even_units import APART, EvenLCP, in_even_units
from cpbench.solvers.native.lcp.first_basis import DenseLCP, dense_lcp, swept
from cpbench.solvers.native.lcp.lemke_columns import BLOCKS, PivotingState
from cpbench.solvers.native.lcp.principal_transform import transformed
from cpbench.solvers.options import fixed, searched

PIVOTING = "cpbench.solvers.kernels.pivoting"
SMALL = 250
"""Up to this size columns are updated by vectors alone; beyond it those that lack many pivots by matrix products."""
LEAST, MOST = 8, 48
"""How many columns of a transformed LCP are computed at once: as many as q' has negative components, within these."""
OMEGA = 0.6
"""Relaxation of the sweeps where M is not symmetric and 1 does not do."""


@dataclass(frozen=True)
class LemkeOptions:
    """Options of lemke. `max_pivots` : 0 stands for 50n + 1000. `pivot_tolerance` : entries up to this, in data
    scaled to size one, do not block. `tie_tolerance` : rows that a step would bring this close to zero count as
    tied. `crash_sweeps` : projected Gauss-Seidel sweeps that guess the first basis beyond 250 unknowns where no
    start is given; 0 : none, pivoting begins at w = q."""

    max_pivots: int = fixed(0)
    pivot_tolerance: float = searched(1e-11, low=1e-13, high=1e-8, log=True)
    tie_tolerance: float = searched(1e-13, low=1e-15, high=1e-9, log=True)
    crash_sweeps: int = fixed(20)


@register
class Lemke(Solver):
    """Complementary pivoting with covering vector e and the lexicographic ratio test, which excludes cycling.

    Ends in a solution for copositive-plus M (so for PSD M) when there is a feasible point, and for P and other
    Q_0 classes; elsewhere it may end in a ray, which by itself proves nothing. A ray is then followed by a linear
    program for a Farkas certificate.

    A start, or sweeps on a large problem, name a complementary basis, and the pivots begin at the principal transform
    of the LCP there, which has the same solutions and covers its own q' by e. Where that basis is singular, or the
    way from it ends in a ray or takes more than n pivots, all begins again at w = q: claims of a ray come from there.

    Where rows or unknowns are in units far apart, everything happens in even ones (`even_units`), the claim too.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="lemke",
        node="lcp",
        summary="Lemke's complementary pivoting, lexicographic ratio test",
        method="pivoting",
        citation="Lemke 1965; Cottle, Pang and Stone 1992, algorithm 4.4.5, sections 2.3 and 4.9",
        traits=frozenset({Trait.WARM_START, Trait.DETERMINISTIC}),
        quick=True,
        options=LemkeOptions,
    )

    def obstacle(self, problem: LCP) -> str | None:
        return dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: LemkeOptions) -> DenseLCP | EvenLCP:
        by_columns = problem.q.size > SMALL
        lcp = dense_lcp(problem, by_columns=by_columns)
        return in_even_units(lcp, by_columns) if APART < _spread()(lcp.M) < np.inf else lcp

    def warmup(self) -> None:
        linear_program.load()
        load(BLOCKS)  # for problems that are larger than the one that is solved here
        self.run(LCP(M=np.eye(2), q=np.array([-1.0, -2.0])))

    def solve(
        self,
        prepared: DenseLCP | EvenLCP,
        budget: Budget,
        options: LemkeOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        if isinstance(prepared, EvenLCP):
            begin = None if start is None else prepared.entered(start)
            return prepared.left(self.solve(prepared.lcp, budget, options, begin))
        n = prepared.problem.q.size
        if start is None and n <= SMALL:
            limit = budget.iterations or options.max_pivots or pivot_limit(n)
            z, code, error = _in_one_call(prepared, limit, options)
            if error <= budget.tolerance:
                pivots = code // _judged()[1]
                counters = {"iterations": pivots, "pivots": pivots}
                return SolverOutput(claim=Claim.SOLVED, point=LCPPoint.adopt(z), counters=counters)
            return _Run(prepared, budget, options).settled(z, code)
        run = _Run(prepared, budget, options)
        if start is not None:
            z = np.maximum(start.z, 0.0)
            if (error := error_of(prepared.problem, z)) <= budget.tolerance:
                return conclude(prepared.problem, z, budget, run.counters, error=error)
            output = run.from_support(z)
        elif n > SMALL and options.crash_sweeps > 0:
            z, sweeps = swept(prepared, min(options.crash_sweeps, run.left), OMEGA)
            run.counters["iterations"] += sweeps
            output = run.from_support(z) if sweeps else None
        else:
            output = None
        return run.plain() if output is None else output


def _in_one_call(lcp: DenseLCP, limit: int, options: LemkeOptions) -> tuple[Vector, int, float]:
    """Return z, the kernel's code, and the judged error: all pivots from w = q in less time than their preparation
    takes."""
    problem, z = lcp.problem, np.empty(lcp.problem.q.size)
    tolerances = options.pivot_tolerance, options.tie_tolerance
    code, error = _judged()[0](lcp.M, problem.q, z, problem.z_unit, limit, *tolerances)
    return z, code, error


@cache
def _judged() -> tuple[Any, int]:
    return compiled(load("cpbench.solvers.kernels.lemke_judged").lemke_judged), load(PIVOTING).CODES


@cache
def _spread() -> Any:
    return compiled(load("cpbench.solvers.kernels.lemke_judged").spread)


def pivot_limit(n: int) -> int:
    """Return the limit of pivots where the budget sets none."""
    return 50 * n + 1000


class _Run:
    """Counters of a solve, and the two ways to begin."""

    def __init__(self, lcp: DenseLCP, budget: Budget, options: LemkeOptions) -> None:
        self._lcp, self._budget, self._options = lcp, budget, options
        self._kernel = load(PIVOTING)
        self._limit = budget.iterations or options.max_pivots or pivot_limit(lcp.problem.q.size)
        self._deadline = time.monotonic() + budget.seconds
        self.counters = {"iterations": 0, "pivots": 0}

    @property
    def left(self) -> int:
        """Steps that may still be taken."""
        return self._limit - self.counters["iterations"]

    def from_support(self, z: Vector) -> SolverOutput | None:
        """Start from the basis that z points to; None where that basis or the way from there settles nothing."""
        lcp, budget = self._lcp, self._budget
        problem = lcp.problem
        inside = lcp.points_to(z, lcp.M @ z + problem.q)
        self.counters["factorizations"] = 1
        seen = transformed(lcp, inside)
        if seen is None and (fewer := inside & (z > 0.0)).sum() < inside.sum():
            # w = 0 beside z = 0, as semidefinite problems have it, points nowhere
            self.counters["factorizations"] = 2
            seen = transformed(lcp, fewer)
        if seen is None:
            return None
        if seen.q.min() >= 0.0:
            z = seen.lifted(seen.q, np.zeros_like(z))
        else:
            likely = min(max(int((seen.q < 0.0).sum()), LEAST), MOST)
            run = PivotingState(self._kernel, lcp.columns, seen.q, source=seen.negated_columns, likely=likely)
            if self._products(run, most=z.size) != "complementary":
                return None
            z = seen.lifted(run.w, run.z)
        output = ended_in_basis(problem, z, np.flatnonzero(z), budget, self.counters)
        return output if output.claim is Claim.SOLVED else None

    def plain(self) -> SolverOutput:
        """Start from w = q, where a ray may be followed by a proof."""
        lcp, budget, counters = self._lcp, self._budget, self.counters
        problem = lcp.problem
        if problem.q.size <= SMALL:
            z, code, _ = _in_one_call(lcp, self.left, self._options)
            return self.settled(z, code)
        if problem.q.min() >= 0.0:
            return conclude(problem, np.zeros_like(problem.q), budget, counters)
        p = max_abs(problem.q) or 1.0
        run = PivotingState(self._kernel, lcp.columns, problem.q / p, factor=-1.0 / lcp.unit)
        outcome = self._products(run)
        return self._ended(run.z * (p / lcp.unit), outcome)

    def settled(self, z: Vector, code: int) -> SolverOutput:
        """Conclude from the end of the compiled loop."""
        self._spend(code // self._kernel.CODES)
        return self._ended(z, self._word(code % self._kernel.CODES))

    def _ended(self, z: Vector, outcome: str) -> SolverOutput:
        problem, budget, counters = self._lcp.problem, self._budget, self.counters
        if outcome == "ray":
            return _after_ray(problem, z, budget, counters)
        if outcome != "complementary":
            claim = Claim.FAILED if outcome == "not finite" else Claim.MAX_ITER
            message = f"{outcome} after {counters['pivots']} pivots"
            return conclude(problem, z, budget, counters, otherwise=claim, message=message)
        return ended_in_basis(problem, z, np.flatnonzero(z), budget, counters)

    def _products(self, run: PivotingState, most: int | None = None) -> str:
        """Pivot, and bring what lies far behind by matrix products; at most `most` pivots; outcome in words."""
        kernel, options = self._kernel, self._options
        limit = self.left if most is None else min(self.left, most)
        while True:
            status = run.advance(limit, options.pivot_tolerance, options.tie_tolerance)
            if status == kernel.BEHIND:
                run.bring_likely()
            elif status == kernel.FULL:
                run.forget_pivots()
            else:
                break
            if time.monotonic() > self._deadline:
                break
        self._spend(run.pivots)
        return self._word(status)

    def _spend(self, pivots: int) -> None:
        self.counters["pivots"] += pivots
        self.counters["iterations"] += pivots

    def _word(self, status: int) -> str:
        kernel = self._kernel
        if status == kernel.COMPLEMENTARY:
            return "complementary"
        words = {kernel.RAY: "ray", kernel.LIMIT: "pivot limit", kernel.NOT_FINITE: "not finite"}
        return words.get(status, "out of time")


def _after_ray(problem: LCP, z: Vector, budget: Budget, counters: dict[str, int]) -> SolverOutput:
    """Claim infeasible when the certificate holds; otherwise failed, for a ray proves nothing by itself."""
    certificate = farkas(problem, budget)
    if certificate is not None:
        return SolverOutput(
            claim=Claim.INFEASIBLE,
            counters=counters,
            certificate=certificate,
            message=f"ray after {counters['pivots']} pivots; y ≥ 0, Mᵀy ≤ 0, qᵀy < 0 to rounding (Farkas)",
        )
    return conclude(
        problem,
        z,
        budget,
        counters,
        otherwise=Claim.FAILED,
        message=f"ray after {counters['pivots']} pivots, and no certificate of infeasibility: undecided",
    )
