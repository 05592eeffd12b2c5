"""`cpbench.solve` looks for a proof that there is no solution where no answer meets the tolerance."""

from __future__ import annotations

import numpy as np

import cpbench
from cpbench.formulations import LCP, QP
from cpbench.formulations.local_contact import FrictionContact
from cpbench.verification import Status

SADDLE = np.diag([1.0, -1.0])
NO_POINT = LCP(M=[[-1.0, -1.0], [0.0, 1.0]], q=[-1.0, 1.0])
"""−z₁ − z₂ ≥ 1 with z ≥ 0."""


def squeezed(opposed: float, dimension: int = 3) -> FrictionContact:
    """Two contacts of one body, which close with 1 from both sides; `opposed` of a reaction acts at the other one."""
    W = np.eye(2 * dimension)
    W[0, dimension] = W[dimension, 0] = -opposed
    return FrictionContact(W=W, q=np.tile(-np.eye(dimension)[0], 2), mu=[0.5, 0.5], dimension=dimension)


def test_what_has_no_solution_is_not_called_a_failure() -> None:
    for problem, status in ((squeezed(1.0), Status.INFEASIBLE), (QP.build(SADDLE, -np.ones(2)), Status.UNBOUNDED)):
        found = cpbench.solve(problem, seconds=5.0)
        assert found.status == status, (found.status, found.message)
        assert "proved" in found.message
    for problem in (squeezed(0.5), QP.build(SADDLE, -np.ones(2), ub=np.ones(2), lb=-np.ones(2))):
        assert cpbench.solve(problem, seconds=5.0).status not in (Status.INFEASIBLE, Status.UNBOUNDED)


def test_a_proof_on_an_equivalent_problem_is_one_of_the_problem_that_was_asked() -> None:
    """No conditions are known of a nonlinear map; those of the LCP that it is stand for it."""
    problem = cpbench.convert(NO_POINT, "ncp").problem
    found = cpbench.solve(problem, seconds=5.0)
    assert found.status == Status.INFEASIBLE, (found.status, found.route, found.message)
    assert "which has the same solutions" in found.message
