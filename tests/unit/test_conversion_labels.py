"""What edges promise, held against problems whose solutions are all known: none may be lost under `equivalent`."""

from __future__ import annotations

import dataclasses
import itertools
from fractions import Fraction

import numpy as np
import planted_contact
import pytest
from rational import exact, solved

from cpbench import graph, verification
from cpbench.conversions.base import make
from cpbench.conversions.elimination import LOSSLESS
from cpbench.errors import NotApplicable
from cpbench.formulations import (
    AVI,
    LCP,
    MLCP,
    QP,
    SOCLCP,
    AVIPoint,
    ConeQP,
    ConeQPPoint,
    FCMPoint,
    FrictionContact,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    Kind,
    MixedFrictionContact,
    SOCLCPPoint,
)
from cpbench.formulations.conic import cone_fields
from cpbench.foundation.cones import Cone, ProductCone

EPS = float(np.finfo(float).eps)
CLOSE = 1e-9


def solves(problem, point) -> bool:
    return verification.status(verification.judge(problem, point, CLOSE), "solved") in ("solved", "stationary")


def box_solutions(M, q, lb, ub) -> list[np.ndarray]:
    """All z with −(Mz + q) normal to the box at z, by enumeration of the sides; M_FF must be regular everywhere."""
    n, found = q.size, []
    for sides in itertools.product((0, 1, 2), repeat=n):
        side = np.array(sides)
        z = np.where(side == 0, lb, np.where(side == 1, ub, 0.0))
        F = np.flatnonzero(side == 2)
        if not np.isfinite(z).all():
            continue
        z[F] = np.linalg.solve(M[np.ix_(F, F)], -(q + M @ np.where(side == 2, 0.0, z))[F]) if F.size else z[F]
        w = M @ z + q
        signs = np.where(side == 0, w >= 0, np.where(side == 1, w <= 0, True))
        if signs.all() and (z >= lb).all() and (z <= ub).all():
            found.append(z)
    return found


# ------------------------------------------------------------------------------------------ units


@pytest.mark.parametrize("power", [0, 30, -30])
def test_a_nonconvex_program_is_none_in_other_units(power: int) -> None:
    """diag(1e9, -1): the saddle is no minimum, the LCP's QP is unbounded below, and the labels say so in all units."""
    D = np.diag(np.ldexp(1.0, np.array([power, -power])))
    M = D @ np.diag([1e9, -1.0]) @ D
    saddle = QP.build(M, np.zeros(2), lb=-np.ones(2), ub=np.ones(2))
    for edge in ("qp-mlcp", "qp-avi"):
        assert make(edge).exactness(saddle) == Kind.NECESSARY
    target = make("qp-avi").step(saddle)
    lifted = graph.lift(target, AVIPoint(z=np.zeros(2)))
    verdict = verification.judge(saddle, lifted, 1e-6)
    assert verification.status(verdict, "solved") == "stationary"
    problem = LCP(M=M, q=D @ np.array([-1e9, 1.0]))  # solutions D⁻¹(1, 0) and D⁻¹(1, 1)
    assert "not positive semidefinite" in str(make("lcp-qp").obstacle(problem))
    assert make("lcp-qp-nonsymmetric").exactness(problem) == Kind.NECESSARY


# ------------------------------------------------------------------------ indefinite M as a program


@pytest.mark.parametrize("seed", range(30))
def test_minima_of_an_indefinite_program_are_some_of_the_solutions(seed: int) -> None:
    """avi-qp: minima lift to solutions, none spurious; stationary points are the solutions; minima may be fewer."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    A = rng.standard_normal((n, n))
    M, q = A + A.T, rng.standard_normal(n)
    M[0, 0] = -1.0
    problem = AVI(M=M, q=q, lb=-np.ones(n), ub=np.ones(n))
    edge = make("avi-qp")
    assert edge.exactness(problem) == Kind.ONE_WAY
    assert "least eigenvalue at unit diagonal -" in edge.reservation(problem)
    target = edge.step(problem)
    found = box_solutions(M, q, problem.lb, problem.ub)
    least = min(target.objective(z) for z in found)  # over a compact box there is a minimum, and it is among these
    for z in found:
        there = graph.push(target, AVIPoint(z=z))
        assert solves(problem, AVIPoint(z=z))
        assert verification.status(verification.judge(target, there, CLOSE), "solved") == "stationary"
        if target.objective(z) == least:
            assert solves(problem, graph.lift(target, there))


def test_solutions_that_no_minimum_is() -> None:
    one = AVI(M=np.array([[-1.0]]), q=np.zeros(1), lb=-np.ones(1), ub=np.ones(1))
    target = make("avi-qp").step(one)
    assert solves(one, AVIPoint(z=np.zeros(1)))
    assert target.objective(np.zeros(1)) > target.objective(np.ones(1))
    ray = AVI(M=np.array([[-1.0]]), q=np.ones(1), lb=np.zeros(1), ub=np.full(1, np.inf))
    unbounded = make("avi-qp").step(ray)
    for z in (0.0, 1.0):
        assert solves(ray, AVIPoint(z=np.array([z])))
    assert unbounded.objective(np.array([1e6])) < -1e11
    K = ProductCone.of((Cone.NONNEGATIVE, 1, 1))
    cone = SOCLCP(M=np.array([[-1.0]]), q=np.ones(1), **cone_fields(K))
    assert make("soclcp-coneqp").exactness(cone) == Kind.ONE_WAY
    program = make("soclcp-coneqp").step(cone)
    for x in (0.0, 1.0):
        assert solves(cone, SOCLCPPoint(x=np.array([x])))
        assert solves(cone, graph.lift(program, graph.push(program, SOCLCPPoint(x=np.array([x])))))
    assert program.objective(np.array([1e6])) < -1e11
    convex = SOCLCP(M=np.eye(1), q=np.ones(1), **cone_fields(K))
    assert make("soclcp-coneqp").exactness(convex) == Kind.EQUIVALENT


# ------------------------------------------------------------------------- multipliers over cones


def grazing(lift: float = 0.0, curvature: float = 0.0) -> ConeQP:
    """min y subject to (x + lift, x, y) in a second-order cone: with lift = 0 that is y = 0 ≤ x."""
    A = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    Q, b = np.diag([0.0, curvature]), np.array([lift, 0.0, 0.0])
    return ConeQP.over(Q, np.array([0.0, 1.0]), ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0)), A, b)


def test_a_minimum_over_a_cone_may_have_no_multiplier() -> None:
    """Stationarity asks for y = (t, −t, 1), which no t brings into the dual cone, t ≥ √(t² + 1).

    It is 1/(2√2 t) away from it, and √2 t large: the error is 1/(4t²), which falls and does not vanish.
    """
    problem, edge = grazing(), make("coneqp-soclcp")
    assert edge.exactness(problem) == Kind.ONE_WAY
    assert "no constraint qualification is known" in edge.reservation(problem)
    target = edge.step(problem)
    for t in np.logspace(-3, 4, 40):
        y = np.array([t, -t, 1.0])
        assert (problem.A.T @ y == problem.p).all()
        assert np.linalg.norm(y - problem.K.project_dual(y)) > 1e-7
        answer = ConeQPPoint(x=np.array([1.0, 0.0]), y=y)  # x is a minimum
        verdict = verification.judge(problem, answer, 1e-5)
        if t > 10.0:
            assert verdict.error == pytest.approx(0.25 / t**2, rel=0.01)
        assert verdict.within == (t > np.sqrt(0.25e5))
        assert not solves(problem, answer)
        assert not solves(target, graph.push(target, answer))
    refused = grazing(curvature=-1.0)
    with pytest.raises(NotApplicable, match="no constraint qualification is known"):
        edge.step(refused)


def test_a_qualification_makes_the_conditions_equivalent() -> None:
    edge = make("coneqp-soclcp")
    slater = grazing(lift=1.0)  # x = 0 has (1, 0, 0) inside the cone
    assert edge.exactness(slater) == Kind.EQUIVALENT
    assert edge.exactness(grazing(lift=1.0, curvature=-1.0)) == Kind.NECESSARY
    # (x + 1, x, y): the minimum of y + εx on y² ≤ 2x + 1 has the multiplier that solves two equations
    eps = 0.5
    sloped = dataclasses.replace(slater, p=np.array([eps, 1.0]))
    y = -1.0 / eps
    x = (y * y - 1.0) / 2.0
    scale = 1.0 / -y  # of (s_N, −s_T), which spans the normal cone: its third entry has to be 1
    multiplier = scale * np.array([x + 1.0, -x, -y])
    answer = ConeQPPoint(x=np.array([x, y]), y=multiplier)
    assert solves(sloped, answer)
    target = edge.step(sloped)
    there = graph.push(target, answer)
    assert solves(target, there)
    assert solves(sloped, graph.lift(target, there))
    # polyhedral factors need none: the same set with two rows a contact, and a cone of A = I, b = 0
    flat = ProductCone.of((Cone.SECOND_ORDER, 1, 2, 1.0), (Cone.ZERO, 1, 1))
    thin = ConeQP.over(np.zeros((2, 2)), np.array([0.0, 1.0]), flat, np.array([[1.0, 0], [1, 0], [0, 1.0]]))
    assert edge.exactness(thin) == Kind.EQUIVALENT
    own = ConeQP.over(np.eye(3), np.ones(3), ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0)))
    assert edge.exactness(own) == Kind.EQUIVALENT
    # no x = 0, but some x inside: (x − 5, y, 0) beside a row x ≥ 0
    mixed = ProductCone.of((Cone.NONNEGATIVE, 1, 1), (Cone.SECOND_ORDER, 1, 3, 1.0))
    A = np.array([[1.0, 0], [1, 0], [0, 1], [0, 0]])
    away = ConeQP.over(np.eye(2), np.ones(2), mixed, A, np.array([0.0, -5.0, 0.0, 0.0]))
    assert edge.exactness(away) == Kind.EQUIVALENT


# ------------------------------------------------------------------------------------ eliminations


def test_constraints_whose_reactions_move_contacts_without_a_say_of_r() -> None:
    """R = [[0, 1], [0, 0]]: λ₁ is free, moves the contact, and only λ₁ = 0 is found from r."""
    problem = MixedFrictionContact(
        W=np.eye(3),
        V=np.array([[1.0, 0], [0, 0], [0, 0]]),
        R=np.array([[0.0, 1.0], [0.0, 0.0]]),
        q=np.array([-1.0, 0, 0]),
        s=np.zeros(2),
        mu=np.array([0.5]),
        dimension=3,
    )
    edge = make("fcm-fc")
    assert edge.obstacle(problem) is None
    assert edge.exactness(problem) == Kind.ONE_WAY
    assert "null space" in edge.reservation(problem)
    target = edge.step(problem)
    for lam in (0.0, 0.5, 2.0):
        normal = max(0.0, 1.0 - lam)
        answer = FCMPoint(r=np.array([normal, 0, 0]), lam=np.array([lam, -normal]))
        assert solves(problem, answer)
        assert solves(target, graph.push(target, answer)) == (lam == 0.0)
    symmetric = dataclasses.replace(problem, R=np.diag([1.0, 0.0]))  # V N = 0
    assert edge.exactness(symmetric) == Kind.EQUIVALENT


def exact_schur(A, c, d) -> Fraction:
    """dᵀA⁻¹c of the doubles as they are."""
    x = solved(exact(A), [Fraction(float(y)) for y in c])
    assert x is not None
    return sum((Fraction(float(y)) * z for y, z in zip(d, x, strict=True)), Fraction(0))


def eliminated(size: float, seed: int) -> tuple[MLCP, Fraction]:
    """An MLCP with three free unknowns whose A is `size` away from rank 1, and the exact dᵀA⁻¹c."""
    rng = np.random.default_rng(seed)
    U = rng.standard_normal((3, 3))
    A = np.outer(U[0], U[1]) + size * U
    C, D = rng.standard_normal((3, 1)), rng.standard_normal((1, 3))
    return MLCP(A=A, B=np.zeros((1, 1)), C=C, D=D, a=np.zeros(3), b=-np.ones(1)), exact_schur(A, C[:, 0], D[0])


@pytest.mark.parametrize("seed", range(8))
def test_schur_complements_are_equivalent_while_their_digits_last(seed: int) -> None:
    edge = make("mlcp-lcp-schur")
    for size in (1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11):
        problem, exact = eliminated(size, seed)
        if edge.obstacle(problem) is not None:
            continue
        rcond = problem.factorization.rcond
        kept = rcond * LOSSLESS >= EPS
        assert edge.exactness(problem) == (Kind.EQUIVALENT if kept else Kind.ONE_WAY)
        if kept:
            computed = -Fraction(float(make("mlcp-lcp-schur").step(problem).M[0, 0]))
            terms = np.abs(problem.D) @ np.abs(np.linalg.inv(problem.A)) @ np.abs(problem.C)
            assert abs(float(computed - exact)) <= LOSSLESS * terms[0, 0]
        else:
            assert f"condition number of the equality block A is {1 / rcond:.1e}" in edge.reservation(problem)


def test_a_rounded_schur_complement_may_have_lost_the_solution() -> None:
    """Solvable exactly, v = 1/(B − dᵀA⁻¹c); the computed target 0 ≤ v ⟂ Mv − 1 ≥ 0 has M ≤ 0 and no solution."""
    edge, lost = make("mlcp-lcp-schur"), 0
    for size, seed in itertools.product((1e-9, 1e-10, 1e-11), range(40)):
        plain, exact = eliminated(size, seed)
        if edge.obstacle(plain) is not None:
            continue
        computed = -float(edge.step(plain).M[0, 0])
        if Fraction(computed) <= exact:
            continue
        problem = dataclasses.replace(plain, B=np.array([[(computed + float(exact)) / 2]]))
        if Fraction(float(problem.B[0, 0])) > exact and edge.step(problem).M[0, 0] <= 0:
            lost += 1
            assert edge.exactness(problem) == Kind.ONE_WAY
    assert lost > 10


def with_eliminated(node: str, A: np.ndarray):
    """A problem of whose unknowns two are eliminated by the matrix A."""
    H, one = np.ones((2, 3)), np.ones(2)
    match node:
        case "gfc":
            return GlobalFrictionContact(M=A, H=H, f=one, w=np.ones(3), mu=[0.5])
        case "grfc":
            return GlobalRollingFrictionContact(M=A, H=np.ones((2, 5)), f=one, w=np.ones(5), mu=[0.5], mu_r=[0.1])
        case "mlcp":
            return MLCP(A=A, B=np.eye(1), C=np.ones((2, 1)), D=np.ones((1, 2)), a=one, b=np.ones(1))
        case "qp":
            return QP.build(A, one, lb=np.zeros(2))
        case _:
            return MixedFrictionContact(W=np.eye(3), V=H.T, R=A, q=np.ones(3), s=one, mu=[0.5], dimension=3)


@pytest.mark.parametrize("name", ["gfc-fc", "gfc-fcm", "grfc-rfc", "mlcp-lcp-schur", "qp-qp-dual", "fcm-fc"])
@pytest.mark.parametrize(
    ("apart", "expected"), [(2.0**-31, Kind.ONE_WAY), (2.0**-9, Kind.EQUIVALENT), (0.5, Kind.EQUIVALENT)]
)
def test_ill_conditioned_eliminations_say_their_number(name: str, apart: float, expected: Kind) -> None:
    """[[1, 1], [1, 1 + δ]] has the condition number (2 + δ)²/δ: 9e9, 2e3 and 12; no scaling takes it out."""
    A, edge = np.array([[1.0, 1.0], [1.0, 1.0 + apart]]), make(name)
    problem = with_eliminated(edge.source, A)
    assert edge.exactness(problem) == expected
    assert edge.step(problem).provenance[-1].kind == expected
    if expected == Kind.ONE_WAY:
        assert f"is {(2 + apart) ** 2 / apart:.1e}, so that rounding" in edge.reservation(problem)
    rescaled = with_eliminated(edge.source, A * np.outer([2.0**40, 1], [2.0**40, 1]))
    assert edge.exactness(rescaled) == expected


# ------------------------------------------------------------------------ massless unknowns, slip


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("name", ["gfc-fc", "grfc-rfc"])
@pytest.mark.parametrize("seed", range(5))
def test_a_singular_mass_matrix_that_joints_make_up_for(name: str, symmetric: bool, seed: int) -> None:
    """M a = 0 with Gᵀa ≠ 0: K is regular, and velocities and joint reactions follow from r."""
    rng = np.random.default_rng(seed)
    make_planted = planted_contact.gfc if name == "gfc-fc" else planted_contact.grfc
    problem, point = make_planted(rng, 3, 2, 2, 3)
    a = problem.G @ np.ones(2)
    M = problem.M - np.outer(problem.M @ a, problem.M @ a) / (a @ problem.M @ a)
    if not symmetric:
        skew = np.triu(rng.standard_normal(M.shape), 1)
        P = np.eye(a.size) - np.outer(a, a) / (a @ a)
        M = M + P @ (skew - skew.T) @ P
    f = M @ point.v - problem.H @ point.r - problem.G @ point.lam
    massless = dataclasses.replace(problem, M=M, f=f)
    assert massless.factorization.singular
    assert not massless.saddle.singular
    assert massless.residuals(point).error <= 1e-12
    edge = make(name)
    assert edge.exactness(massless) == Kind.EQUIVALENT
    target = edge.step(massless)
    there = graph.push(target, point)
    assert target.residuals(there).error <= 1e-10
    back = graph.lift(target, there)
    np.testing.assert_allclose(back.v, point.v, atol=1e-9)
    np.testing.assert_allclose(back.lam, point.lam, atol=1e-9)
    assert massless.residuals(back).error <= 1e-10
    # ρ_c is that of the local problem, whatever is eliminated
    blocks = np.array([target.W[3 * c : 3 * c + 3, 3 * c : 3 * c + 3].diagonal() for c in range(problem.nc)])
    np.testing.assert_allclose(massless.mobility, blocks, rtol=1e-9, atol=1e-12)


def test_a_massless_unknown_without_a_joint_is_refused() -> None:
    problem, _ = planted_contact.gfc(np.random.default_rng(0), 3, 2, 0, 3)
    M = problem.M.copy()
    M[0, :] = M[:, 0] = 0.0
    with pytest.raises(NotApplicable, match=r"the mass matrix M .* is numerically singular"):
        make("gfc-fc").step(dataclasses.replace(problem, M=M))
    joint = np.zeros((M.shape[0], 1))
    joint[1] = 1.0  # not on what has no mass
    jointed = dataclasses.replace(problem, M=M, G=joint, b=np.zeros(1))
    with pytest.raises(NotApplicable, match=r"bodies and joints .* no contact problem in r alone exists"):
        make("gfc-fc").step(jointed)


def test_the_relaxation_is_not_exact_at_a_contact_that_opens_and_moves_along() -> None:
    """W = I, q = (0.1, 1, 0), μ = 0.5: the law has r = 0, the relaxation P_K(−q), of normal part (μ − 0.1)/(1 + μ²)."""
    problem = FrictionContact(W=np.eye(3), q=np.array([0.1, 1.0, 0.0]), mu=np.array([0.5]), dimension=3)
    law = problem.zero_point()
    assert solves(problem, law)
    normal = (0.5 - 0.1) / 1.25
    relaxed = np.array([normal, -0.5 * normal, 0.0])
    for name in ("fc-coneqp", "fc-soclcp"):
        target = make(name).step(problem)
        there = graph.push(target, dataclasses.replace(law, r=relaxed))
        assert solves(target, there)
        assert not solves(target, graph.push(target, law))
        assert not solves(problem, graph.lift(target, there))
        given = make(name, {"slip": (0.5,)}).step(problem)  # μ‖u_T‖ of the solution
        assert solves(given, graph.push(given, law))
