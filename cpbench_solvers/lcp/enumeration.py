"""All solutions of a small LCP, by looking at each of its 2ⁿ complementary bases."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import LCP
from cpbench.foundation.matrices import Vector, dense
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench_solvers import linear_program
from cpbench_solvers.kernels import complementary_bases
from cpbench_solvers.lcp.claims import ScaledLCP, conclude, error_of, farkas, principal, refined, scale, solve_linear

LARGEST = 20
"""Unknowns: 2²⁰ bases take seconds."""
CHUNK = 1 << 12
"""Bases between two looks at the clock."""
SAME = 1e-9
"""Solutions this close, as a share of the larger, are one: at a degenerate one several bases meet."""


@dataclass(frozen=True)
class EnumerationOptions:
    """Options of enumeration-lcp, enumeration-mlcp. `max_programs` : singular bases that linear programs look into."""

    max_programs: int = 500


enumeration_spec = partial(
    SolverSpec,
    method="enumeration",
    traits=frozenset({Trait.DETERMINISTIC}),
    options=EnumerationOptions,
    by_default=False,
)
"""The spec of the two enumerations, with what they share."""


@dataclass
class Enumeration:
    """Result of an enumeration.

    Attributes
    ----------
    solutions : different z, by increasing number of their basis Σ_{i in F} 2ⁱ. bases : looked at. singular : of these,
    M_FF singular with M_FF z_F = -q_F consistent. faces : of these, with a solution; where z_F is not unique it
    belongs to a face of them. undecided : bases too close to tell, or singular and not looked into.
    closest : greatest over the bases of the least (scaled) component, the miss of the best cone where negative.
    """

    solutions: list[Vector] = field(default_factory=list)
    bases: int = 0
    singular: int = 0
    faces: int = 0
    undecided: int = 0
    programs: int = 0
    closest: float = -np.inf

    def add(self, z: Vector) -> None:
        size = np.abs(z).max(initial=0.0)
        if all(np.abs(z - known).max(initial=0.0) > SAME * max(size, np.abs(known).max()) for known in self.solutions):
            self.solutions.append(z)

    def __str__(self) -> str:
        text = f"{len(self.solutions)} solutions in {self.bases} bases"
        if self.singular:
            text += f", {self.singular} of them singular, {self.faces} of these on solutions that may not be isolated"
        return text + (f", {self.undecided} undecided" if self.undecided else "")


@register
class LCPEnumeration(Solver):
    """Enumeration of bases: answers the solution of the one with the least number Σ 2ⁱ, i in F; says how many there
    are.

    No solution is claimed infeasible where every cone was excluded by more than rounding; with Farkas' certificate
    where there is one, by exhaustion where a z ≥ 0 with Mz + q ≥ 0 exists and none is complementary.
    """

    spec: ClassVar[SolverSpec] = enumeration_spec(
        name="enumeration-lcp",
        node="lcp",
        summary=f"all solutions of up to {LARGEST} unknowns, by the 2^n complementary bases",
        citation="Murty 1988, section 1.3; Cottle, Pang and Stone 2009, section 1.3",
    )

    def obstacle(self, problem: LCP) -> str | None:
        n = problem.q.size
        return None if n <= LARGEST else f"looks at 2^n bases, n = {n} (at most {LARGEST}): use lemke"

    def setup(self, problem: LCP, budget: Budget, options: EnumerationOptions) -> ScaledLCP:
        return scale(problem)

    def solve(
        self,
        prepared: ScaledLCP,
        budget: Budget,
        options: EnumerationOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, n = prepared.problem, prepared.q.size
        search = enumerate_bases(prepared, budget, options)
        counters = {
            "iterations": search.bases,
            "singular_bases": search.singular,
            "solutions": len(search.solutions),
            "linear_programs": search.programs,
        }
        whole = search.bases == 2**n
        if search.solutions:
            output = conclude(problem, search.solutions[0], budget, counters)
            text = str(search) if whole else f"{search}, of {2**n}"
            return SolverOutput(claim=output.claim, point=output.point, counters=counters, message=text)
        if not whole or search.undecided:
            claim = Claim.FAILED if whole else Claim.MAX_ITER
            return conclude(problem, np.zeros(n), budget, counters, otherwise=claim, message=f"{search}, of {2**n}")
        certificate = farkas(problem, budget)
        how = "y ≥ 0, Mᵀy ≤ 0, qᵀy < 0 to rounding" if certificate is not None else "by exhaustion, to rounding"
        message = f"no solution in all {2**n} bases, the closest misses by {-search.closest:.1e}: {how}"
        return SolverOutput(claim=Claim.INFEASIBLE, counters=counters, certificate=certificate, message=message)


def enumerate_bases(prepared: ScaledLCP, budget: Budget, options: EnumerationOptions | None = None) -> Enumeration:
    """Try every basis in turn, until budget.iterations of them or its seconds; solutions within its tolerance."""
    kernel = complementary_bases
    options = options or EnumerationOptions()
    problem, M, q = prepared.problem, dense(prepared.M), prepared.q
    n = q.size
    end = min(2**n, budget.iterations or 2**n)
    deadline = time.monotonic() + budget.seconds
    result = Enumeration()
    masks, kinds = np.empty((2, CHUNK), dtype=np.int64)
    closest = np.full(1, -np.inf)
    while result.bases < end and time.monotonic() <= deadline:
        until = min(end, result.bases + CHUNK)
        # compiled code looks at all bases, and keeps those that rounding does not exclude
        kept = kernel.scan(np.ascontiguousarray(M), q, result.bases, until, masks, kinds, closest)
        result.bases = until
        for mask, kind in zip(masks[:kept].tolist(), kinds[:kept].tolist(), strict=True):
            F = np.flatnonzero(mask >> np.arange(n) & 1)
            if kind != kernel.SINGULAR:
                z = np.zeros(n)
                z[F] = solve_linear(principal(M, F), -q[F])
            else:
                result.singular += 1
                if result.programs >= options.max_programs or time.monotonic() > deadline:
                    result.undecided += 1
                    continue
                result.programs += 1
                z = _on_a_face(M, q, F)
                if z is None:
                    continue
            z = np.maximum(z, 0.0) * prepared.z_unit
            # `not <=`: an error that is not a number is refined, too
            if not error_of(problem, z, budget.tolerance) <= budget.tolerance:
                z = refined(dense(problem.M), problem.q, z, F)
            if error_of(problem, z, budget.tolerance) <= budget.tolerance:
                result.faces += kind == kernel.SINGULAR
                result.add(z)
            else:
                result.undecided += 1
    result.closest = float(closest[0])
    return result


def _on_a_face(M: np.ndarray[Any, Any], q: Vector, F: np.ndarray[Any, Any]) -> Vector | None:
    """Return the z ≥ 0 of least sum with z = 0 outside F, w = 0 in F, w ≥ 0 outside; None where there is none."""
    N = np.setdiff1d(np.arange(q.size), F)
    sides = {"A_ub": -M[np.ix_(N, F)], "b_ub": q[N], "A_eq": M[np.ix_(F, F)], "b_eq": -q[F]}
    program = linear_program.linprog(np.ones(F.size), method="highs", **sides)
    if program.x is None:
        return None
    z = np.zeros(q.size)
    z[F] = program.x
    return z
