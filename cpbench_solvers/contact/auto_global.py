"""Automatic choice on contact in global form: condensed where that is affordable, on the bodies where it is not.

Condensed, W = [Hᵀ 0]K⁻¹[H; 0] with K = [[M, −G], [Gᵀ, 0]]: by the inverses of M's blocks, where these are small and W
is sparse, or by a solve for every row of a contact.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.global_contact import GFCPoint, GlobalFrictionContact
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation import matrices
from cpbench.foundation.matrices import EPS, Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register, solvers
from cpbench.solvers.shared.progress import reduced
from cpbench_solvers.automatic import AutomaticChoice, SolverPhase, automatic_spec
from cpbench_solvers.contact.by_parts import SURE
from cpbench_solvers.contact.dynamics_error import DynamicsError
from cpbench_solvers.contact.global_parts import MovingParts, moving_parts, solve_moving
from cpbench_solvers.contact.parts import at_hand, at_rest

MOST = 2e7
"""Numbers of K⁻¹[H; 0] that are computed at most (160 MB): as much work as some hundred sweeps over such a W."""
WORST = 1e-10
"""Reciprocal condition of K below which v no longer follows from r to the tolerances that are asked for."""


@dataclass(frozen=True)
class Condensed:
    """The problem in r alone, and the way back. `local` : u = Wr + q. `problem` : the global one."""

    problem: GlobalFrictionContact
    local: FrictionContact

    def lift(self, point: FCPoint) -> GFCPoint:
        """Return (v, r, λ) of r."""
        return moved(self.problem, point.r)


def moved(problem: GlobalFrictionContact, r: Vector) -> GFCPoint:
    """Return (v, r, λ) with (v, λ) = K⁻¹(Hr + f, −b)."""
    force = problem.at_hand[1] @ r + problem.f
    v, lam = np.split(problem.saddle.solve(np.concatenate([force, -problem.b])), [force.size])
    return GFCPoint(v=v, r=r, lam=lam)


def condensed(problem: GlobalFrictionContact) -> Condensed | None:
    """Return the problem condensed, or None where that is too large, or K nearly singular."""
    saddle, H = problem.saddle, problem.at_hand[1]
    if not problem.nc or not saddle.rcond > WORST:
        return None
    if matrices.is_sparse(H) and matrices.is_sparse(saddle.A) and saddle.block_diagonal and not problem.b.size:
        W = matrices.transpose(H) @ (saddle.sparse_inverse @ matrices.sparse(H))
    elif saddle.n * problem.w.size <= MOST:
        if problem.small and not problem.b.size:
            moved = problem.responses
        else:
            full = np.zeros((saddle.n, problem.w.size))
            full[: problem.f.size] = matrices.dense(H)
            moved = saddle.solve(full)[: problem.f.size]
        W = matrices.transpose(H) @ moved
    else:
        return None
    if problem.factorization.symmetric:
        W = 0.5 * (W + W.T)
    return Condensed(problem, FrictionContact(W=W, q=problem.free_velocity, mu=problem.mu, dimension=problem.dimension))


LOCAL = "auto-fc"
FINER = 0.1
"""Times the tolerance, asked for in r at first: in v and r, part by part, an answer has a few times that error."""


@dataclass(frozen=True)
class PreparedCondensed:
    """Prepared problem: the problem condensed, and what the local solver has made of it."""

    condensed: Condensed
    local: Any
    options: Any


@register
class AutoGlobal(AutomaticChoice):
    """`auto-fc` on the condensed problem where W = HᵀM⁻¹H is affordable, which has more and cheaper methods to
    choose from. Where it is not, or where that fails: sweeps over the velocities of the bodies and ADMM by turns, then
    each for as long as it gains; ADMM alone where joints hold the bodies together.
    """

    spec: ClassVar[SolverSpec] = automatic_spec(
        "gfc", "auto-gfc", "auto-fc on the condensed problem, or Gauss-Seidel on the bodies and ADMM by turns"
    )
    members: ClassVar[tuple[str, ...]] = ("nsgs-gfc", "admm-gfc")

    def error(self, problem: GlobalFrictionContact, point: GFCPoint, tolerance: float) -> float:
        measured = DynamicsError(problem, tolerance)
        return max(measured(point), measured.floor)

    def phases(self, problem: GlobalFrictionContact) -> Sequence[SolverPhase]:
        return [SolverPhase(name) for name in (self.members[1:] if problem.b.size else self.members)]

    def setup(self, problem: GlobalFrictionContact, budget: Budget, options: Any) -> Any:
        if problem.saddle.rcond > WORST and at_rest(problem.free_velocity, problem.dimension):
            free = moved(problem, np.zeros(problem.w.size))
            if self.error(problem, free, SURE * budget.tolerance) <= SURE * budget.tolerance:
                return free
        small = condensed(problem)
        if small is None:
            parts = moving_parts(problem)
            return super().setup(problem, budget, options) if parts is None else parts
        solver = solvers.get(LOCAL)
        own = solver.spec.options()
        return PreparedCondensed(small, solver.setup(small.local, budget, own), own)

    def solve(
        self, prepared: Any, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        if isinstance(prepared, GFCPoint):
            return at_hand(prepared, {"iterations": 0}, record)
        if isinstance(prepared, MovingParts):
            return solve_moving(prepared, budget, start, record, self._part)
        if not isinstance(prepared, PreparedCondensed):
            return super().solve(prepared, budget, options, start, record)
        end = budget.deadline()
        output = _locally(solvers.get(LOCAL), prepared, budget, start, record)
        left = _left(budget, output.counters, budget, end)
        if output.claim is Claim.SOLVED or left is None:
            return output
        parts = moving_parts(prepared.condensed.problem)
        if parts is None:
            plan = super().setup(prepared.condensed.problem, left, options)
            rest = super().solve(plan, left, options, output.point, None)
        else:
            rest = solve_moving(parts, left, output.point, None, self._part)
        counters = dict(Counter(output.counters) + Counter(rest.counters))
        return replace(rest, counters=counters, message="; ".join(m for m in (output.message, rest.message) if m))

    def _part(self, part: Any, budget: Budget, start: Any | None, record: Record | None) -> SolverOutput:
        return self.run(part, budget, None, start, record)


def _left(finer: Budget, counters: Mapping[str, int], budget: Budget, end: float) -> Budget | None:
    """Return what is left of a budget, with the tolerance of `finer`; None where that is nothing."""
    left = budget.left(end, counters.get("iterations", 0))
    return None if left.seconds <= 0.0 or left.iterations == 0 else replace(left, tolerance=finer.tolerance)


def _locally(
    solver: Solver, prepared: PreparedCondensed, budget: Budget, start: Any | None, record: Record | None
) -> SolverOutput:
    """Solve the condensed problem more finely than is asked for, again where the lifted answer is not good enough."""
    small, end = prepared.condensed, budget.deadline()
    enough = SURE * budget.tolerance
    measured = DynamicsError(small.problem, enough)
    begin = None if start is None else FCPoint(start.r)
    passing = None if record is None else lambda done, error, local: record(done, error, lambda: small.lift(local()))
    finer, counters = replace(budget, tolerance=FINER * budget.tolerance), Counter[str]()
    while True:
        output = solver.solve(prepared.local, finer, prepared.options, begin, passing)
        counters.update(output.counters)
        point, claim = None, output.claim
        if output.point is not None:
            begin, passing, point = output.point, None, small.lift(output.point)
            error = measured(point)
            if error <= enough:
                claim = Claim.SOLVED
            elif claim is Claim.SOLVED:
                claim = Claim.INACCURATE
                finer = replace(finer, tolerance=reduced(finer.tolerance, error, enough))
        left = _left(finer, counters, budget, end)
        if claim is not Claim.INACCURATE or left is None or finer.tolerance < EPS:
            break
        finer = left
    message = f"condensed, {LOCAL}" + (f": {output.message}" if output.message else "")
    return measured.claimed(replace(output, claim=claim, point=point, counters=dict(counters), message=message))
