"""ADMM, interior point and projection methods over cones: planted problems, the algebra, each against another."""

from __future__ import annotations

import numpy as np
import planted_conic
import pytest
from tiers import some_by_day

from cpbench.formulations import AVI, QP, SOCLCP, ConeQP, Relay
from cpbench.formulations.conic import cone_fields
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.graph import arrive, lift
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.cone.lorentz_scaling import GroupScaling, LorentzCones
from cpbench_solvers.cone.scaled_form import conic_form

PROGRAMS = ("admm-coneqp", "interior-point-coneqp")
COMPLEMENTARITY = ("admm-soclcp", "interior-point-soclcp")
CONES = LorentzCones.of([("zero", 2), ("nonnegative", 3), ("lorentz", 3), ("lorentz", 4), ("lorentz", 3)])


def inside(rng: np.random.Generator) -> np.ndarray:
    v = rng.standard_normal(CONES.rows)
    for rows in CONES.groups:
        v[rows[:, 0]] = np.linalg.norm(v[rows[:, 1:]], axis=1) + rng.uniform(0.01, 1.0, rows.shape[0])
    return v


def test_the_scaling_point_is_one(rng: np.random.Generator) -> None:
    """Wy = λ, Wλ = s and W²y = s, W by its formula; {0} has none."""
    for _ in range(30):
        s, y, d = inside(rng), inside(rng), rng.standard_normal(CONES.rows)
        scaling = GroupScaling.of(CONES, s, y)
        felt = np.where(np.arange(CONES.rows) < 2, 0.0, s)
        np.testing.assert_allclose(scaling.times(scaling.lam), felt, atol=1e-12)
        np.testing.assert_allclose(scaling.times(y), scaling.lam, atol=1e-12)
        np.testing.assert_allclose(scaling.squared() @ y, felt, atol=1e-10)
        np.testing.assert_allclose(CONES.product(s, CONES.divided(s, d))[2:], d[2:], atol=1e-10)


def test_steps_end_at_the_boundary(rng: np.random.Generator) -> None:
    for _ in range(200):
        s, d = inside(rng), rng.standard_normal(CONES.rows)
        t = CONES.longest(s, d)
        if np.isfinite(t):
            assert abs(CONES.margin(s + t * d)) < 1e-10 * (1.0 + t)
            assert CONES.margin(s + 0.999 * t * d) > 0.0
        else:
            assert CONES.margin(s + 1e6 * d) > 0.0
    assert CONES.longest(inside(rng), inside(rng)) == np.inf
    assert CONES.longest(s, -s) == pytest.approx(1.0)


def test_the_nearest_point_of_a_cone() -> None:
    """min ½‖x‖² − cᵀx over K is P_K(c), unique; with A and b, over a moved cone too."""
    rng = np.random.default_rng(5)
    K = planted_conic.cone(rng, cylinders=True)
    c, shift = 2.0 * rng.standard_normal((2, K.rows))
    moved = ConeQP.over(np.eye(K.rows), -c, K, np.eye(K.rows), shift)
    for name in PROGRAMS:
        x = solvers.get(name).run(ConeQP.over(np.eye(K.rows), -c, K), Budget(tolerance=1e-9)).point.x
        np.testing.assert_allclose(x, K.project(c), atol=1e-6)
        x = solvers.get(name).run(moved, Budget(tolerance=1e-9)).point.x
        np.testing.assert_allclose(x, K.project(c + shift) - shift, atol=1e-6)


@pytest.mark.parametrize("name", some_by_day([*PROGRAMS, *COMPLEMENTARITY], 2))
def test_no_matter_what_units(name: str) -> None:
    """Forces and lengths of 1e-6 and 1e6 take about as many iterations."""
    counts: list[int] = []
    for unit in (1.0, 1e-6, 1e6):
        if name in PROGRAMS:
            problem, _ = planted_conic.coneqp(np.random.default_rng(3), 8, planted_conic.cone(np.random.default_rng(4)))
            asked = ConeQP.over(problem.Q / unit, problem.p, problem.K, problem.A, problem.b * unit)
        else:
            made, _ = planted_conic.soclcp(np.random.default_rng(3), None, "monotone")
            asked = SOCLCP(M=made.M * unit, q=made.q, **cone_fields(made.K))  # pyright: ignore[reportArgumentType]
        output = solvers.get(name).run(asked, Budget(tolerance=1e-6))
        assert output.claim is Claim.SOLVED, output.message
        counts.append(output.counters["iterations"])
    assert max(counts) <= 2 * min(counts)


def test_a_form_and_back(rng: np.random.Generator) -> None:
    """An answer in scaled units is the answer again."""
    problem, point = planted_conic.coneqp(rng, 9)
    form = conic_form(problem, 1e-6)
    x, y = form.start(point)
    np.testing.assert_allclose(form.M @ x + form.p, form.A.T @ y, atol=1e-10)
    back = form.answer(x, form.A @ x + form.b, y)
    np.testing.assert_allclose(back.x, point.x)
    np.testing.assert_allclose(back.y, point.y)


def test_impossible_programs_are_refused_or_stall() -> None:
    """x ≤ −1 and x ≥ 1; an indefinite Q and M; rows beside a box."""
    K = ProductCone.of((Cone.NONNEGATIVE, 1, 2))
    crossed = ConeQP.over(np.eye(1), np.zeros(1), K, np.array([[1.0], [-1.0]]), -np.ones(2))
    for name in PROGRAMS:
        output = solvers.get(name).run(crossed, Budget(tolerance=1e-6))
        assert output.claim is Claim.FAILED
        assert "stalled" in output.message or "step" in output.message
        saddle = ConeQP.over(np.diag([1.0, -1.0]), np.ones(2), K)
        assert "not convex" in (solvers.get(name).obstacle(saddle) or "")
    turned = SOCLCP(M=np.diag([1.0, -1.0]), q=np.ones(2), **cone_fields(K))  # pyright: ignore[reportArgumentType]
    assert "not monotone" in (solvers.get("interior-point-soclcp").obstacle(turned) or "")
    rows = AVI(M=np.eye(1), q=np.zeros(1), A=np.eye(1), b=np.ones(1))
    assert "lemke-avi" in (solvers.get("newton-avi").obstacle(rows) or "")


@pytest.mark.parametrize("name", ["newton-relay", "newton-avi"])
def test_a_rotation_between_bounds(name: str) -> None:
    """Skew M, on which plain projection turns for ever."""
    M = np.array([[0.0, 1.0], [-1.0, 0.0]])
    problem = (Relay if name == "newton-relay" else AVI)(M=M, q=np.array([-0.25, 0.5]), lb=-np.ones(2), ub=np.ones(2))
    output = solvers.get(name).run(problem, Budget(tolerance=1e-8))
    assert output.claim is Claim.SOLVED, output.message
    np.testing.assert_allclose(output.point.z, [0.5, 0.25], atol=1e-7)


@pytest.mark.parametrize("name", COMPLEMENTARITY)
def test_a_claim_over_flat_faces_holds_in_every_part(name: str) -> None:
    """Hock and Schittkowski's problem 21: a gradient of 0.04 beside slacks of up to 50, which set the norm."""
    program = QP(
        Q=np.diag([0.02, 2.0]),
        p=[0.0, 0.0],
        A=[[10.0, -1.0]],
        b=[10.0],
        C=np.zeros((0, 2)),
        d=[],
        lb=[2.0, -50.0],
        ub=[50.0, 50.0],
    )
    arrival = arrive(program, "soclcp")
    output = solvers.get(name).run(arrival.problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED
    assert judge(program, lift(arrival.problem, output.point), 1e-6).solved
