"""Published measures against the programs that print them, and exact numbers."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp
from click.testing import CliRunner

from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.cli.verify_command import command
from cpbench.errors import UnknownName
from cpbench.formulations import (
    LCP,
    MLCP,
    QP,
    ConeQP,
    ConeQPPoint,
    FCPoint,
    FrictionContact,
    LCPPoint,
    MiCP,
    MiCPPoint,
    MLCPPoint,
    QPPoint,
    Relay,
)
from cpbench.formulations.expressions.recording import recorded
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.testing.cases import cases
from cpbench.verification import BESIDE, beside, judge
from cpbench.verification.published import clarabel as clarabels
from cpbench.verification.published import conic
from cpbench_lab import published
from cpbench_lab.published import FAMILIES, SOURCES, all_measures, path_norms

inf = np.inf
FORCE = 2.0
"""F(z) = 2z + c: the slope in the problems of one unknown."""

# lb, ub, z, F(z); inf-norms of complementarity, normal map, minimum map and Fischer function, as PATH 5.2.01
# (in GAMS 54.6.1) prints them of its initial point, with crash_method none and preprocess no
PRINTED = [
    ((0, inf, 1.5, 6), (9.0, 6.0, 1.5, 1.3153)),
    ((0, inf, 0.25, 6), (1.5, 6.0, 0.25, 0.24479)),
    ((0, inf, 100, 6), (600.0, 6.0, 6.0, 5.8202)),
    ((0, inf, 1.5, -6), (6.0, 6.0, 6.0, 10.685)),
    ((0, inf, 0, -6), (6.0, 6.0, 6.0, 12.0)),
    ((-inf, inf, 3, 0.75), (0.75, 0.75, 0.75, 0.75)),
    ((-inf, inf, 3, -0.75), (0.75, 0.75, 0.75, 0.75)),
    ((-1, 1, 0.5, 3), (2.25, 3.0, 1.5, 1.3006)),
    ((-1, 1, 0.5, -3), (0.75, 3.0, 0.5, 0.52716)),
    ((-1, 1, -1, -3), (3.0, 3.0, 2.0, 2.7889)),
    ((-1, 1, 1, 3), (3.0, 3.0, 2.0, 1.6754)),
    ((-inf, 2, 1.25, -4), (1.0, 4.0, 0.75, 0.68029)),
    ((-inf, 2, 1.25, 4), (4.0, 4.0, 4.0, 7.3197)),
    ((-inf, 2, 2, 4), (4.0, 4.0, 4.0, 8.0)),
]
M5 = np.array([[4, -1, 0.5, 2, 0], [1, 3, -2, 0, 1], [0, 1, 5, -1, 0.25], [-2, 0, 1, 2, 1], [0.5, 1, 0, -1, 3.0]])
Q5 = np.array([-3, 1, 2, -4, -2.5])
LB5, UB5 = np.array([0, -inf, -1, -inf, 0]), np.array([inf, inf, 1, 2, inf])
Z5 = np.array([1.5, -0.25, 0.5, 1.25, 0])
PRINTED5 = (9.0, 6.0, 3.25, 6.5)


def affine(M: np.ndarray, q: np.ndarray, lb: np.ndarray, ub: np.ndarray) -> MiCP:
    """Mz + q beside the bounds."""
    return MiCP(F=recorded(q.size, lambda z: M @ z + q), lb=lb, ub=ub)


@pytest.mark.parametrize(("case", "printed"), PRINTED)
def test_norms_are_those_that_path_prints(case: tuple[float, ...], printed: tuple[float, ...]) -> None:
    lb, ub, z, F = case
    problem = affine(np.array([[FORCE]]), np.array([F - FORCE * z]), np.array([lb]), np.array([ub]))
    assert tuple(path_norms(problem, MiCPPoint([z])).values()) == pytest.approx(printed, rel=5e-5)


def test_norms_of_five_unknowns_are_those_that_path_prints() -> None:
    norms = path_norms(affine(M5, Q5, LB5, UB5), MiCPPoint(Z5))
    assert tuple(norms.values()) == pytest.approx(PRINTED5, rel=5e-5)


def test_one_problem_written_in_four_ways_has_the_same_norms() -> None:
    M, q, z = M5[:3, :3], Q5[:3], np.array([0.5, 0.25, 0.0])
    free = np.array([-inf, 0.0, 0.0])
    lcp = path_norms(LCP(M=M, q=q), LCPPoint(z))
    assert lcp == pytest.approx(path_norms(affine(M, q, np.zeros(3), np.full(3, inf)), MiCPPoint(z)))
    mixed = MLCP(A=M[:1, :1], C=M[:1, 1:], D=M[1:, :1], B=M[1:, 1:], a=q[:1], b=q[1:])
    expected = path_norms(affine(M, q, free, np.full(3, inf)), MiCPPoint(z))
    assert path_norms(mixed, MLCPPoint(z[:1], z[1:])) == pytest.approx(expected)
    relay = Relay(M=M, q=q, lb=np.zeros(3), ub=np.ones(3))
    assert path_norms(relay, LCPPoint(z)) == pytest.approx(
        path_norms(affine(M, q, np.zeros(3), np.ones(3)), MiCPPoint(z))
    )


def test_an_answer_outside_its_bounds_passes_under_no_norm_of_path() -> None:
    """At P(−3) = 0 everything holds; z = −3 itself is 3 away from it."""
    norms = path_norms(LCP(M=np.eye(1), q=[1.0]), LCPPoint([-3.0]))
    assert set(norms.values()) == {3.0}


def test_a_fixed_unknown_adds_nothing() -> None:
    """z₂ = 1 is fixed: whatever F₂ is, the rest decides (F₁ = 0 at z₁ = 1/2)."""
    problem = affine(np.array([[2.0, 0], [3, 1]]), np.array([-1.0, 5]), np.array([0.0, 1]), np.array([inf, 1]))
    assert set(path_norms(problem, MiCPPoint([0.5, 1.0])).values()) == {0.0}


@pytest.mark.parametrize("node", sorted({node for family in FAMILIES for node in family.nodes}))
def test_planted_solutions_measure_zero(node: str) -> None:
    """To rounding of the products of the largest numbers of the data and of the answer: the measures have units."""
    sources = {family.source for family in FAMILIES}
    for case in cases(node):
        theirs = [row for row in all_measures(case.problem, case.point, 1e-6) if row.source in sources]
        assert theirs or not case.problem.K.conical  # of disks none
        size = _largest(case.problem.data()) * _largest(case.point.arrays())
        for row in theirs:
            assert row.value <= 1e-13 * size**2, (case.name, row)


def _largest(arrays: dict[str, object]) -> float:
    """1 or the largest finite entry."""
    entries = np.concatenate([np.ravel(getattr(v, "data", v) if sp.issparse(v) else v) for v in arrays.values()] + [[]])
    return 1.0 + float(np.abs(entries[np.isfinite(entries)]).max(initial=0.0))


BOXED = QP.build(
    np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([-1.0, 1]), A=np.array([[1.0, 1]]), b=np.array([1.0]),
    lb=np.array([0.0, -inf]), ub=np.array([2.0, inf]),
)  # fmt: skip
POINT = QPPoint(z=[0.25, 0.5], lam=[0.125], mu=[], nu=[0.5, 0.0])


def rows_of(problem: Any, point: Any) -> dict[str, float]:
    """Every measure of an answer by name."""
    return {row.name: row.value for row in all_measures(problem, point, 1e-6)}


def test_osqp_by_exact_arithmetic() -> None:
    """E = [1 1; 1 0], y = −(λ, ν₁): Ez + y = (5/8, −1/4), s = (1, 0), Qz + p + Eᵀy = (−7/8, 3/2)."""
    rows = rows_of(BOXED, POINT)
    primal = max(abs(Fraction(3, 4) - 1), abs(Fraction(1, 4) - 0)) / (1 + Fraction(1))
    dual = max(abs(Fraction(3, 4) - 1 - Fraction(5, 8)), abs(Fraction(5, 8) + 1 - Fraction(1, 8)))
    assert rows["osqp_primal"] == float(primal)
    assert rows["osqp_dual"] == float(dual / (1 + 1))


def test_qpbenchmark_by_qpsolvers() -> None:
    """qpsolvers has Gx ≤ h and multipliers of the opposite sign."""
    problem = qpsolvers.Problem(BOXED.Q, BOXED.p, -BOXED.A, -BOXED.b, lb=BOXED.lb, ub=BOXED.ub)
    theirs = qpsolvers.Solution(problem, found=True, x=POINT.z, z=POINT.lam, z_box=-POINT.nu)
    rows = rows_of(BOXED, POINT)
    assert rows["primal_absolute"] == pytest.approx(theirs.primal_residual(), rel=1e-14)
    assert rows["stationarity_absolute"] == pytest.approx(theirs.dual_residual(), rel=1e-14)
    assert rows["gap_absolute"] == pytest.approx(theirs.duality_gap(), rel=1e-14)


def test_contactbench_by_exact_arithmetic() -> None:
    """W = 1: u = r + q = (−1/2, 3, 4), μ = 1/2, û = (2, 3, 4); K* is û_N ≥ ‖û_T‖/2 = 5/2, 1/2 away in û_N.

    The nearest point of K* is (2, 3, 4) + t(2, −3/5, −4/5)/√5 … with t = 1/√5: 2/5 along N, and (3, 4)/25 along T.
    """
    problem = FrictionContact(W=np.eye(3), q=[-1.5, 3.0, 4.0], mu=[0.5])
    rows = rows_of(problem, FCPoint([1.0, 0.0, 0.0]))
    assert rows["contactbench_signorini [J]"] == 0.5
    assert rows["contactbench_complementarity [J]"] == 2.0
    assert rows["contactbench_dual_feasibility [m/s]"] == pytest.approx(0.4, rel=1e-15)
    assert rows["contactbench_dissipation [J]"] == 0.5 * 4.0


def planted_cone_program() -> ConeQP:
    """Two second-order cones, a half line and an equality, with the solution x = (1, 2, 3)."""
    A = np.array([[2.0, 1, 0], [1, -1, 1], [0, 1, 2], [1, 0, 1], [0, 2, -1], [1, 1, 0], [1, 1, 1], [3, -1, 0]])
    K = ProductCone.of((Cone.SECOND_ORDER, 2, 3, 1.0), (Cone.NONNEGATIVE, 1, 1), (Cone.ZERO, 1, 1))
    s = np.array([5.0, 3, 4, 3, 1, 1, 0, 0])  # on the first cone, within the second, at both ends of the others
    y = np.array([10.0, -6, -8, 0, 0, 0, 2, -1])
    Q, x = np.array([[2.0, 1, 0], [1, 3, 0], [0, 0, 0]]), np.array([1.0, 2, 3])
    return ConeQP.over(Q, A.T @ y - Q @ x, K, A, s - A @ x)


def in_order() -> tuple[Any, ...]:
    """P, q, A, b of Clarabel and SCS: the row of {0} goes first, and Ax + s = b."""
    P = planted_cone_program()
    order = [7, 6, 0, 1, 2, 3, 4, 5]
    return sp.csc_matrix(np.triu(P.Q)), P.p, sp.csc_matrix(-P.A[order]), P.b[order], np.argsort(order)


@pytest.mark.parametrize("iterations", [1, 3, 5])
def test_clarabel_by_what_it_reports(iterations: int) -> None:
    """Its own s is taken: of an iterate it is not the nearest to Ax + b."""
    clarabel = pytest.importorskip("clarabel")
    problem = planted_cone_program()
    P, q, A, b, back = in_order()
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_iter, settings.presolve_enable = False, iterations, False
    cones = [clarabel.ZeroConeT(1), clarabel.NonnegativeConeT(1), *2 * [clarabel.SecondOrderConeT(3)]]
    found = clarabel.DefaultSolver(P, q, A, b, cones, settings).solve()
    point = ConeQPPoint(found.x, np.array(found.z)[back])
    ours = clarabels(replace(conic(problem, point), s=np.array(found.s)[back]))
    gap = abs(found.obj_val - found.obj_val_dual) / max(1.0, min(abs(found.obj_val), abs(found.obj_val_dual)))
    assert tuple(ours.values()) == pytest.approx((found.r_prim, found.r_dual, gap), rel=1e-6, abs=1e-13)
    assert found.r_dual > 1e-9


@pytest.mark.parametrize("iterations", [25, 50])
def test_scs_by_what_it_reports(iterations: int) -> None:
    """It prints absolute residuals: they are divided here by 1 and the terms that its manual names."""
    scs = pytest.importorskip("scs")
    problem = planted_cone_program()
    P, q, A, b, back = in_order()
    data, cone = {"P": P, "A": A, "b": b, "c": q}, {"z": 1, "l": 1, "q": [3, 3]}
    found = scs.SCS(data, cone, eps_abs=1e-15, eps_rel=1e-15, max_iters=iterations, verbose=False).solve()
    x, y, s, info = found["x"], found["y"], found["s"], found["info"]
    a = replace(conic(problem, ConeQPPoint(x, y[back])), s=s[back])
    full = problem.Q
    primal = info["res_pri"] / (1 + max(np.abs(v).max() for v in (A @ x, s, b)))
    dual = info["res_dual"] / (1 + max(np.abs(v).max() for v in (full @ x, A.T @ y, q)))
    gap = info["gap"] / (1 + max(map(abs, (x @ full @ x, q @ x, b @ y))))
    assert tuple(published.scs(a).values()) == pytest.approx((primal, dual, gap), rel=1e-6, abs=1e-13)
    assert primal > 1e-9


@pytest.mark.parametrize(("seed", "iterations"), [(0, 20), (0, 100), (1, 100)])
def test_highs_by_what_it_reports(seed: int, iterations: int) -> None:
    """Iterates of PDLP for a linear program with a cost of 1e3 and a bound of 1e4 that play no part. The third number
    is rounding where PDLP makes multipliers of the bounds from the gradient."""
    highspy = pytest.importorskip("highspy")
    rng = np.random.default_rng(seed)
    A, C, p = rng.uniform(0.5, 2.0, (6, 8)), rng.uniform(-1.0, 1.0, (2, 8)), rng.uniform(1.0, 3.0, 8)
    p[0], ub = 1e3, np.append(np.full(6, 5.0), [1e4, inf])
    problem = QP.build(np.zeros((8, 8)), p, A, np.full(6, 4.0), C, C @ np.full(8, 0.5), np.zeros(8), ub)
    h = highspy.Highs()
    options = {"solver": "pdlp", "presolve": "off", "output_flag": False, "pdlp_iteration_limit": iterations}
    for option, value in options.items():
        h.setOptionValue(option, value)
    for cost, above in zip(p, ub, strict=True):
        h.addVariable(lb=0.0, ub=above, obj=cost)
    for row, low, high in [*((r, 4.0, inf) for r in A), *((r, d, d) for r, d in zip(C, problem.d, strict=True))]:
        h.addRow(low, high, 8, np.arange(8), row)
    h.run()
    info, found = h.getInfo(), h.getSolution()
    point = QPPoint(found.col_value, found.row_dual[:6], found.row_dual[6:], found.col_dual)
    theirs = (info.max_relative_primal_infeasibility, info.max_relative_dual_infeasibility)
    theirs += (info.max_relative_dual_residual_error, info.primal_dual_objective_error)
    assert tuple(published.highs(problem, point).values()) == pytest.approx(theirs, rel=1e-9, abs=1e-12)
    assert theirs[0] > 1e-3


def test_dimacs_by_exact_arithmetic() -> None:
    """s = (3, 4, 0) lacks 1 of its cone, y = (−1, 0, 0) as much: p = −3e₁, b = (3, 4, 0), A = I, x = 0, xᵀQx = 0.

    The gradient is p − y = (−2, 0, 0); objectives are 0 and −bᵀy = 3.
    """
    K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0))
    problem = ConeQP.over(np.zeros((3, 3)), np.array([-3.0, 0, 0]), K, np.eye(3), np.array([3.0, 4, 0]))
    found = rows_of(problem, ConeQPPoint(np.zeros(3), [-1.0, 0, 0]))
    expected = {1: Fraction(2, 4), 2: Fraction(1, 4), 3: 0, 4: Fraction(1, 5), 5: Fraction(3, 4)}
    assert {k: found[f"dimacs_{k}"] for k in expected} == {k: float(v) for k, v in expected.items()}
    assert found["dimacs"] == 0.75
    assert "dimacs_6" not in found
    within = rows_of(problem, ConeQPPoint([2.0, 0, 0], [1.0, 0, 0]))  # s = (5, 4, 0), objectives −6 and −3
    assert (within["dimacs_5"], within["dimacs_6"]) == (3 / 10, 5 / 10)


def test_a_multiplier_of_no_side_is_an_error_of_the_gradient() -> None:
    """min z₁ with z₁ ≥ 0 alone, and a multiplier of −1 besides: to those that keep y in its cone it is not there."""
    problem = QP.build(np.zeros((1, 1)), np.array([1.0]), lb=np.array([0.0]))
    found = rows_of(problem, QPPoint(z=[0.0], lam=[], mu=[], nu=[-1.0]))
    assert (found["clarabel_dual"], found["scs_dual"], found["dimacs_1"]) == (1.0, 0.5, 0.5)
    assert (found["highs_dual"], found["highs_gradient"]) == (0.5, 2.0)


def test_a_side_without_end_and_an_idle_cost_have_no_size() -> None:
    """z = 1.5 above the bound 1, below 1e20: HiGHS has 1/2 over 1 + 1; a cost of 1e6 with a multiplier has no part."""
    problem = QP.build(np.zeros((2, 2)), np.array([1e6, 0.5]), lb=np.array([0.0, -inf]), ub=np.array([1e20, 1.0]))
    found = rows_of(problem, QPPoint(z=[0.0, 1.5], lam=[], mu=[], nu=[1e6, 0.0]))
    assert found["highs_primal"] == 0.25
    assert found["highs_gradient"] == 0.5 / 1.5
    assert found["clarabel_primal"] == 0.5 / (1.0 + 1.5)
    assert found["scs_primal"] == 0.5 / (1.0 + 1.5)


def test_natural_maps_by_exact_arithmetic() -> None:
    """W = 2, μ = 1/2: r − û = (1, 0, 0) − (3, 3, 4)·ρ; r − P_K(r − ρû) = (1, 0, 0) where that is in the polar cone.

    q = u − Wr = (−3/2, 3, 4), so û = (1/2 + 5/2, 3, 4); ρ = 1/2 gives (−1/2, −3/2, −2), and −1/2 + 5/4 > 0: it is not,
    and P_K is (1, 1/2·(−3/5, −4/5))·(−1/2 + 5/4)/(1 + 1/4) = (3/5, −9/50, −12/50). The reaction is 4/2.
    """
    problem = FrictionContact(W=2.0 * np.eye(3), q=[-1.5, 3.0, 4.0], mu=[0.5])
    found = rows_of(problem, FCPoint([1.0, 0.0, 0.0]))
    assert found["kamino_natural_map"] == pytest.approx(float(1 - Fraction(-2 * 2 + 5, 2) / Fraction(5, 4)), rel=1e-14)
    assert found["dimensionless"] == pytest.approx(0.4 / 2.0, rel=1e-14)


@pytest.mark.parametrize(("length", "mass"), [(1e3, 1.0), (1.0, 1e-6), (1e-3, 1e3)])
def test_the_dimensionless_map_has_no_units(length: float, mass: float) -> None:
    """Velocities in `length`, W over `mass`, reactions in both; Kamino's is in N·s, and changes with them."""
    problem = FrictionContact(W=2.0 * np.eye(3), q=[-1.5, 3.0, 4.0], mu=[0.5])
    other = FrictionContact(W=problem.W / mass, q=problem.q * length, mu=[0.5])
    one, two = rows_of(problem, FCPoint([1.0, 0, 0])), rows_of(other, FCPoint([length * mass, 0, 0]))
    assert two["dimensionless"] == pytest.approx(one["dimensionless"], rel=1e-12)
    assert two["kamino_natural_map"] != pytest.approx(one["kamino_natural_map"], rel=1e-2)


def test_a_report_has_one_number_of_others_for_each_formulation() -> None:
    """`beside` computes it where the residuals of the formulation do not have it, and it is the largest of its kind."""
    for node, name in BESIDE.items():
        plain = (c for c in cases(node) if node != "coneqp" or c.problem.K.conical)
        case = next(c for c in plain if c.problem.sizes().get("nc", 1))
        residuals = case.problem.residuals(case.point)
        assert name in {**residuals.measured, **residuals.parts, **beside(case.problem, case.point)}, node
    found = rows_of(BOXED, POINT)
    worst = max(found[f"clarabel_{k}"] for k in ("primal", "dual", "gap"))
    assert beside(BOXED, POINT) == {"clarabel": worst}


def test_every_source_is_of_a_number_that_its_formulation_measures() -> None:
    for node, name in SOURCES:
        case = next(c for c in cases(node) if c.problem.sizes().get("nc", 1))
        residuals = case.problem.residuals(case.point)
        assert name in {**residuals.measured, **residuals.parts}, (node, name)


def test_a_published_number_decides_where_it_is_named() -> None:
    problem, off = LCP(M=np.eye(2), q=[-1.0, 1.0]), LCPPoint([1.0, 1e-8])
    assert judge(problem, off, 1e-6).solved
    named = judge(problem, off, 1e-6, "path_normal_map")
    assert (named.solved, named.error) == (False, 1.0 + 1e-8)
    with pytest.raises(UnknownName, match="path_fischer"):
        judge(problem, off, 1e-6, "path_fisher")
    with pytest.raises(UnknownName):  # which only programs have
        judge(problem, off, 1e-6, "osqp_primal")


def verify(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(command, [str(a) for a in arguments])
    return done.exit_code, done.output


def test_the_table_says_whose_each_number_is(tmp_path: Path) -> None:
    storage.save(LCP(M=np.eye(2), q=[-1.0, 1.0], name="two"), tmp_path / "two.h5")
    np.save(tmp_path / "z.npy", [1.0, 1e-8])
    code, told = verify(tmp_path / "two.h5", "--answer", tmp_path / "z.npy", "--all-measures")
    lines = told.splitlines()
    assert code == 0
    assert "passes at 1e-06" in lines[0]
    line = {words[0]: words[1:] for words in map(str.split, lines[1:])}
    assert line["path_normal_map"][:3] == ["1", "no", "PATH"]
    assert line["path_minimum_map"][:3] == ["1e-08", "yes", "PATH"]
    assert line["natural"][1:3] == ["yes", "Siconos"]


@pytest.mark.parametrize(("friction", "degrees"), [([-0.5, 0.0], "53.1"), ([-0.3, -0.4], "0.0")])
def test_an_angle_is_within_no_tolerance(tmp_path: Path, friction: list[float], degrees: str) -> None:
    """It slides along (3, 4), 53.13° from the first tangent; an angle of 0 is not said to be within either."""
    problem = FrictionContact(W=np.zeros((3, 3)), q=[0.0, 3.0, 4.0], mu=[0.5], name="slides")
    storage.save(problem, tmp_path / "slides.h5")
    np.save(tmp_path / "r.npy", [1.0, *friction])
    _, told = verify(tmp_path / "slides.h5", "--answer", tmp_path / "r.npy", "--all-measures")
    angle = next(line for line in told.splitlines() if line.split()[0] == "slip_angle")
    assert (f"{float(angle.split()[2]):.1f}", angle.split()[3]) == (degrees, "-")


def test_all_measures_of_many_answers_is_refused(tmp_path: Path) -> None:
    with Store(tmp_path / "r.sqlite", create=True):
        pass
    code, told = verify(tmp_path / "r.sqlite", "--all-measures")
    assert code == 2
    assert "--all-measures are for one answer" in told
