"""CVXPY's words for how a solve ended, which are the same whatever backend it called."""

from __future__ import annotations

from cpbench.solvers.base import Claim

CLAIMS = {
    "optimal": Claim.SOLVED,
    "optimal_inaccurate": Claim.INACCURATE,
    "infeasible": Claim.INFEASIBLE,
    "infeasible_inaccurate": Claim.INFEASIBLE,
    "unbounded": Claim.UNBOUNDED,
    "unbounded_inaccurate": Claim.UNBOUNDED,
    "user_limit": Claim.MAX_ITER,
}
