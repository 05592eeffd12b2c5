"""Edges from frictional contact to nonlinear nodes, and between linear and nonlinear dynamics."""

from __future__ import annotations

import itertools

import casadi as ca
import numpy as np
import planted
import planted_contact
import pytest

from cpbench import graph
from cpbench.conversions.base import make
from cpbench.conversions.contact_laws import clipped
from cpbench.errors import NotApplicable
from cpbench.formulations import FCPoint, FrictionContact, Kind, MiCPPoint, NFCPoint, NonlinearFrictionContact
from cpbench.formulations.expressions import Map
from cpbench.solvers import Budget, solvers
from cpbench.verification import judge

FC_EDGES = ("fc-micp", "fc-cp", "fc-vi", "fc-qvi")
RFC_EDGES = ("rfc-cp", "rfc-vi")


@pytest.mark.parametrize("name", [*FC_EDGES, *RFC_EDGES])
def test_derivatives_are_those_of_differences_and_finite_at_rest(rng, name):
    if name in RFC_EDGES:
        problem, _ = planted_contact.rfc(rng, 3, 5)
    else:
        problem, _ = planted.fc(rng, 3, 3, "positive definite")
    F = make(name).step(problem).F
    z, way = rng.standard_normal(F.inputs), rng.standard_normal(F.inputs)
    slope = (F(z + 1e-6 * way) - F(z - 1e-6 * way)) / 2e-6
    np.testing.assert_allclose(F.jacobian(z) @ way, slope, rtol=1e-6, atol=1e-6)
    assert np.isfinite(F.jacobian(np.zeros(F.inputs)).data).all()
    # W = 0 and q = 0: every velocity is 0, where ‖u_T‖ has no derivative
    still = type(problem)(**{**problem.data(), "W": 0 * problem.W, "q": 0 * problem.q}, dimension=problem.dimension)
    F = make(name).step(still).F
    assert np.isfinite(F.jacobian(z).data).all()


@pytest.mark.parametrize("name", ["fc-cp", "fc-vi"])
@pytest.mark.parametrize(("mu", "held"), [(0.3, True), (10.0, True), (100.0, True), (1e4, False)])
def test_a_steep_cone_is_environment_what_it_hides(name: str, mu: float, held: bool) -> None:
    """A contact that closes and slides, with no force: beyond what is asked for the rest is lost."""
    W = np.array([[2.0, 0.3, 0.1], [0.3, 1.0, 0.0], [0.1, 0.0, 1.0]])
    problem = FrictionContact(W=W, q=np.array([-1.0, 0.5, 0.2]), mu=np.array([mu]), dimension=3)
    edge, point = make(name), FCPoint(r=np.zeros(3))
    target, trace = edge.apply(problem)
    here, there = judge(problem, point, 1e-6).error, judge(target, edge.push(point, trace), 1e-6).error
    assert (here <= there * 1e-6 / edge.tolerance(1e-6, trace)) == held


def test_trescas_threshold_is_that_of_each_contact_alone():
    """μ max(−q_N, 0)/W_NN."""
    problem = FrictionContact(W=np.diag([2.0, 1.0, 1.0, 4.0, 1.0, 1.0]), q=[-3.0, 0, 0, 1, 0, 0], mu=[0.5, 0.5])
    assert make("fc-coneqp-tresca").step(problem).cone_mu.tolist() == [0.75, 0.0]


def test_the_cylinder_moves_with_the_normal_reaction():
    """One contact in the plane that slides: X(r) = ℝ₊ × [−μ r_N, μ r_N] at the planted answer."""
    problem = FrictionContact(W=np.eye(2), q=[-2.0, 3.0], mu=[0.5], dimension=2)
    point = FCPoint(r=[2.0, -1.0])  # u = (0, 2)
    target, there = planted.both_ways(make("fc-qvi"), problem, point)
    K, _, _ = target.set_at(there.z)
    assert K.mu[0] == pytest.approx(abs(there.z[1]))
    half = type(there)(z=there.z * [0.5, 1.0])
    assert target.residuals(half).error > 0.1


# -------------------------------------------------------------------------------------------- (49)


def test_micp_has_no_answer_that_the_law_has_not():
    """With ξ apart, r_T = 0 and ξ = 0 would let a contact slide without friction; (49) as written here does not."""
    problem = FrictionContact(W=np.eye(3), q=[-1.0, 1.0, 0.0], mu=[0.5])
    edge = make("fc-micp")
    target = edge.step(problem)
    slides_freely = MiCPPoint(z=np.eye(4)[0])
    assert edge.lift(slides_freely, target.provenance[-1].trace).r[0] == 1.0  # u = (0, 1, 0)
    assert target.residuals(slides_freely).error > 0.1


def scene(rng, states):
    """Contacts with a definite W in the given states: open, touching (no force and no gap), sticking, sliding."""
    r, u = np.zeros((len(states), 3)), np.zeros((len(states), 3))
    for c, state in enumerate(states):
        way = rng.standard_normal(2)
        way /= np.linalg.norm(way)
        if state in ("stick", "slide"):
            r[c, 0] = 1.0
            r[c, 1:] = (0.5 if state == "slide" else 0.2) * way
        if state == "open":
            u[c] = [0.5, *way]
        if state in ("slide", "touch"):
            u[c, 1:] = -way
    W = planted.square(rng, 3 * len(states), "positive definite")
    return FrictionContact(W=W, q=u.ravel() - W @ r.ravel(), mu=np.full(len(states), 0.5)), FCPoint(r=r.ravel())


@pytest.mark.parametrize(
    "states",
    [["stick", "slide"], ["stick", "open", "slide", "open"], ["slide", "touch"], ["open", "touch", "stick", "slide"]],
)
def test_micp_tells_where_it_is_singular(rng, states):
    """No contact is told where the derivative of the active rows is regular at the answer, and some where it is not."""
    problem, point = scene(rng, states)
    edge = make("fc-micp")
    target, there = planted.both_ways(edge, problem, point)
    told = edge.singular(there, target.provenance[-1].trace)
    assert told.tolist() == [c for c, state in enumerate(states) if state == "touch"]
    said = graph.remarks(target, there)
    assert len(said) == bool(told.size)
    assert all(f"singular at {told.size} of {len(states)} contacts ({told[0]}" in text for text in said)
    F, z = target.F(there.z), there.z
    basic = np.where(np.isneginf(target.lb), True, z > F)
    condition = np.linalg.cond(target.F.jacobian(z).toarray()[np.ix_(basic, basic)])
    assert (condition > 1e10) == bool(told.size)


def test_a_contact_without_friction_is_singular_nowhere():
    """It touches and moves along."""
    problem = FrictionContact(W=np.eye(3), q=[0.0, -1.0, 0.0], mu=[0.0])
    target, there = planted.both_ways(make("fc-micp"), problem, problem.zero_point())
    assert not graph.remarks(target, there)


def test_micp_lift_mends_what_a_singular_contact_leaves_open():
    """x_N = 0 leaves ‖x_T‖ ≤ √error: the lifted reaction is in its cone all the same."""
    problem = FrictionContact(W=np.eye(3), q=[1.0, 1.0, 0.0], mu=[0.5])
    almost = MiCPPoint(z=[0.0, 1e-6, 0.0, 0.0])
    np.testing.assert_allclose(clipped(np.array([[2.0, 3.0, 4.0], [-1.0, 1.0, 0.0]]), np.array([0.5, 0.5])),
                               [[2.0, 0.6, 0.8], [0.0, 0.0, 0.0]])  # fmt: skip
    edge = make("fc-micp")
    target = edge.step(problem)
    assert 1e-7 <= target.residuals(almost).error <= 1e-5
    assert problem.residuals(edge.lift(almost, target.provenance[-1].trace)).error <= 1e-11


def test_micp_start_is_near_a_solution(rng):
    problem, _ = planted.fc(rng, 8, 3, "positive definite")
    edge = make("fc-micp")
    target = edge.step(problem)
    start = edge.lift(MiCPPoint(target.start), target.provenance[-1].trace)
    assert problem.residuals(start).error < 1e-2, "projections come near where the problem is this easy"
    nothing = FrictionContact(W=np.zeros((3, 3)), q=[1.0, 0.5, 0.0], mu=[0.5])
    assert not edge.step(nothing).start[:3].any()


# ------------------------------------------------------------------------------- nonlinear dynamics


def pendulum(rng, nc=2, drag=1.0):
    """n = 4, F(v) = Mv + drag·(v³ + sin v) − f with a planted contact state."""
    n = 4
    M = planted.square(rng, n, "positive definite") + np.eye(n)
    H = rng.standard_normal((n, 3 * nc))
    mu = np.full(nc, 0.5)
    r, u = planted.contact_state(rng, nc, 3, mu)
    v = rng.standard_normal(n)
    f = M @ v + drag * (v**3 + np.sin(v)) - H @ r
    z = ca.SX.sym("v", n)
    F = Map.from_casadi(z, ca.mtimes(ca.DM(M), z) + drag * (z**3 + ca.sin(z)) - ca.DM(f))
    problem = NonlinearFrictionContact(F=F, H=H, w=u - H.T @ v, mu=mu)
    return problem, NFCPoint(v=v, r=r)


def test_a_linearization_where_the_answer_is_has_it(rng):
    problem, point = pendulum(rng)
    assert problem.residuals(point).error <= 1e-12
    edge = make("nfc-gfc", {"velocity": tuple(point.v.tolist())})
    planted.both_ways(edge, problem, point)
    assert edge.exactness(problem) is Kind.RELAXATION
    assert "8 nonlinear terms" in edge.reservation(problem)


def test_default_routes_linearize_only_what_is_linear(rng):
    problem, _ = pendulum(rng)
    assert make("nfc-gfc").exactness(problem) is Kind.RELAXATION
    assert not list(itertools.islice(graph.arrivals(problem, "gfc"), 1))
    linear, point = pendulum(rng, drag=0.0)
    arrival = graph.arrive(linear, "gfc")
    assert arrival.kind is Kind.EQUIVALENT
    planted.both_ways(make("nfc-gfc"), linear, point)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("at", ["free", "start"])
def test_a_linearization_errs_by_the_square_of_the_distance(rng, at):
    """Both places; two problems whose terms of second order are ten times apart in size."""
    errors = []
    for drag in (1e-3, 1e-4):
        problem, _ = pendulum(np.random.default_rng(8), drag=drag)
        target = make("nfc-gfc", {"at": at}).step(problem)
        local = graph.arrive(target, "fc").problem
        answer = solvers.get("nsgs").run(local, Budget(tolerance=1e-12)).point
        errors.append(problem.residuals(graph.lift(local, answer)).error)
    assert 3 < errors[0] / errors[1] < 40


def test_linearization_refuses_what_it_cannot_do(rng):
    problem, _ = pendulum(rng)
    with pytest.raises(NotApplicable, match="use free or start"):
        make("nfc-gfc", {"at": "end"}).apply(problem)
    with pytest.raises(NotApplicable, match="velocity has 1 numbers, v has 4"):
        make("nfc-gfc", {"velocity": (1.0,)}).apply(problem)
    v = ca.SX.sym("v", 1)
    broken = NonlinearFrictionContact(
        F=Map.from_casadi(v, ca.log(v)), H=np.eye(1, 2), w=np.zeros(2), mu=[0.5], dimension=2, start=[-1.0]
    )
    with pytest.raises(NotApplicable, match="not finite"):
        make("nfc-gfc").apply(broken)
