"""Two ways to one answer agree: the solution is unique, so the answers are compared, not only their residuals."""

from __future__ import annotations

import numpy as np
import planted_contact
import pytest

from cpbench import graph
from cpbench.conversions.base import make
from cpbench.formulations import GlobalFrictionContact
from cpbench.solvers.base import Budget, solvers

SEEDS = range(4)


def answered(problem, *edges: str, by: str):
    """The answer of the solver `by` to the problem at the end of the edges, lifted to the problem."""
    there = problem
    for name in edges:
        there = make(name).step(there)
    output = solvers.get(by).run(there, Budget(tolerance=1e-11))
    assert output.point is not None, output.message
    return graph.lift(there, output.point)


# ------------------------------------------------------------------------------------------------- qp


# --------------------------------------------------------------------------------------------- contact


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("seed", SEEDS)
def test_friction_without_condensation_by_the_fixed_point_on_de_saxce(seed):
    """min ½vᵀMv − fᵀv over Hᵀv + w + s e_N ∈ K* with s := μ‖u_T‖ until it stays, against the condensed problem."""
    problem, _ = planted_contact.gfc(np.random.default_rng(seed), 5, 3, 1, 3)
    mild = GlobalFrictionContact(
        M=problem.M, H=problem.H, G=problem.G, f=problem.f, w=problem.w, b=problem.b, mu=np.full(3, 0.3), dimension=3
    )
    slip = np.zeros(3)
    for _ in range(200):
        target = make("gfc-coneqp", {"slip": tuple(slip)}).step(mild)
        output = solvers.get("clarabel-coneqp").run(target, Budget(tolerance=1e-11))
        point = graph.lift(target, output.point)
        u = mild.slacks(point)["u"].reshape(-1, 3)
        before, slip = slip, mild.mu * np.linalg.norm(u[:, 1:], axis=1)
        if np.abs(slip - before).max() <= 1e-11:
            break
    assert mild.residuals(point).error <= 1e-8
    condensed = answered(mild, "gfc-fc", by="nsgs")
    assert mild.residuals(condensed).error <= 1e-8
    np.testing.assert_allclose(condensed.v, point.v, atol=1e-6)


# ----------------------------------------------------------------------------------------------- boxes
