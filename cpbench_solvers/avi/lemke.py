"""Pivoting on affine variational inequalities: over a polyhedron from one of its vertices, and over a box.

The conditions with the multipliers of the rows are a linear problem between bounds, which `bounded_lemke` solves along
the path of −(Mz + q) + t e ∈ N_X(z), t from ∞ to 0, e inside the normal cone of a vertex z of X: at first only the
forces, not the rows, are covered, so that all points of the path are in X.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.linear import AVI, AVIPoint, LCPPoint, Relay
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench_solvers.avi.bounded_lemke import BoxLCP, PivotOptions, Walk
from cpbench_solvers.avi.claims import error_of
from cpbench_solvers.avi.polyhedron_vertex import ACTIVE, ScaledPolyhedron
from cpbench_solvers.lcp.claims import CLOSE, concluded, size_obstacle
from cpbench_solvers.qp.scaling import congruent, equilibrate


@dataclass(frozen=True)
class MultiplierBox:
    """Kx + r over a box with x = (z, λ, μ) = unit·x̂, x̂ the scaled unknowns of `box` where lb < ub, else lb."""

    problem: Any
    box: BoxLCP
    moving: NDArray[np.bool_]
    unit: Vector
    lower: Vector
    sizes: tuple[int, int, int]

    @classmethod
    def of(cls, problem: AVI | Relay) -> MultiplierBox:
        n, none = problem.q.size, (np.zeros((0, problem.q.size)), np.zeros(0))
        A, b, C, d = (problem.A, problem.b, problem.C, problem.d) if isinstance(problem, AVI) else (*none, *none)
        m, k = b.size, d.size
        zero = np.zeros((m + k, m + k))
        rows = np.vstack([matrices.dense(A), matrices.dense(C)])
        K = np.block([[matrices.dense(problem.M), -rows.T], [rows, zero]])
        r = np.concatenate([problem.q, -b, -d])
        lb = np.concatenate([problem.lb, np.zeros(m), np.full(k, -np.inf)])
        ub = np.concatenate([problem.ub, np.full(m + k, np.inf)])
        moving = lb < ub
        # unknowns with equal bounds are constants, and would be columns that no pivot may enter
        r = (r + K @ np.where(moving, 0.0, lb))[moving]
        K = K[np.ix_(moving, moving)]
        unit = equilibrate(K, np.arange(r.size))
        dense = np.ascontiguousarray(matrices.dense(congruent(K, unit)))
        multiplier = (np.arange(n + m + k) >= n)[moving]
        box = BoxLCP(dense, unit * r, lb[moving] / unit, ub[moving] / unit, multiplier)
        return cls(problem, box, moving, unit, lb, (n, m, k))

    @cached_property
    def parts(self) -> tuple[slice, slice, slice]:
        """Slices of x̂: z, λ and μ."""
        n, m, _ = self.sizes
        z = int(self.moving[:n].sum())
        return slice(0, z), slice(z, z + m), slice(z + m, None)

    def point(self, x: Vector) -> Any:
        """Return x̂ as an answer."""
        n, m, _ = self.sizes
        whole = np.where(self.moving, 0.0, self.lower)
        whole[self.moving] = self.unit * x
        if isinstance(self.problem, Relay):
            return LCPPoint(np.clip(whole, self.problem.lb, self.problem.ub))
        z = np.clip(whole[:n], self.problem.lb, self.problem.ub)
        return AVIPoint(z=z, lam=np.maximum(whole[n : n + m], 0.0), mu=whole[n + m :])

    def unknowns(self, point: Any) -> Vector:
        """Return x̂ of an answer, within its bounds."""
        x = point.vector[self.moving] / self.unit
        return np.clip(x, self.box.lb, self.box.ub)

    def polyhedron(self) -> ScaledPolyhedron:
        z, lam, mu = self.parts
        K, r = self.box.K, self.box.r
        return ScaledPolyhedron(K[lam, z], -r[lam], K[mu, z], -r[mu], self.box.lb[z], self.box.ub[z])


class _Pivoting(Solver):
    """Base of the solvers of the two nodes."""

    def obstacle(self, problem: AVI | Relay) -> str | None:
        return size_obstacle(sum(problem.point_sizes.values()), "a Newton method")

    def setup(self, problem: AVI | Relay, budget: Budget, options: PivotOptions) -> MultiplierBox:
        return MultiplierBox.of(problem)

    def solve(
        self,
        prepared: MultiplierBox,
        budget: Budget,
        options: PivotOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, box = prepared.problem, prepared.box
        deadline = time.monotonic() + budget.seconds
        limit = budget.iterations or options.max_pivots or 50 * box.r.size + 1000
        counters = {"iterations": 0, "factorizations": 0}
        # pivoting leaves the start, and comes back to it at the cost of a cold solve
        if start is not None and error_of(problem, start, budget.tolerance) <= budget.tolerance:
            return SolverOutput(claim=Claim.SOLVED, point=start, counters=counters)
        walk, message = None, ""
        # where the path from the start does not end in a solution, that from a vertex may, or proves that there is none
        for begin in (_from_start, _from_vertex) if start is not None else (_from_vertex,):
            basis = begin(prepared, start)
            if isinstance(basis, str):
                message = basis
                continue
            inside, near = basis
            walk = box.walk(inside, near, limit, deadline, options)
            counters["factorizations"] += 1
            if walk is not None:
                counters["iterations"] += walk.pivots
                if walk.outcome == "complementary":
                    break
            else:
                message = "singular where no bound holds: M is not invertible on the lines in the set"
        if walk is None:
            return SolverOutput(claim=Claim.FAILED, counters=counters, message=message)
        return _concluded(prepared, walk, budget, counters)


def _from_vertex(prepared: MultiplierBox, start: Any) -> tuple[NDArray[np.bool_], Vector] | str:
    """Return the basis of a vertex where the forces at rest are least."""
    z, lam, mu = prepared.parts
    box, rows = prepared.box, prepared.polyhedron()
    vertex = rows.vertex(box.r[z])
    if vertex is None:
        return "the rows and bounds have no common point, by the simplex method of HiGHS"
    inside, near = np.zeros(box.r.size, dtype=bool), np.zeros(box.r.size)
    near[z] = vertex
    inside[z], inside[lam], inside[mu] = rows.basis(vertex)
    return inside, near


def _from_start(prepared: MultiplierBox, start: Any) -> tuple[NDArray[np.bool_], Vector]:
    """Return the unknowns between bounds and the rows with a force at the start, as far as they are independent."""
    z, lam, mu = prepared.parts
    x, rows = prepared.unknowns(start), prepared.polyhedron()
    active = x[lam] > ACTIVE * (1.0 + max_abs(x[lam]))
    C, d = np.vstack([rows.C, rows.A[active]]), np.concatenate([rows.d, rows.b[active]])
    N, _, E = replace(rows, A=rows.A[~active], b=rows.b[~active], C=C, d=d).basis(x[z])
    inside, pushed = np.zeros(x.size, dtype=bool), np.zeros(active.size, dtype=bool)
    pushed[active] = E[rows.d.size :]
    inside[z], inside[lam], inside[mu] = N, pushed, E[: rows.d.size]
    return inside, x


def _concluded(prepared: MultiplierBox, walk: Walk, budget: Budget, counters: dict[str, int]) -> SolverOutput:
    problem, tolerance = prepared.problem, budget.tolerance
    point = prepared.point(walk.x)
    error = error_of(problem, point, tolerance)
    if error > tolerance and walk.outcome == "complementary":
        counters["factorizations"] += 1
        better = prepared.box.refined(walk)
        if better is not None:
            candidate = prepared.point(better)
            reached = error_of(problem, candidate, tolerance)
            if reached < error:
                point, error = candidate, reached
    claim = Claim.MAX_ITER if walk.outcome == "pivot limit" else Claim.FAILED
    if walk.outcome == "complementary" and error <= CLOSE * tolerance:
        claim = Claim.INACCURATE
    what = f"{walk.outcome} after {walk.pivots} pivots, error {error:.1e}"
    return concluded(point, error, budget, counters, claim, what)


_spec = partial(
    SolverSpec, method="pivoting", traits=frozenset({Trait.WARM_START, Trait.DETERMINISTIC}), options=PivotOptions
)


@register
class LemkeAVI(_Pivoting):
    """A method that ends in a solution or in a ray; for monotone M (copositive-plus on the recession cone of X) a ray
    proves that there is no solution. M need not be monotone; where X contains lines it must be invertible on them."""

    spec: ClassVar[SolverSpec] = _spec(
        name="lemke-avi",
        node="avi",
        summary="complementary pivoting from a vertex of the polyhedron, lexicographic ratio test",
        citation="Cao and Ferris 1996, Math. Oper. Res. 21:44; Eaves 1971; Lemke 1965",
    )


@register
class LemkeRelay(_Pivoting):
    """Lemke's method on as many rows as unknowns: bounds cost nothing, where the LCP of a relay problem has twice as
    many. Ends in a solution whatever M is: the box is bounded."""

    spec: ClassVar[SolverSpec] = _spec(
        name="lemke-relay",
        node="relay",
        summary="complementary pivoting between bounds, lexicographic ratio test",
        citation="Cao and Ferris 1996, Math. Oper. Res. 21:44; Lemke 1965",
    )
