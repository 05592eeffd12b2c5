"""Contact with nonlinear dynamics: planted problems, and Newton's method with a contact solver inside."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

from cpbench.errors import UnknownName
from cpbench.formulations import GFCPoint, NonlinearFrictionContact
from cpbench.formulations.expressions import Map
from cpbench.solvers import Budget, Claim, Solver, SolverOutput, SolverSpec, solvers
from cpbench.verification import judge
from cpbench_problems.generators import contact_nonlinear

INSTANCES = {i.name: i for i in contact_nonlinear.build()}


def test_the_midpoint_rule_keeps_what_it_should():
    """Without contact and load a spinning body keeps its energy: ωᵀJω is the same after the step."""
    problem = contact_nonlinear.spinning(2).problem
    before = problem.start
    # F(ω⁺) of the scheme with the loads taken away is N; N(ω⁺) = 0 by Newton from ω⁻
    loads = problem.F(before) - _torque(problem, before)
    v = before
    for _ in range(20):
        v = v - np.linalg.solve(problem.F.jacobian(v).toarray(), problem.F(v) - loads)
    J = np.diag(problem.F.jacobian(np.zeros(12)).toarray() + problem.F.jacobian(-2 * before).toarray())[3:6] / 2
    assert abs(v[3:6] - before[3:6]).max() > 0.1
    assert J @ v[3:6] ** 2 == pytest.approx(J @ before[3:6] ** 2, rel=1e-12)


def _torque(problem, omega):
    """h ω × Jω of both bodies and m v, what is left of N at ω⁺ = ω⁻; J by differences of F, which is quadratic."""
    size = omega.size
    middle = (problem.F.jacobian(np.zeros(size)).toarray() + problem.F.jacobian(-2 * omega).toarray()) / 2
    J = np.diag(middle)
    result = J * omega
    for b in range(size // 6):
        w, at = omega[6 * b + 3 : 6 * b + 6], slice(6 * b + 3, 6 * b + 6)
        result[at] = contact_nonlinear.STEP * np.cross(w, J[at] * w)
    return result


def test_a_chain_of_one_link_is_the_pendulum():
    """m l² (v⁺ − v⁻) + h m g l sin(q + h v_m/2), written by hand, but for the load."""
    problem = contact_nonlinear.pendulum(1).problem
    v = np.linspace(-3, 3, 7)
    forces = np.array([problem.F(np.array([x]))[0] for x in v])
    before, h, g = problem.start[0], contact_nonlinear.SWING, contact_nonlinear.GRAVITY
    sine = problem.H[0, 1] / 0.5
    q = math.asin(sine)
    inertia = (forces[-1] - forces[0] - 0.0) / (v[-1] - v[0])
    mass = 4.0 * 2.0 ** round(math.log2(inertia * 4.0) - 2)
    by_hand = mass * 0.25 * (v - before) + h * mass * g * 0.5 * np.sin(q + h / 4 * (v + before))
    np.testing.assert_allclose(np.diff(forces), np.diff(by_hand), rtol=1e-9)


# ------------------------------------------------------------------------------------------ Newton


@pytest.mark.parametrize("name", INSTANCES)
def test_newton_solves_every_planted_problem(name):
    problem = INSTANCES[name].problem
    out = solvers.get("newton-nfc").run(problem, Budget(tolerance=1e-10))
    assert out.claim is Claim.SOLVED
    assert judge(problem, out.point, 1e-10).solved


@pytest.mark.parametrize("name", ["drag-1", "drag-16", "spin-2", "pendulum-6", "pendulum-12"])
def test_newton_converges_quadratically(name):
    """Distances to the last iterate, once the contacts have settled: order 1.8 at least in the last step."""
    seen = []
    budget = Budget(tolerance=1e-13, iterations=12)
    solvers.get("newton-nfc").run(INSTANCES[name].problem, budget, record=lambda k, e, point: seen.append(point()))
    far = [np.linalg.norm(p.v - seen[-1].v) for p in seen[:-1]]
    far = [x for x in far if x > 1e-9]
    assert len(far) >= 3
    assert math.log(far[-1] / far[-2]) / math.log(far[-2] / far[-3]) >= 1.8


def test_newton_needs_one_step_for_linear_dynamics(rng):
    v = ca.SX.sym("v", 3)
    F = Map.from_casadi(v, 2 * v - ca.DM([-1.0, 0.5, 0.0]))
    problem = NonlinearFrictionContact(F=F, H=np.eye(3), w=np.zeros(3), mu=[0.5])
    out = solvers.get("newton-nfc").run(problem, Budget(tolerance=1e-12))
    assert out.counters["iterations"] == 1
    np.testing.assert_allclose(out.point.r, [1.0, -0.5, 0.0], atol=1e-12)


def test_newton_finds_the_answer_by_hand():
    """A mass that drops with v³ + v = −2 + r on a floor and is dragged along: sticks while μ r holds it."""
    v = ca.SX.sym("v", 2)
    F = Map.from_casadi(v, v**3 + v + ca.DM([2.0, -3.0]))
    for mu, expected in ((2.0, [2.0, -3.0]), (0.5, [2.0, -1.0])):
        problem = NonlinearFrictionContact(F=F, H=np.eye(2), w=np.zeros(2), mu=[mu], dimension=2)
        out = solvers.get("newton-nfc").run(problem, Budget(tolerance=1e-12))
        np.testing.assert_allclose(out.point.r, expected, atol=1e-10)
        # v_T³ + v_T = 3 + r_T
        np.testing.assert_allclose(out.point.v, [0.0, 0.0 if mu > 1 else 1.0], atol=1e-10)


def test_shorter_steps_where_newton_overshoots():
    """F(v) = atan(8v): from v = 3 the full steps of Newton go further away each time."""
    v = ca.SX.sym("v", 2)
    F = Map.from_casadi(v, ca.atan(8 * v))
    problem = NonlinearFrictionContact(
        F=F, H=np.eye(2), w=np.array([5.0, 0.0]), mu=[0.5], dimension=2, start=[3.0, 0.0]
    )
    out = solvers.get("newton-nfc").run(problem, Budget(tolerance=1e-10))
    assert out.claim is Claim.SOLVED
    np.testing.assert_allclose(out.point.v, 0.0, atol=1e-9)


def test_singular_dynamics_take_a_proximal_step():
    """F(v) = v³ has no derivative at the start, v = 0."""
    v = ca.SX.sym("v", 2)
    F = Map.from_casadi(v, v**3 - ca.DM([8.0, 0.0]))
    problem = NonlinearFrictionContact(F=F, H=np.eye(2), w=np.array([-2.0, 0.0]), mu=[0.5], dimension=2)
    out = solvers.get("newton-nfc").run(problem, Budget(tolerance=1e-8))
    assert out.claim is Claim.SOLVED
    assert out.point.v[0] == pytest.approx(2.0, abs=1e-6)


def test_a_solver_of_gfc_may_be_inside(monkeypatch):
    """Any registered solver of either node; what it is asked for gets finer with the square of the error."""
    asked = []

    class Global(Solver):
        spec = SolverSpec(name="test-global", node="gfc", summary="", method="")

        def solve(self, prepared, budget, options, start=None, record=None):
            asked.append(budget.tolerance)
            assert isinstance(start, GFCPoint)
            from cpbench_solvers.contact.nonlinear_dynamics import _local

            out = solvers.get("nsgs").run(_local(prepared), budget)
            return SolverOutput(claim=out.claim, point=GFCPoint(v=start.v, r=out.point.r), counters=out.counters)

    monkeypatch.setitem(solvers._items, "test-global", Global())
    newton = solvers.get("newton-nfc")
    problem = INSTANCES["spin-8"].problem
    out = newton.run(problem, Budget(tolerance=1e-10), newton.spec.options(inner="test-global"))
    assert judge(problem, out.point, 1e-10).solved
    assert asked == sorted(asked, reverse=True)
    assert asked[0] > 1e-4
    assert asked[-1] <= 1e-9


def test_an_inner_solver_of_another_node_is_named():
    newton = solvers.get("newton-nfc")
    with pytest.raises(UnknownName, match="lemke"):
        newton.run(INSTANCES["drag-1"].problem, None, newton.spec.options(inner="lemke"))


def test_what_cannot_be_solved_is_not_claimed():
    """A table that comes up faster than F lets anything move: v ≥ 5 and atan(v) + 2 ≤ 0 for want of a reaction."""
    v = ca.SX.sym("v", 2)
    F = Map.from_casadi(v, ca.vertcat(v[0], v[1]))
    H, w = np.array([[1.0, 0, -1, 0], [0, 1, 0, 1]]), np.array([-1.0, 0, -1, 0])  # v ≥ 1 and −v ≥ 1
    problem = NonlinearFrictionContact(F=F, H=H, w=w, mu=[0.0, 0.0], dimension=2)
    out = solvers.get("newton-nfc").run(problem, Budget(tolerance=1e-8, seconds=2.0))
    assert out.claim is not Claim.SOLVED


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
def test_claims_hold_in_every_connected_part(tolerance):
    """A link that is hit many times harder than another one."""
    problem = contact_nonlinear.pendulum(30).problem
    output = solvers.get("newton-nfc").run(problem, Budget(tolerance=tolerance))
    assert output.claim is Claim.SOLVED
    assert judge(problem, output.point, tolerance).solved
