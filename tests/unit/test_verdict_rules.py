"""Rules of the verdict, each with a small problem by hand that is judged falsely without it."""

from __future__ import annotations

import numpy as np
import pytest
from planted_nonlinear import graph

from cpbench.formulations import (
    AVI,
    LCP,
    MLCP,
    NLP,
    QP,
    VI,
    AVIPoint,
    FCPoint,
    FrictionContact,
    GFCPoint,
    GlobalFrictionContact,
    LCPPoint,
    MiCP,
    MLCPPoint,
    QPPoint,
    Relay,
)
from cpbench.formulations.nonlinear import MiCPPoint
from cpbench.formulations.programs import NLPPoint
from cpbench.verification import judge


def _held(as_row: bool, z2: float, off: float) -> tuple[QP, QPPoint]:
    """min ½zᵀQz + 10⁶ z₁ − z₂ over z₁ ≥ 0, a bound or a row: z = (0, 1), and a force of 10⁶ + 0.1, here `off` it."""
    Q, z = np.array([[1.0, 0.1], [0.1, 1.0]]), np.array([0.0, z2])
    force = 1e6 + 0.1 * z2 + off
    if as_row:
        problem = QP.build(Q, [1e6, -1.0], A=np.array([[1.0, 0.0]]), b=[0.0])
        return problem, QPPoint(z=z, lam=np.array([force]), mu=np.zeros(0), nu=np.zeros(2))
    problem = QP.build(Q, [1e6, -1.0], lb=[0.0, -np.inf])
    return problem, QPPoint(z=z, lam=np.zeros(0), mu=np.zeros(0), nu=np.array([force, 0.0]))


@pytest.mark.parametrize("as_row", [False, True])
@pytest.mark.parametrize(("z2", "off", "solved"), [(1.0, 0.0, True), (1.0, 1e-4, True), (1.001, 0.0, False)])
def test_the_force_of_a_bound_hides_nothing_however_it_is_written(
    as_row: bool, z2: float, off: float, solved: bool
) -> None:
    """A gradient of 10⁻³ beside prices of 1 is wrong; 10⁻⁴ of a force of 10⁶ is not."""
    verdict = judge(*_held(as_row, z2, off), 1e-6)
    assert verdict.solved == solved, verdict.error


@pytest.mark.parametrize(("z", "solved"), [(2.0, True), (0.5, False)])
def test_a_program_without_an_objective_needs_no_multipliers(z: float, solved: bool) -> None:
    """Find z ≥ 1: multipliers of 10⁻⁹ are what is left of 0, and have no price to be compared with."""
    problem = QP.build(np.zeros((1, 1)), [0.0], A=np.ones((1, 1)), b=[1.0])
    point = QPPoint(z=np.array([z]), lam=np.array([1e-9]), mu=np.zeros(0), nu=np.zeros(1))
    assert judge(problem, point, 1e-6).solved == solved


def test_a_side_that_is_none_leaves_the_other_rows() -> None:
    """z = 0 meets z ≥ −10²⁰, and not z ≥ 1."""
    problem = QP.build(np.eye(1), [0.0], A=np.ones((2, 1)), b=[-1e20, 1.0])
    for z, lam in ((0.0, 0.0), (1.0, 1.0)):
        point = QPPoint(z=np.array([z]), lam=np.array([0.0, lam]), mu=np.zeros(0), nu=np.zeros(1))
        assert judge(problem, point, 1e-6).solved == (z == 1.0)


def test_an_unknown_beyond_a_finite_set_is_wrong_where_no_row_depends_on_it() -> None:
    """0 ≤ z ≤ 10⁻³ beside w = (0, z₂ − 10⁻³/2): z₁ = 1.5 · 10⁻³ is beyond by a third of itself, the largest."""
    problem = Relay(M=np.diag([0.0, 1.0]), q=np.array([0.0, -5e-4]), lb=np.zeros(2), ub=np.full(2, 1e-3))
    assert judge(problem, LCPPoint(z=np.array([1.5e-3, 5e-4])), 1e-6).error == pytest.approx(1.0 / 3.0)


@pytest.mark.parametrize(("off", "solved"), [(0.0, True), (1e-5, False)])
@pytest.mark.parametrize("gap", [1e-6, 1e-9, 1e-12])
def test_rounding_of_a_fast_contact_is_no_distance_from_its_cone(gap: float, off: float, solved: bool) -> None:
    """A body of mass 1 slides with speed 1 under a normal impulse of 1, μ = 0.3: v = (−w, 1, 0), r = (1, −0.3, 0).

    û = (0.3, 1, 0) is on the boundary of the dual cone. Its components are known to 10⁻¹⁵, a thousandth of w = 10⁻¹².
    """
    mu, r, v = 0.3, np.array([1.0, -0.3, 0.0]), np.array([-gap, 1.0, 0.0])
    problem = GlobalFrictionContact(M=np.eye(3), H=np.eye(3), f=v - r, w=np.array([gap, 0.0, 0.0]), mu=np.array([mu]))
    moved = np.array([0.0, off, 0.0])  # of both, so that the dynamics hold: friction that is too small
    verdict = judge(problem, GFCPoint(v=v + moved, r=r + moved), 1e-6)
    assert verdict.solved == solved, verdict.error


@pytest.mark.parametrize(("off", "solved"), [(0.0, True), (1e-9, True), (1e-3, False)])
@pytest.mark.parametrize("drift", [0.0, 1e-17, 1e-16, 1e-10, 1e-3])
def test_the_drift_of_a_joint_sets_no_size_beside_loads(drift: float, off: float, solved: bool) -> None:
    """A body of mass 1 at rest on the ground under an impulse of 1 is joined to one that moves at 1: u₂ = u₃, but for
    a drift as simulators leave it, of rounding or of an earlier step."""
    v = np.array([0.0, 0.0, 0.0, 1.0, 1.0 + drift])
    H, G = np.eye(5)[:, :3], np.array([[0.0], [0.0], [0.0], [1.0], [-1.0]])
    r, lam = np.array([1.0, 0.0, 0.0]), np.array([0.5])
    problem = GlobalFrictionContact(
        M=np.eye(5), H=H, G=G, f=v - H @ r - G @ lam, b=np.array([drift]), mu=np.array([0.3])
    )
    moved = off * np.array([0.0, 0.0, 0.0, 1.0, -1.0])
    verdict = judge(problem, GFCPoint(v=v + moved, r=r, lam=lam), 1e-6)
    assert verdict.solved == solved, (verdict.error, verdict.flags)


@pytest.mark.parametrize(("off", "solved"), [(0.0, True), (1e-9, True), (1e-3, False)])
@pytest.mark.parametrize("side", [0.0, 1e-17, 1e-16])
def test_sides_that_are_rounding_of_their_rows_set_no_size(side: float, off: float, solved: bool) -> None:
    """min ½(z₁² + z₂²) − 2z₁ over z₁ − z₂ = 0, the side as a file has it: z = (1, 1), μ = −1."""
    z, none, mu = np.array([1.0 + off, 1.0 - off]), np.zeros(0), np.array([-1.0])
    P = QP.build(np.eye(2), [-2.0, 0.0], C=np.array([[1.0, -1.0]]), d=[side])
    inequality = AVI(M=P.Q, q=P.p, A=P.A, b=P.b, C=P.C, d=P.d, lb=P.lb, ub=P.ub)
    for problem, point in (
        (P, QPPoint(z=z, lam=none, mu=mu, nu=np.zeros(2))),
        (inequality, AVIPoint(z=z, lam=none, mu=mu)),
    ):
        verdict = judge(problem, point, 1e-6)
        assert verdict.solved == solved, (problem.node, verdict.error, verdict.flags)


def test_sides_count_where_only_the_answer_makes_them_rounding() -> None:
    """min ½(z₁ − z₂ − 1)² over z₁ − z₂ = 1: of z = (2⁶⁰, 2⁶⁰) rounding hides the side, and the answer is none."""
    Q, rows = np.array([[1.0, -1.0], [-1.0, 1.0]]), {"C": np.array([[1.0, -1.0]]), "d": [1.0]}
    point = QPPoint(z=np.full(2, 2.0**60), lam=np.zeros(0), mu=np.array([-1.0]), nu=np.zeros(2))
    assert not judge(QP.build(Q, [-1.0, 1.0], **rows), point, 1e-6).solved


@pytest.mark.parametrize("price", [0.0, 1e-17])
def test_prices_that_are_rounding_of_what_sides_make_are_none(price: float) -> None:
    """min ½z₁² + price z₁ over z₁ + z₂ = 1: of z = (0, 1), μ = 0 all terms of the gradient are 0, here 10⁻¹⁴."""
    problem = QP.build(np.diag([1.0, 0.0]), [price, 0.0], C=np.ones((1, 2)), d=[1.0])
    point = QPPoint(z=np.array([1e-14, 1.0 - 1e-14]), lam=np.zeros(0), mu=np.array([3e-14]), nu=np.zeros(2))
    verdict = judge(problem, point, 1e-6)
    assert verdict.solved, verdict.error


@pytest.mark.parametrize(("share", "solved"), [(1.0, True), (1.0 + 1e-9, True), (0.9, False), (0.0, False)])
def test_equalities_of_a_mixed_problem_are_not_hidden_by_vandermonde_rows(share: float, solved: bool) -> None:
    """min ½‖u‖² + pᵀu over Σ tᵢʲ uⱼ ≥ bᵢ as an MLCP, planted, with `share` of the multipliers v.

    Powers of small t bring the units of rows far apart: the gradient was 10⁻⁷ of the size of a constraint.
    """
    V = np.vander(np.linspace(1e-3, 1.0, 300), 16, increasing=True)
    u, v, slack = np.cos(np.arange(16.0)), np.zeros(300), np.full(300, 0.5)
    v[[100, 299]], slack[[100, 299]] = [1.0, 0.2], 0.0
    none = np.zeros((300, 300))
    problem = MLCP(A=np.eye(16), B=none, C=-V.T, D=V, a=V.T @ v - u, b=slack - V @ u)
    verdict = judge(problem, MLCPPoint(u=u, v=share * v), 1e-6)
    assert verdict.solved == solved, verdict.error


@pytest.mark.parametrize(("coupling", "r", "solved"), [(0.0, 1e-16, True), (1e-3, 1e-16, True), (0.0, 1e-3, False)])
def test_free_velocities_that_are_rounding_of_others_set_no_size(coupling: float, r: float, solved: bool) -> None:
    """A contact opens at 1, one is pressed by 1, one is at rest with 10⁻¹⁶ for 0: a reaction beside its cone of that
    size is rounding, too, however the contact at rest is coupled to that which opens."""
    W = np.eye(6)
    W[0, 4] = W[4, 0] = coupling
    q = np.array([1.0, 0.0, -1.0, 0.0, 1e-16, -1e-16])
    problem = FrictionContact(W=W, q=q, mu=np.full(3, 0.5), dimension=2)
    verdict = judge(problem, FCPoint(r=np.array([0.0, 0.0, 1.0, 0.0, 0.0, r])), 1e-6)
    assert verdict.solved == solved, (verdict.error, verdict.flags)


@pytest.mark.parametrize("unit", [1.0, 1e-8, 1e8])
def test_an_unknown_at_a_bound_sizes_a_nonlinear_row_without_a_constant(unit: float) -> None:
    """z₁ ≥ 1 beside z₁² + z₂² and z₂ ≥ 0 beside z₂² − z₁²: z = (1, 1), in any unit of the rows.

    z₂ = 2 misses by 3 of terms of 10."""
    F = graph(2, lambda z: np.array([unit * (z[0] ** 2 + z[1] ** 2), unit * (z[1] ** 2 - z[0] ** 2)], dtype=object))
    problem = MiCP(F=F, lb=[1.0, 0.0], ub=np.full(2, np.inf), start=np.ones(2))
    assert judge(problem, MiCPPoint(z=np.ones(2)), 1e-6).solved
    assert judge(problem, MiCPPoint(z=np.array([1.0, 2.0])), 1e-6).error == pytest.approx(0.3)


def test_a_derivative_that_vanishes_at_the_answer_says_nothing_of_units() -> None:
    """Hock and Schittkowski's problem 39, min −z₁ over z₂ = z₁³ + z₃², z₁² = z₂ + z₄²: z = (1, 1, 0, 0), μ = (1, 1).
    z₃ is off by 10⁻⁷, beside −2 z₃ μ₁."""
    rows = graph(4, lambda z: np.array([z[1] - z[0] ** 3 - z[2] ** 2, z[0] ** 2 - z[1] - z[3] ** 2], dtype=object))
    problem = NLP(f=graph(4, lambda z: -z[0]), h=rows, start=np.full(4, 2.0))
    point = NLPPoint(z=np.array([1.0, 1.0, 1e-7, 0.0]), lam=np.zeros(0), mu=np.ones(2), nu=np.zeros(4))
    assert judge(problem, point, 1e-6).error <= 1e-7


@pytest.mark.parametrize(("off", "solved"), [(0.0, True), (1e-4, False)])
def test_forces_of_curved_rows_have_a_size_where_constants_are_small(off: float, solved: bool) -> None:
    """F(z) = (10⁻⁹ − z₁, −z₂) over |z| ≤ 1, z = (0.6, 0.8) with the multiplier ½: right to 10⁻⁹."""
    F = graph(2, lambda z: np.array([1e-9 - z[0], -z[1]], dtype=object))
    problem = VI(F=F, g=graph(2, lambda z: 1.0 - z[0] ** 2 - z[1] ** 2))
    point = problem.point_from_vector(np.array([0.6 + off, 0.8, 0.5]))
    assert judge(problem, point, 1e-6).solved == solved


@pytest.mark.parametrize("n", [20, 250])
def test_entries_that_decay_to_nothing_hide_no_row(n: int) -> None:
    """w = Mz + q, M the inverse of a band matrix, whose entries fall to 10⁻⁹⁶: one unknown is off by half of it."""
    band = 4.0 * np.eye(n) - sum(np.eye(n, k=k) + 0.2 * np.eye(n, k=2 * k) for k in (-1, 1))
    M, z = np.abs(np.linalg.inv(band)), 1.0 + np.arange(n) / n
    problem, off = LCP(M=M, q=-M @ z), np.where(np.arange(n) == n // 2, 1.5, 1.0)
    assert judge(problem, LCPPoint(z=z), 1e-6).solved
    assert judge(problem, LCPPoint(z=z * off), 1e-6).error > 1e-3


@pytest.mark.parametrize(
    ("z", "solved"), [(1.0, True), (1.0 + 1e-8, True), (1.0 + 1e-3, False), (2.0, False), (-1e3, False)]
)
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_row_with_a_large_constant_leaves_its_unknown_within_its_bounds(z: float, solved: bool, unit: float) -> None:
    """F(z) = (z₁² − 4, z₂ − 10⁹) over 0 ≤ z₂ ≤ 1, in three units of z₂: whatever is beyond 1 changes F by nothing."""
    F = graph(2, lambda x: np.array([x[0] ** 2 - 4.0, unit * x[1] - 1e9], dtype=object))
    problem = MiCP(F=F, lb=np.array([-np.inf, 0.0]), ub=np.array([np.inf, 1.0 / unit]))
    assert judge(problem, MiCPPoint(z=np.array([2.0, z / unit])), 1e-6).solved == solved


def _to_rest(multiplier: float) -> tuple[QP, QPPoint]:
    """Return min ½z₁² with z₁ + z₂ = 1, z₂ ≤ 2 and z₂ ≥ 0 as a row, and the solution (0, 1) but for its multiplier.

    It is balanced by the equality's and by 1e-10 in z₁; its product with the slack 1 of the row is a gap.
    """
    problem = QP.build(
        np.diag([1.0, 0.0]), np.zeros(2), A=np.array([[0.0, 1.0]]), b=np.zeros(1),
        C=np.ones((1, 2)), d=np.ones(1), ub=np.array([np.inf, 2.0]),
    )  # fmt: skip
    z = np.array([-multiplier, 1.0 + multiplier])
    mu = np.array([-multiplier])
    return problem, QPPoint(z=z, lam=-mu, mu=mu, nu=np.zeros(2))


@pytest.mark.parametrize(("multiplier", "solved"), [(1e-8, True), (1e-5, False)])
def test_an_objective_near_0_is_optimal_whatever_multipliers_say(multiplier: float, solved: bool) -> None:
    """½z₁² = ½ 10⁻¹⁶ is within 10⁻¹² of what z₁ = 1 would be; the gap alone, 10⁻⁸, is not."""
    problem, point = _to_rest(multiplier)
    assert judge(problem, point, 1e-6).solved == solved


def test_an_objective_of_0_says_nothing_of_a_program_that_is_not_convex() -> None:
    """½(z₁² − z₂²) is 0 in (1, 1), where z₁ could fall and z₂ could rise."""
    none = np.zeros(0)
    problem = QP.build(np.diag([1.0, -1.0]), np.zeros(2), lb=np.zeros(2), ub=np.full(2, 2.0))
    point = QPPoint(z=np.ones(2), lam=none, mu=none, nu=np.array([1.0, -1.0]))
    assert judge(problem, point, 1e-6).error > 0.1


def test_rounding_of_an_objective_near_0_is_none(rng: np.random.Generator) -> None:
    """Mz = 0 but for rounding, and only z = 0 has a price: the root of rounding is 1e-8."""
    z, M = rng.uniform(0.5, 2.0, 12), rng.standard_normal((12, 12))
    M -= np.outer(M @ z, z) / (z @ z)
    problem = LCP(M=np.block([[M, np.zeros((12, 1))], [np.full((1, 12), 0.2), 0.0]]), q=12 * [0.0] + [1.0])
    assert judge(problem, LCPPoint(z=np.append(z, 0.0)), 1e-8).error < 1e-12
    assert not judge(problem, LCPPoint(z=np.append(1.001 * z[:1], np.append(z[1:], 0.0))), 1e-8).solved


@pytest.mark.parametrize("price", [0.0, -1.0])
@pytest.mark.parametrize(("multiplier", "solved"), [(0.0, True), (1.0, False)])
def test_a_row_without_entries_is_paid_for_in_the_objective(price: float, multiplier: float, solved: bool) -> None:
    """0 ≥ −1 beside min ½z² + price z with z ≥ 1: λ = 1 costs 1, which is twice the objective or the same."""
    problem = QP.build(np.eye(1), np.array([price]), A=np.zeros((1, 1)), b=np.array([-1.0]), lb=np.ones(1))
    point = QPPoint(z=np.ones(1), lam=np.array([multiplier]), mu=np.zeros(0), nu=np.array([1.0 + price]))
    assert judge(problem, point, 1e-6).solved == solved
