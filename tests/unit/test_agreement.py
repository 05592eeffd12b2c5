"""Two ways to one answer agree: the solution is unique, so the answers are compared, not only their residuals."""

from __future__ import annotations

import numpy as np
import planted
import planted_contact
import pytest

from cpbench import graph
from cpbench.conversions.base import make
from cpbench.formulations import GlobalFrictionContact, QPPoint
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


def only_inequalities(rng):
    """A strictly convex QP without equalities, with independent constraints: primal and dual answer are unique."""
    problem, point = planted.qp(rng, 8, 4, 0)
    free = np.full(8, np.inf)
    target = type(problem).build(problem.Q, problem.p - point.nu, A=problem.A, b=problem.b, lb=-free, ub=free)
    return target, QPPoint(z=point.z, lam=point.lam, mu=point.mu, nu=np.zeros(8))


WAYS = {
    "primal": ((), "daqp"),
    "dual": (("qp-qp-dual",), "daqp"),
    "KKT as MLCP, Schur": (("qp-mlcp", "mlcp-lcp-schur"), "lemke"),
    "dual as LCP": (("qp-qp-dual", "qp-avi", "avi-lcp-bounds"), "lemke"),
    "variational inequality": (("qp-avi", "avi-mlcp", "mlcp-lcp-schur"), "newton-min"),
}


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("seed", SEEDS)
def test_primal_dual_kkt_and_lcp_of_a_quadratic_program(seed):
    problem, planted_point = only_inequalities(np.random.default_rng(seed))
    assert problem.residuals(planted_point).error <= 1e-12
    for way, (edges, solver) in WAYS.items():
        point = answered(problem, *edges, by=solver)
        np.testing.assert_allclose(point.z, planted_point.z, atol=1e-7, err_msg=way)
        np.testing.assert_allclose(point.lam, planted_point.lam, atol=1e-6, err_msg=way)
        assert problem.residuals(point).error <= 1e-7, way


# --------------------------------------------------------------------------------------------- contact


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("joints", [0, 2])
def test_global_contact_condensed_at_once_in_two_steps_and_directly(seed, joints):
    """gfc-fc, gfc-fcm-fc and, without friction, (40) on the velocities themselves."""
    problem, point = planted_contact.gfc(np.random.default_rng(seed), 5, 3, joints, 2)
    at_once, in_two = make("gfc-fc").step(problem), make("fcm-fc").step(make("gfc-fcm").step(problem))
    np.testing.assert_allclose(at_once.W, in_two.W, atol=1e-9)
    np.testing.assert_allclose(at_once.q, in_two.q, atol=1e-9)
    for condensed in (at_once, in_two):
        lifted = graph.lift(condensed, graph.push(condensed, point))
        for name, value in point.arrays().items():
            np.testing.assert_allclose(getattr(lifted, name), value, atol=1e-8, err_msg=name)

    smooth = GlobalFrictionContact(
        M=problem.M, H=problem.H, G=problem.G, f=problem.f, w=problem.w, b=problem.b, mu=np.zeros(3), dimension=2
    )
    directly = answered(smooth, "gfc-mlcp", "mlcp-lcp-split", by="lemke")
    condensed = answered(smooth, "gfc-fc", "fc-lcp-frictionless", by="lemke")
    assert smooth.residuals(directly).error <= 1e-9
    for name, value in condensed.arrays().items():
        np.testing.assert_allclose(getattr(directly, name), value, atol=1e-7, err_msg=name)


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


@pytest.mark.parametrize("seed", SEEDS)
def test_tresca_with_the_right_threshold_is_coulomb(seed):
    """With g = μ r_N of a solution, it solves the cylinder problem too; with half of it, only if little rubs."""
    problem, point = planted.fc(np.random.default_rng(seed), 5, 3, "positive definite")
    normal = point.r.reshape(-1, 3)[:, 0]
    target = make("fc-coneqp-tresca", {"threshold": tuple(problem.mu * normal)}).step(problem)
    assert target.residuals(graph.push(target, point)).error <= 1e-10
    less = make("fc-coneqp-tresca", {"threshold": tuple(0.5 * problem.mu * normal)}).step(problem)
    rubs = np.linalg.norm(point.r.reshape(-1, 3)[:, 1:], axis=1) > 0.51 * problem.mu * normal
    assert (less.residuals(graph.push(less, point)).error > 1e-3) == rubs.any()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("edge", ["fc-coneqp", "fc-soclcp"])
def test_de_saxce_frozen_at_the_solution_is_coulomb(seed, edge):
    problem, point = planted.fc(np.random.default_rng(seed), 5, 3, "positive definite")
    u = problem.slacks(point)["u"].reshape(-1, 3)
    slip = tuple(problem.mu * np.linalg.norm(u[:, 1:], axis=1))
    target = make(edge, {"slip": slip}).step(problem)
    assert target.residuals(graph.push(target, point)).error <= 1e-10


# ----------------------------------------------------------------------------------------------- boxes
