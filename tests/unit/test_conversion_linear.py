"""Edges between LCP, MLCP and QP on planted problems, both ways, and on answers that somebody else computed."""

from __future__ import annotations

import numpy as np
import planted
import pytest
import scipy.sparse as sp

from cpbench import graph, storage
from cpbench.conversions.base import make
from cpbench.errors import NotApplicable
from cpbench.formulations import LCP, MLCP, QP, AVIPoint, Kind, LCPPoint, MLCPPoint, Relay
from cpbench.foundation import matrices
from cpbench.solvers.base import Claim, solvers
from cpbench.verification import judge

CLOSE = 1e-9


# --------------------------------------------------------------------------------------------- lcp → qp


def test_lcp_qp_refuses_with_numbers(rng):
    skew = LCP(M=np.array([[1.0, 1.0], [-1.0, 1.0]]), q=np.zeros(2))
    with pytest.raises(NotApplicable, match=r"not symmetric, .* = 2\.0e\+00; use lcp-qp-nonsymmetric"):
        make("lcp-qp").apply(skew)
    indefinite = LCP(M=np.diag([1.0, -0.5]), q=np.zeros(2))
    with pytest.raises(NotApplicable, match=r"least eigenvalue at unit diagonal -1\.0e\+00"):
        make("lcp-qp").apply(indefinite)
    large = LCP(M=sp.csr_array(sp.diags_array([1.0, *np.linspace(-0.5, 2, 399)])), q=np.zeros(400))
    assert "least eigenvalue at unit diagonal -" in str(make("lcp-qp").obstacle(large))


def test_gap_needs_the_square_of_the_tolerance():
    # degenerate: z = w = 0 is the solution, z = √δ has gap δ
    problem = LCP(M=np.array([[1.0]]), q=np.zeros(1))
    edge = make("lcp-qp-nonsymmetric")
    target = edge.step(problem)
    delta = edge.tolerance(1e-4, {})
    assert delta == pytest.approx(1e-8)
    z = np.array([np.sqrt(delta)])
    assert target.objective(z) == pytest.approx(delta)
    assert problem.residuals(LCPPoint(z=z)).measured["natural"] == pytest.approx(1e-4)
    assert edge.tolerance(2.0, {}) == 2.0
    assert graph.tolerance(target, 1e-4, 1) == delta
    assert make("lcp-mlcp").tolerance(1e-4, {}) == 1e-4


# ---------------------------------------------------------------------------------------- lcp ↔ mlcp


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_split_finds_scrambled_equalities(sign, sparse, seed):
    # a semidefinite problem whose equalities were permuted, scaled and negated
    rng = np.random.default_rng(seed)
    n, m, hidden = 5, 4, 2
    C = rng.standard_normal((n, m))
    C[n - hidden :] = 0.0  # equalities and unknowns that v does not enter
    A = planted.square(rng, n, "positive definite")
    if sign < 0:
        A[n - 1, n - 1] = 0.0  # a multiplier: zero on the diagonal, skew beside it
        A[: n - 1, n - 1] = rng.standard_normal(n - 1)
        A[n - 1, : n - 1] = -A[: n - 1, n - 1]
        B, D = planted.square(rng, m, "monotone"), -C.T
    else:
        whole = planted.square(rng, n + m, "positive definite")
        A, B, C = whole[:n, :n], whole[n:, n:], whole[:n, n:]
        D = C.T
    order, scale = rng.permutation(n), rng.choice([-2.0, -1.0, -0.5, 0.5, 3.0], n)
    A, C = scale[:, None] * A[order], scale[:, None] * C[order]
    u = rng.standard_normal(n)
    v, w = planted.complementary(rng, m)
    problem = MLCP(
        A=planted.stored(A, sparse),
        B=planted.stored(B, sparse),
        C=planted.stored(C, sparse),
        D=planted.stored(D, sparse),
        a=-A @ u - C @ v,
        b=w - D @ u - B @ v,
    )
    target, _ = planted.both_ways(make("mlcp-lcp-split"), problem, MLCPPoint(u=u, v=v))
    assert matrices.is_psd(target.M)
    out = solvers.get("lemke").run(target)
    assert out.claim == Claim.SOLVED
    assert problem.residuals(graph.lift(target, out.point)).error <= CLOSE


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("name", ["diodeBridge_mlcp", "diodeBridge20_mlcp", "diodeBridge40_mlcp", "PD_mlcp"])
def test_diode_bridges(shared_data, name):
    problem = storage.load(shared_data / "mlcp" / f"{name}.dat", format="siconos-mlcp")
    rank = np.linalg.matrix_rank(matrices.dense(problem.A))
    with pytest.raises(NotApplicable, match=rf"rank {rank}\) is numerically singular.*use mlcp-lcp-split"):
        make("mlcp-lcp-schur").apply(problem)
    as_stored = matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
    assert not matrices.is_psd(as_stored)
    arrival = graph.arrive(problem, "lcp")
    assert arrival.route.label == "mlcp-lcp-split"
    assert [end.edge for end in arrival.dead_ends] == ["mlcp-lcp-schur"]
    assert matrices.is_psd(arrival.problem.M)
    out = solvers.get("lemke").run(arrival.problem)
    assert out.claim == Claim.SOLVED
    assert problem.residuals(graph.lift(arrival.problem, out.point)).error <= 1e-12


# ----------------------------------------------------------------------------------------- qp → mlcp


def test_qp_mlcp_nonconvex_is_necessary(rng):
    problem, point = planted.qp(rng, 4, 2, 1, "symmetric indefinite")
    planted.both_ways(make("qp-mlcp"), problem, point)
    assert make("qp-mlcp").exactness(problem) == Kind.NECESSARY
    with pytest.raises(graph.NoRoute, match="qp-mlcp: is necessary for this problem"):
        graph.arrive(problem, "mlcp")
    assert {end.edge for end in graph.explain(problem, "mlcp")} == {"qp-mlcp", "qp-avi"}
    assert graph.arrive(problem, "mlcp", graph.ALL).kind == Kind.NECESSARY


# ---------------------------------------------------------------------------------- what cancels on the way back


@pytest.mark.parametrize("far", [0.0, 3.0, 1e2, 1e3])
def test_a_far_origin_asks_for_what_cancels(far: float) -> None:
    """z = x − far: a target answer of relative error ε in its terms 2·far is off by (1 + 2 far) ε of |q| = 1 here."""
    edge = make("relay-lcp")
    source = Relay(M=np.eye(1), q=-np.ones(1), lb=np.array([-far]), ub=np.array([far + 2.0]))
    target = edge.step(source)
    asked = edge.tolerance(1e-6, target.provenance[-1].trace)
    assert asked == pytest.approx(1e-6 / (1.0 + 2.0 * far))
    assert graph.tolerance(target, 1e-6, 1) == asked
    x = (1.0 + far) * (1.0 + asked)
    assert abs(graph.lift(target, LCPPoint(z=[x, 0.0])).z[0] - 1.0) <= 1e-6


def test_an_eliminated_constant_asks_for_what_cancels() -> None:
    """Schur: D A⁻¹a = 200 beside b = 1. Where no row has a constant nothing is known, and no more is asked for."""
    one, edge = np.eye(1), make("mlcp-lcp-schur")
    source = MLCP(A=0.01 * one, B=one, C=one, D=-one, a=[-2.0], b=[1.0])
    assert graph.tolerance(edge.step(source), 1e-6, 1) == pytest.approx(1e-6 / 401.0)
    without = MLCP(A=0.01 * one, B=one, C=one, D=-one, a=[-2.0], b=[0.0])
    assert graph.tolerance(edge.step(without), 1e-6, 1) == 1e-6
    dual = make("qp-qp-dual").step(QP.build(np.diag([0.01, 1.0]), np.array([-1.0, 0.0]), A=-np.eye(2)[:1], b=[-1.0]))
    assert graph.tolerance(dual, 1e-6, 1) == pytest.approx(1e-6 / 201.0)


def test_no_edge_asks_for_what_methods_of_first_order_do_not_reach() -> None:
    source = Relay(M=np.eye(1), q=-np.ones(1), lb=np.array([-1e7]), ub=np.array([1e7]))
    assert graph.tolerance(make("relay-lcp").step(source), 1e-6, 1) == pytest.approx(1e-10)


def test_the_dual_gives_far_bounds_no_force() -> None:
    """½|z|² − z₁ with |z| ≤ 10⁶: beside slacks of 10⁶ an error of 0.1 in the multipliers is nothing, and all of z."""
    source = QP.build(np.eye(2), np.array([-1.0, 0.0]), lb=np.full(2, -1e6), ub=np.full(2, 1e6))
    edge = make("qp-qp-dual")
    target, trace = edge.apply(source)
    answer = target.point_from_vector(np.concatenate([np.full(4, 0.1), -target.p]))
    assert np.array_equal(edge.lift(answer, trace).z, [1.0, 0.0])
    # what presses stays: z₁ ≤ ½
    held, trace = edge.apply(QP.build(np.eye(2), np.array([-1.0, 0.0]), lb=np.full(2, -1e6), ub=np.array([0.5, 1e6])))
    y = np.where(held.p == -0.5, 0.5, 0.1)
    lifted = edge.lift(held.point_from_vector(np.concatenate([y, np.zeros(4)])), trace)
    assert np.allclose(lifted.z, [0.5, 0.0])


def test_a_bound_is_pressed_at_the_origin_too() -> None:
    """Hock and Schittkowski's problem 3, z₂ + 1e-5 (z₂ − z₁)² over z₂ ≥ 0: at z = 0 its first row has no term."""
    Q = 2e-5 * np.array([[1.0, -1], [-1, 1]])
    source = QP.build(Q, np.array([0.0, 1]), lb=np.array([-np.inf, 0.0]))
    target = make("qp-avi").step(source)
    lifted = graph.lift(target, AVIPoint(z=[0, 0]))
    assert lifted.nu.tolist() == [0.0, 1.0]


def test_a_bound_is_pressed_beside_rows_of_rounding() -> None:
    """z at its bounds but for 1e-17, and a row z₁ ≥ z₂: its terms are as small, so that it tells nothing of z."""
    Q = np.array([[1.0, 0.0, -0.5], [0.0, 1.0, 0.0], [-0.5, 0.0, 1.0]])
    source = QP.build(Q, np.array([1.0, 1.0, -1.0]), A=[[1.0, -1.0, 0.0]], b=[0.0], lb=np.zeros(3))
    lifted = graph.lift(make("qp-avi").step(source), AVIPoint(z=[1e-17, 1e-17, 1.0], lam=[0.0]))
    assert lifted.nu.tolist() == [0.5, 1.0, 0.0]


def test_an_idle_bound_takes_no_force() -> None:
    """An interior solution with an error of 1e-9 in it: what is left of the gradient is no force of bounds at ±1e6."""
    rng = np.random.default_rng(0)
    A = rng.standard_normal((6, 6))
    Q, z = A @ A.T + np.eye(6), rng.standard_normal(6)
    source = QP.build(Q, -Q @ z, lb=np.full(6, -1e6), ub=np.full(6, 1e6))
    target = make("qp-avi").step(source)
    lifted = graph.lift(target, AVIPoint(z=z * (1.0 + 1e-9)))
    assert not lifted.nu.any()
    assert judge(source, lifted, 1e-6).solved


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("linear", [False, True])
def test_a_bound_that_is_pressed_takes_its_force_in_all_units(unit: float, linear: bool) -> None:
    """min ½q z₁² − z₁ + z₂ over z₁ ≤ 3, z₂ ≥ 0 and an idle row; z at the bounds but for 1e-9, in units of `unit`."""
    Q = np.diag([0.0 if linear else 0.1, 0.0]) / unit**2
    source = QP.build(
        Q,
        np.array([-1.0, 1.0]) / unit,
        A=np.array([[1.0, 1.0]]) / unit,
        b=np.array([-1e3]),
        lb=np.array([-1e5, 0.0]) * unit,
        ub=np.array([3.0, np.inf]) * unit,
    )
    target = make("qp-avi").step(source)
    z = np.array([3.0 - 1e-9, 1e-9]) * unit
    lifted = graph.lift(target, AVIPoint(z=z, lam=[0.0]))
    assert lifted.nu * unit == pytest.approx([(0.0 if linear else 0.3) - 1.0, 1.0])
