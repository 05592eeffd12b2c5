"""The judge against code that is not its own: 80 digits, and problems in other units."""

from __future__ import annotations

from typing import Any

import casadi as ca
import mpmath
import numpy as np
import pytest
import scipy.sparse as sp
from planted_nonlinear import graph

from cpbench.conversions.base import make
from cpbench.formulations import (
    AVI,
    LCP,
    QP,
    AVIPoint,
    FCPoint,
    FrictionContact,
    GFCPoint,
    GlobalFrictionContact,
    LCPPoint,
    QPPoint,
    Relay,
)
from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.formulations.expressions import Map
from cpbench.formulations.nonlinear import Equation, EquationPoint
from cpbench.formulations.programs import NLP, NLPPoint
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.generators import generators
from cpbench.testing.cases import cases
from cpbench.verification import judge
from cpbench.verification.equilibration import equilibrate, equilibrate_apart
from cpbench.verification.nonlinear import row_errors
from cpbench.verification.projections import project
from cpbench.verification.rows import ROWS
from cpbench_problems.generators.equations import powell_singular


def test_the_error_of_an_lcp_holds_in_80_digits(rng: np.random.Generator) -> None:
    """The formula of `nonlinear.row_errors`, written again: every row has a constant, so that all are definite."""
    for seed in range(20):
        M, z = rng.standard_normal((5, 5)), rng.standard_normal(5) * 10.0 ** rng.integers(-8, 9, 5)
        q = rng.standard_normal(5) * 10.0 ** rng.integers(-8, 9, 5)
        with mpmath.workdps(80):
            A = [[mpmath.mpf(float(v)) for v in row] for row in M]
            x, c = [mpmath.mpf(float(v)) for v in z], [mpmath.mpf(float(v)) for v in q]
            near = [max(v, 0) for v in x]
            s = [sum(abs(A[i][j]) * max(abs(x[j]), near[j]) for j in range(5)) + abs(c[i]) for i in range(5)]
            w = [sum(A[i][j] * x[j] for j in range(5)) + c[i] for i in range(5)]
            E = [max(abs(A[i][j]) / s[i] for i in range(5)) for j in range(5)]
            expected = max(abs(min(E[i] * x[i], w[i] / s[i])) for i in range(5))
        problem = LCP(M=M, q=q)
        error = row_errors(ROWS["lcp"](problem, LCPPoint(z=z))).error
        assert error == pytest.approx(float(expected), rel=1e-9, abs=1e-14), seed


def _wide(rng: np.random.Generator, n: int) -> np.ndarray:
    """Draw a sparse matrix with a full diagonal and entries over sixteen decades."""
    A = sp.random_array((n, n), density=0.2, rng=rng).toarray() + np.diag(rng.uniform(0.5, 2.0, n))
    return A * 10.0 ** rng.uniform(-8, 8, A.shape)


def test_equilibrated_rows_and_columns_have_the_mean_one(rng: np.random.Generator) -> None:
    far = np.array([[1e150, 1e-150], [1e-150, 1e150]])  # of which no first guess is near
    for A in (far, *(_wide(rng, n) for n in (1, 2, 30, 200))):
        D, C = equilibrate_apart(sp.csr_array(A))
        scaled = D[:, None] * A * C
        for axis in (0, 1):
            off = scaled.sum(axis) - (A > 0).sum(axis)
            assert np.sqrt((off**2 / (A > 0).sum(axis)).sum() / (A > 0).sum()) < 1e-3  # ENOUGH, twice over


def test_equilibration_follows_units(rng: np.random.Generator) -> None:
    K = _wide(rng, 30) ** 0.1
    K, u = K + K.T, 2.0 ** rng.integers(-60, 61, 30)
    one, other = equilibrate(sp.csr_array(K)), equilibrate(sp.csr_array(u[:, None] * K * u))
    assert np.abs(np.log2(one / (other * u))).max() < 0.01


def test_rounding_does_not_change_the_equilibration(rng: np.random.Generator) -> None:
    """Half of a tridiagonal matrix has rounding at all its other places."""
    n = 40
    A = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    rounded = A + 1e-17 * rng.standard_normal((n, n)) * (np.arange(n) < n // 2)[:, None]
    K, noisy = np.abs(A), np.abs(rounded)
    D, with_rounding = equilibrate(sp.csr_array(K)), equilibrate(sp.csr_array(noisy + noisy.T))
    spread = np.log2(with_rounding / D)
    assert spread.max() - spread.min() < 1.5


def test_blocks_are_balanced_by_the_largest_entries_that_join_them() -> None:
    """By hand: blocks of 1 with a and b between them have √(ab) both ways once scaled, where the means agree."""
    a, b = 1e-6, 1e-12
    A = np.array([[1.0, 1.0, a, 0], [1.0, 1.0, 0, 0], [b, 0, 1.0, 1.0], [0, 0, 1.0, 1.0]])
    D, C = equilibrate_apart(sp.csr_array(A))
    scaled = D[:, None] * A * C
    assert np.log10(scaled[0, 2]) == pytest.approx(np.log10(scaled[2, 0]), abs=0.1)


def _with_stored_zeros(M: np.ndarray) -> sp.csr_array:
    """All entries of M, those that are 0 among them."""
    rows, columns = M.shape
    at = np.tile(np.arange(columns), rows)
    return sp.csr_array((M.ravel(), at, np.arange(0, M.size + 1, columns)), shape=M.shape)


def test_zeros_that_are_stored_join_no_parts() -> None:
    """By hand: two LCPs side by side, z₄ = 0.011 for 0.010, an error of about a tenth of its part; whole programs have
    one size, and z₂ = 0.011 for 0.010 is an error of 1e-3 of a force, or of 1.1e-5 in the gap."""
    M, right = np.kron(np.eye(2), np.array([[1.0, 2.0], [0.0, 1.0]])), np.array([1.0, 1.0, 0.01, 0.01])
    off = LCPPoint(z=right + np.array([0.0, 0.0, 0.0, 0.001]))
    errors = [judge(LCP(M=m, q=-M @ right), off, 1e-6).error for m in (M, sp.csr_array(M), _with_stored_zeros(M))]
    assert errors[0] == errors[1] == errors[2] > 1e-2
    W, free, mu = np.kron(np.eye(2), np.eye(3)), np.array([-1.0, 0.0, 0.0, -1e-6, 0.0, 0.0]), np.ones(2)
    wrong = FCPoint(r=np.array([1.0, 0.0, 0.0, 2e-6, 0.0, 0.0]))
    errors = [judge(FrictionContact(W=m, q=free, mu=mu), wrong, 1e-6).error for m in (W, _with_stored_zeros(W))]
    assert errors[0] == errors[1] > 0.1
    Q, p, z = np.eye(2), np.array([-1.0, -0.01]), np.array([1.0, 0.011])
    point = QPPoint(z=z, lam=np.zeros(0), mu=np.zeros(0), nu=np.zeros(2))
    for m in (Q, _with_stored_zeros(Q)):
        assert judge(LCP(M=m, q=p), LCPPoint(z=z), 1e-6).error == pytest.approx(1.1e-5, rel=1e-3)
        assert judge(QP.build(m, p, lb=np.zeros(2)), point, 1e-6).error == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.parametrize("mu", [0.5, 1e6, 1e10, 1e15])
def test_what_sticks_is_right_whatever_its_coefficient(mu: float) -> None:
    """As near as numbers come to u = 0, it slides at 1e-17, which is 1e-2 once multiplied by 10¹⁵."""
    stick = FrictionContact(W=np.diag([1.0, 1, 1]) + 0.1, q=[-1.0, 0.3, 0.1], mu=[mu], dimension=3)
    r = np.linalg.solve(stick.W, -stick.q)
    r[1] = np.nextafter(r[1], 0.0)
    assert judge(stick, FCPoint(r=r), 1e-12).solved
    assert judge(stick, FCPoint(r=1.001 * r), 1e-6).error > 1e-4
    assert not judge(stick, FCPoint(r=np.zeros(3)), 1e-6).solved


@pytest.mark.parametrize("node", sorted(ROWS))
def test_planted_solutions_are_resolved(node: str) -> None:
    for case in cases(node):
        verdict = judge(case.problem, case.point, 1e-6)
        assert verdict.within, (case.name, verdict.error)
        assert "unresolvable" not in verdict.flags, case.name


def _squeezed(rng: np.random.Generator, contacts: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """W of a point that contacts hold from all sides, a motion that opens all of them as far as others close, and
    reactions along the normals that are in balance."""
    normals = rng.standard_normal((contacts, 3))
    normals[-1] = -normals[:-1].sum(axis=0)
    sizes = np.linalg.norm(normals, axis=1)
    frames = [np.linalg.qr(np.column_stack([n, rng.standard_normal((3, 2))]))[0] for n in normals]
    H = np.hstack([np.column_stack([n / size, F[:, 1:]]) for n, size, F in zip(normals, sizes, frames, strict=True)])
    stress = np.zeros(3 * contacts)
    stress[::3] = sizes / sizes.max()
    return H.T @ H, H.T @ rng.standard_normal(3), stress


@pytest.mark.parametrize("tolerance", [1e-10, 1e-6, 1e-3])
@pytest.mark.parametrize("power", [3, 9, 13, 14, 14.5, 15, 16, 18, 22, 28, 60, 120])
def test_reactions_that_grow_solve_no_problem_without_a_solution(power: float, tolerance: float) -> None:
    """All contacts close at 1 more than one motion can undo: by Gordan's theorem no reactions open them. Beyond 1/eps
    the sum Wr + q has no digit of q, and its rounding may have any sign."""
    rng = np.random.default_rng(29)
    for contacts in (2, 3, 5, 8):
        W, motion, stress = _squeezed(rng, contacts)
        q = motion / np.abs(motion).max()
        q[::3] -= 1.0
        problem = FrictionContact(W=W, q=q, mu=np.full(contacts, 0.5), dimension=3)
        bounded = np.linalg.lstsq(W, -q)[0]
        for _ in range(5):
            roundings = 1.0 + 2.0**-52 * rng.integers(-2, 3, stress.size)
            verdict = judge(problem, FCPoint(r=bounded + 10.0**power * stress * roundings), tolerance)
            assert not verdict.solved, (contacts, verdict.error)


@pytest.mark.parametrize("power", [0, 3, 6, 9, 12])
def test_reactions_in_balance_change_no_right_answer(power: float) -> None:
    """8 roundings of terms 10ᵖ are 2e-15 · 10ᵖ of velocities of about 1: below the tolerance up to 10⁶, from 10⁹ on
    nobody knows them, whatever the error."""
    rng = np.random.default_rng(31)
    for contacts in (2, 3, 5, 8):
        W, _, stress = _squeezed(rng, contacts)
        inside = np.tile([1.0, 0.1, -0.2], contacts) * rng.uniform(0.5, 2.0, 3 * contacts)
        problem = FrictionContact(W=W, q=-W @ inside, mu=np.full(contacts, 0.5), dimension=3)
        verdict = judge(problem, FCPoint(r=inside + 10.0**power * stress), 1e-8)
        assert verdict.solved == (power <= 6), (contacts, verdict)
        assert ("unresolvable" in verdict.flags) == (power > 6), (contacts, verdict)


@pytest.mark.parametrize("pair", [1e-19, 1e-9])
def test_rows_that_vanish_with_an_unknown_are_not_held_against_constants(pair: float) -> None:
    """Fischer and Burmeister's equation a + b − √(a² + b²) = 0 of a = z₁, b = z₂ + 1 beside 3z₂ = 6 + z₁: a is 0."""
    z = ca.SX.sym("z", 2)
    a, b = z[0], z[1] + 1.0
    row = 2.0 * a * b / (a + b + ca.sqrt(a * a + b * b))
    problem = Equation(F=Map.from_casadi(z, ca.vertcat(row, 3.0 * z[1] - 6.0 - z[0])))
    assert judge(problem, EquationPoint(z=np.array([pair, 2.0])), 1e-6).solved


def test_a_large_solution_beside_small_constants_is_right() -> None:
    """z₁² = 10⁶ z₁ and z₂ = z₁ + 10⁻³: the size of z₁ is in coefficients, no constant is near it."""
    z = ca.SX.sym("z", 2)
    problem = Equation(F=Map.from_casadi(z, ca.vertcat(z[0] * (z[0] - 1e6), z[1] - z[0] - 1e-3)))
    for off, solved in ((0.0, True), (1e-8, True), (1e-4, False)):
        point = EquationPoint(z=np.array([1e6 * (1.0 + off), 1e6 + 1e-3]))
        assert judge(problem, point, 1e-6).solved == solved, off


@pytest.mark.parametrize("lower", [0.0, -np.inf])
def test_a_small_row_is_not_lost_beside_a_huge_unknown(lower: float) -> None:
    """By hand: 0z − 1 is −1 whatever z is, and asks for 0 or more. In floating point 1e20 − (1e20 + 1) is 0."""
    boxed = AVI(M=np.zeros((1, 1)), q=[-1.0], lb=[lower], ub=[np.inf])
    assert judge(boxed, AVIPoint(z=[1e20]), 1e-6).error == pytest.approx(1.0)
    assert judge(LCP(M=[[0.0]], q=[-1.0]), LCPPoint(z=[1e20]), 1e-6).error == pytest.approx(1.0)
    far = Relay(M=[[0.0]], q=[-1.0], lb=[0.0], ub=[1e25])
    assert judge(far, far.point_from_vector([1e20]), 1e-6).error == pytest.approx(1.0)


@pytest.mark.parametrize("load", [1e-5, 1.0, 1e6])
@pytest.mark.parametrize(("share", "solved"), [(1e-6, True), (1e-3, False)])
def test_what_is_at_rest_has_its_error_in_any_unit(load: float, share: float, solved: bool) -> None:
    """A body of mass 1 on the ground, at rest, that sinks with a share of its free fall: the error is that share but
    for a factor of 2, whatever the load."""
    f = load * np.array([-1.0, 0.1, 0.0])
    body = GlobalFrictionContact(M=np.eye(3), H=np.eye(3), f=f, w=np.zeros(3), mu=[0.5])
    verdict = judge(body, GFCPoint(v=share * f, r=(share - 1.0) * f), 1e-5)
    assert verdict.solved == solved
    assert share / 2 < verdict.error < 2 * share
    assert "absolute" not in verdict.flags


def test_a_problem_without_constants_is_measured_absolutely() -> None:
    problem = LCP(M=np.eye(2), q=np.zeros(2))
    verdict = judge(problem, LCPPoint(z=[1e-9, 0.0]), 1e-6)
    assert verdict.solved
    assert verdict.flags == ("absolute",)


@pytest.mark.parametrize(("step", "solved"), [(1e-5, True), (1e-2, False)])
def test_rows_of_degree_2_have_no_constants(step: float, solved: bool) -> None:
    """Powell's singular function: whatever z ≠ 0 is, a third of a squared row's terms is left, and no unit is given."""
    problem = powell_singular().problem
    assert isinstance(problem, Equation)
    verdict = judge(problem, EquationPoint(z=step * np.array([1.0, -0.1, 0.5, 0.5])), 1e-6)
    assert verdict.solved == solved
    assert verdict.flags == ("absolute",)
    assert verdict.error == pytest.approx(np.abs(problem.F(step * np.array([1.0, -0.1, 0.5, 0.5]))).max())


def test_an_idle_side_or_price_gives_the_size_where_nothing_else_does() -> None:
    """min ½z² with z ≤ 10⁶, and 0 ≤ z₁ ⟂ z₁ + z₂ ≥ 0 beside 10⁸ − z₁ > 0: 0 is the answer, and the idle number the only
    constant that an error could be compared with."""
    wide: dict[str, Any] = {
        "C": np.zeros((0, 1)),
        "d": np.zeros(0),
        "lb": np.full(1, -np.inf),
        "ub": np.full(1, np.inf),
    }
    program = QP(Q=np.eye(1), p=np.zeros(1), A=np.array([[-1.0]]), b=np.array([-1e6]), **wide)
    problem = LCP(M=np.array([[1.0, 1.0], [-1.0, 0.0]]), q=np.array([0.0, 1e8]))
    for z in (0.9, 1e-9):
        none = np.zeros(0)
        one = judge(program, QPPoint(z=np.array([z]), lam=np.zeros(1), mu=none, nu=np.zeros(1)), 1e-6)
        other = judge(problem, LCPPoint(z=np.array([z, 0.0])), 1e-6)
        assert one.error == pytest.approx(z / 1e6)
        assert other.error == pytest.approx(z / 1e8 / np.sqrt(2.0))  # z₁ + z₂ has two terms, and units of a mean of 1
        assert one.flags == other.flags == ()


def test_products_of_an_lcp_without_an_objective_count_as_they_are() -> None:
    """z₁ ≥ 0 beside z₂, z₂ ≥ 0 beside 1 − z₁: zᵀMz and qᵀz are 0 at (0.5, 0), and nothing makes products small."""
    problem = LCP(M=np.array([[0.0, 1.0], [-1.0, 0.0]]), q=np.array([0.0, 1.0]))
    for off in (1e-9, 1e-7, 1e-5):
        found = judge(problem, LCPPoint(z=np.array([0.5, off])), 1e-6)
        assert 0.1 * off < found.error < 3.0 * off
        assert found.solved is (off < 1e-6)


@pytest.mark.parametrize("step", [1e-7, 1e-5])
@pytest.mark.parametrize("program", [True, False])
def test_a_pair_of_two_small_numbers_is_right_where_rows_have_an_objective(program: bool, step: float) -> None:
    """The second pair is (0, 0) at (1, 0), and about (s, s) beside: s² by its product, s by its lesser number."""
    M = np.array([[1.0, 1.0 if program else 0.5], [1.0, 2.0]])
    problem = LCP(M=M, q=np.array([-1.0, -1.0]))
    found = judge(problem, LCPPoint(z=np.array([1.0 - M[0, 1] * step, step])), 1e-6)
    assert found.solved is (program or step < 1e-6)
    assert program or 0.1 * step < found.error < 3.0 * step


def test_unknowns_that_cancel_hide_no_row_without_an_objective() -> None:
    """z₁ − z₂ ≥ 1 and 2z₂ − 2z₁ ≥ −1 have no solution; at (10¹⁰ + 1, 10¹⁰) the second is missed by 1 of its side."""
    problem = LCP(M=np.array([[1.0, -1.0], [-2.0, 2.0]]), q=np.array([-1.0, 1.0]))
    assert judge(problem, LCPPoint(z=np.array([1e10 + 1.0, 1e10])), 1e-6).error > 0.05


@pytest.mark.parametrize("side", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(("force", "solved"), [(0.0, True), (4e-17, True), (1e-13, True), (1e-5, False), (1e-3, False)])
def test_forces_that_are_rounding_are_no_gradient(force: float, solved: bool, side: float) -> None:
    """min ½r² st z − r = side, z ≥ 0 has the answer (side, 0) with the price 0: nothing else is in its gradient."""
    program = QP.build(np.diag([0.0, 1.0]), np.zeros(2), C=np.array([[1.0, -1.0]]), d=[side], lb=[0.0, -np.inf])
    r = force * side
    answer = QPPoint(z=np.array([side, r]), lam=np.zeros(0), mu=np.array([-r]), nu=np.zeros(2))
    assert judge(program, answer, 1e-6).solved is solved


def test_what_an_unknown_costs_at_its_bound_is_a_term_of_the_objective() -> None:
    """min p z₁ + ½(z₂ − 1)² over z₁ ≥ 1, z ≥ 0: with z₂ = 0.9, f is p − 0.495 for p − 0.5; the sum of products is
    0.09, for z₂ pushes by 0.1 from 0.9 where it has no bound."""
    for price in (1.0, 1e3):
        program = QP.build(np.array([[1.0, 1e-3], [1e-3, 1.0]]), np.array([price, -1.0 - 1e-3]), lb=[1.0, 0.0])
        point = QPPoint([1.0, 0.9], [], [], np.array([1.0 + 9e-4 + price, 0.0]))  # type: ignore[arg-type]
        found = judge(program, point, 1e-6)
        assert found.error > 0.05 / price
        assert not found.solved


def test_an_unknown_near_0_has_the_room_that_prices_give_it() -> None:
    """min ½z₁² − z₁ + ½z₂² + 10⁷z₂ over |z₁| ≤ 1, z₂ ≥ 10⁻⁸ has z₁ = 1: at 0 the objective is ½ too large, and 0 has
    the distance of 1 to the bound to which it is pushed, not that of 10⁻⁸, the largest unknown."""
    program = QP.build(np.eye(2), np.array([-1.0, 1e7]), lb=[-1.0, 1e-8], ub=[1.0, np.inf])
    z, none = np.array([-1e-9, 1e-8]), np.zeros(0)
    assert judge(program, QPPoint(z=z, lam=none, mu=none, nu=z + program.p), 1e-6).error > 0.1


def test_a_cone_that_decides_nothing_hides_no_gap() -> None:
    """min ½x² with x ≥ 1, beside (10⁸, x, 0) in a cone: x = 1.5 with the price 1.5 has the objective 1.125 for 0.5."""
    cones = {"cone_kind": [Cone.NONNEGATIVE, Cone.SECOND_ORDER], "cone_size": [1.0, 3.0], "cone_mu": [1.0, 1.0]}
    A, b = np.array([[1.0], [0.0], [1.0], [0.0]]), np.array([-1.0, 1e8, 0.0, 0.0])
    numbers: Any = {name: np.array(values, dtype=float) for name, values in cones.items()}
    program = ConeQP(Q=np.eye(1), p=np.zeros(1), A=A, b=b, **numbers, cone_mu_r=np.zeros(2))
    for x, solved in ((1.0, True), (1.5, False)):
        answer = ConeQPPoint(x=np.array([x]), y=np.array([x, 0.0, 0.0, 0.0]))
        assert judge(program, answer, 1e-6).solved is solved


def test_a_derivative_that_vanishes_at_the_answer_gives_no_units() -> None:
    """min 10¹² (z₁ − 10³)⁴ + z₂ + ½z₂² has z₂ = −1; the curvature is 10¹⁹ at the start and 10⁷ at 10³ + 10⁻³."""
    program = NLP(f=graph(2, lambda z: 1e12 * (z[0] - 1e3) ** 4 + z[1] + 0.5 * z[1] ** 2), start=[0.0, 0.0])
    for z2, within in ((-1.0, True), (0.0, False)):
        answer = NLPPoint(z=np.array([1e3 + 1e-3, z2]), lam=np.zeros(0), mu=np.zeros(0), nu=np.zeros(2))
        assert judge(program, answer, 1e-6).within is within


@pytest.mark.parametrize("mu", [1.0, 1e3, 1e6])
def test_friction_hides_no_penetration(mu: float) -> None:
    """Nothing presses on a contact that closes at 1: its distance to the cone is 1/μ, but it closes at 1."""
    W = np.array([[2.0, 0.3, 0.1], [0.3, 1.0, 0.0], [0.1, 0.0, 1.0]])
    problem = FrictionContact(W=W, q=np.array([-1.0, 0.5, 0.2]), mu=np.array([mu]), dimension=3)
    assert judge(problem, FCPoint(r=np.zeros(3)), 1e-3).error > 0.3


@pytest.mark.parametrize("mu", [1e17, 1e30, 1e300])
def test_friction_beyond_all_digits_hides_no_contact_that_closes(mu: float) -> None:
    """Nothing holds a contact that closes; what sticks with u = 0 is right, whatever its coefficient."""
    W, r = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.array([1.0, 0.25, 0.0])
    closing = FrictionContact(W=W, q=np.array([-1.0, 0.5, 0.25]), mu=np.array([mu]), dimension=3)
    assert not judge(closing, FCPoint(r=np.zeros(3)), 1e-6).solved
    sticking = FrictionContact(W=W, q=-W @ r, mu=np.array([mu]), dimension=3)
    assert judge(sticking, FCPoint(r=r), 1e-6).solved


@pytest.mark.parametrize(("z", "solved"), [([0.0, -1.1e-16], True), ([-1e-8, -1e-8], True), ([0.0, 1.0], False)])
def test_what_is_left_of_terms_that_cancel_is_no_price(z: list[float], solved: bool) -> None:
    """min z₂ + 1e-5 (z₂ − z₁)² over z₂ ≥ 0 (Hock and Schittkowski 3): ∇f has no constant in its first row."""
    program = QP.build(2e-5 * np.array([[1.0, -1.0], [-1.0, 1.0]]), [0.0, 1.0], lb=[-np.inf, 0.0])
    edge = make("qp-nlp")
    nlp, trace = edge.apply(program)
    point = QPPoint(np.array(z), np.zeros(0), np.zeros(0), np.array([0.0, 1.0]))
    assert judge(program, point, 1e-6).solved == solved
    assert judge(nlp, edge.push(point, trace), 1e-6).solved == solved


def test_a_force_that_vanishes_by_a_power_is_no_price() -> None:
    """min (z₁ − z₂)² + (z₂ − z₃)⁴ over (1 + z₂²) z₁ + z₃⁴ = 3 (Hock and Schittkowski 26), at ones but for 1e-4 along
    z₁ = z₂: its linearization there has constants of 1e-11, as large as the force that is left."""
    found = generators.get("hock-schittkowski-nonlinear").instances()
    program: Any = next(i.problem for i in found if i.name == "hs26")
    for step, solved in ((0.0, True), (1e-4, True), (1e-1, False)):
        z1 = 1.0 - step
        z = np.array([z1, z1, (3.0 - (1.0 + z1 * z1) * z1) ** 0.25])
        verdict = judge(program, NLPPoint(z=z, lam=np.zeros(0), mu=np.zeros(1), nu=np.zeros(3)), 1e-6)
        assert verdict.within == solved, (step, verdict.error)


EPS = float(np.finfo(np.float64).eps)
SIZES = (1e-12, 1e-4, 1.0, 1e4, 1e12)
COEFFICIENTS = (0.0, 1e-8, 0.3, 1.0, 1e8)
SHAPES = [
    *((Cone.SECOND_ORDER, 3, mu, 0.0) for mu in (*COEFFICIENTS, np.inf)),
    (Cone.SECOND_ORDER, 2, 0.3, 0.0),
    (Cone.SECOND_ORDER, 4, 1e-8, 0.0),
    *((Cone.ROLLING, size, mu, mu_r) for size in (3, 5) for mu, mu_r in ((0.3, 0.1), (0.0, 0.5), (1.0, 1e-8))),
    *((Cone.ROLLING_DUAL, size, 0.3, 0.1) for size in (3, 5)),
    *((Cone.CYLINDER, 3, mu, 0.0) for mu in COEFFICIENTS),
    *((Cone.BALL, 3, mu, 0.0) for mu in COEFFICIENTS),
]


def _points(size: int) -> np.ndarray:
    rng = np.random.default_rng(7)
    return np.concatenate([s * rng.standard_normal((6, size)) for s in SIZES])


@pytest.mark.parametrize(("kind", "size", "mu", "mu_r"), SHAPES)
def test_projections_agree_with_those_of_the_solvers(kind: Cone, size: int, mu: float, mu_r: float) -> None:
    """Whose conditions `test_projections` has."""
    x = _points(size)
    count = len(x)
    ours = project(kind, x, np.full(count, mu), np.full(count, mu_r))
    theirs = ProductCone.of((kind, count, size, mu, mu_r)).project(x.ravel()).reshape(x.shape)
    assert (np.abs(ours - theirs).max(axis=1) <= 100 * EPS * np.linalg.norm(x, axis=1)).all()


def test_a_stored_zero_before_the_first_entry_changes_no_verdict() -> None:
    """Equalities given twice, with multipliers that cancel, and an answer that is exact."""
    entries, columns = np.array([0.0, 1.0, -2.0] * 2), np.array([0, 1, 2] * 2)
    C = sp.csr_array((entries, columns, np.array([0, 3, 6])), shape=(2, 3))
    problem = QP.build(np.eye(3), np.zeros(3), C=C, d=np.zeros(2))
    assert problem.C.nnz == 6
    point = QPPoint(z=np.zeros(3), lam=np.zeros(0), mu=np.array([1e3, -1e3]), nu=np.zeros(3))
    assert judge(problem, point, 1e-6).error == 0.0


def test_a_multiplier_is_not_near_its_bound_because_it_is_0() -> None:
    """z₂ is at 0, and its row of 9 pushes it to −3; nothing of the answer has a size, and the rows are a program's."""
    problem = Relay(M=[[5.0, 1.0], [-1.0, 4.0]], q=[0.0, 9.0], lb=[-2.0, -3.0], ub=[1.0, 0.0])
    assert judge(problem, LCPPoint(z=np.zeros(2)), 1e-6).error > 0.1
    assert judge(problem, LCPPoint(z=np.array([3.0, -15.0]) / 7.0), 1e-12).solved
