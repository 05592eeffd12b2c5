"""A global contact problem without its bodies and joints, for solvers that weigh condensing against staying global.

W = [Hᵀ 0]K⁻¹[H; 0], K = [[M, −G], [Gᵀ, 0]]: by the inverses of M's blocks, where these are small and W is sparse, or by
a solve for every row of a contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.global_contact import GFCPoint
from cpbench.foundation import matrices

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
        """Return (v, r, λ) with (v, λ) = K⁻¹(Hr + f, −b)."""
        problem = self.problem
        force = problem.at_hand[1] @ point.r + problem.f
        v, lam = np.split(problem.saddle.solve(np.concatenate([force, -problem.b])), [force.size])
        return GFCPoint(v=v, r=point.r, lam=lam)


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
