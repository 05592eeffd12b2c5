"""Published measures against the programs that print them, exact numbers, and an independent gradient."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp
from click.testing import CliRunner
from scipy.optimize import approx_fprime

from cpbench import storage
from cpbench.cli.verify_command import command
from cpbench.errors import UnknownName
from cpbench.formulations import (
    LCP,
    MLCP,
    QP,
    FCPoint,
    FrictionContact,
    LCPPoint,
    MiCP,
    MiCPPoint,
    MLCPPoint,
    QPPoint,
    Relay,
)
from cpbench.formulations.expressions import Map
from cpbench.testing.cases import cases
from cpbench.verification import judge, judge_by_all
from cpbench.verification.merit_functions import path_norms
from cpbench.verification.published import FAMILIES, SOURCES

inf = np.inf
FORCE = 2.0
"""F(z) = 2z + c: the slope in the problems of one unknown."""

# lb, ub, z, F(z); inf-norms of complementarity, normal map, minimum map, Fischer function and its gradient, as
# PATH 5.2.01 (in GAMS 54.6.1) prints them of its initial point, with crash_method none and preprocess no
PRINTED = [
    ((0, inf, 1.5, 6), (9.0, 6.0, 1.5, 1.3153, 1.0749)),
    ((0, inf, 0.25, 6), (1.5, 6.0, 0.25, 0.24479, 0.23503)),
    ((0, inf, 100, 6), (600.0, 6.0, 6.0, 5.8202, 10.954)),
    ((0, inf, 1.5, -6), (6.0, 6.0, 6.0, 10.685, 50.194)),
    ((0, inf, 0, -6), (6.0, 6.0, 6.0, 12.0, 60.0)),
    ((-inf, inf, 3, 0.75), (0.75, 0.75, 0.75, 0.75, 1.5)),
    ((-inf, inf, 3, -0.75), (0.75, 0.75, 0.75, 0.75, 1.5)),
    ((-1, 1, 0.5, 3), (2.25, 3.0, 1.5, 1.3006, 1.1780)),
    ((-1, 1, 0.5, -3), (0.75, 3.0, 0.5, 0.52716, 0.61087)),
    ((-1, 1, -1, -3), (3.0, 3.0, 2.0, 2.7889, 7.1463)),
    ((-1, 1, 1, 3), (3.0, 3.0, 2.0, 1.6754, 1.5755)),
    ((-inf, 2, 1.25, -4), (1.0, 4.0, 0.75, 0.68029, 0.57823)),
    ((-inf, 2, 1.25, 4), (4.0, 4.0, 4.0, 7.3197, 34.999)),
    ((-inf, 2, 2, 4), (4.0, 4.0, 4.0, 8.0, 40.0)),
]
M5 = np.array([[4, -1, 0.5, 2, 0], [1, 3, -2, 0, 1], [0, 1, 5, -1, 0.25], [-2, 0, 1, 2, 1], [0.5, 1, 0, -1, 3.0]])
Q5 = np.array([-3, 1, 2, -4, -2.5])
LB5, UB5 = np.array([0, -inf, -1, -inf, 0]), np.array([inf, inf, 1, 2, inf])
Z5 = np.array([1.5, -0.25, 0.5, 1.25, 0])
PRINTED5 = (9.0, 6.0, 3.25, 6.5, 44.739)


def affine(M: np.ndarray, q: np.ndarray, lb: np.ndarray, ub: np.ndarray) -> MiCP:
    """Mz + q beside the bounds."""
    import sympy

    z = sympy.symbols(f"z:{q.size}")
    F = [sum(M[i, j] * z[j] for j in range(q.size)) + q[i] for i in range(q.size)]
    return MiCP(F=Map.from_sympy(z, F), lb=lb, ub=ub)


@pytest.mark.parametrize(("case", "printed"), PRINTED)
def test_norms_are_those_that_path_prints(case: tuple[float, ...], printed: tuple[float, ...]) -> None:
    lb, ub, z, F = case
    problem = affine(np.array([[FORCE]]), np.array([F - FORCE * z]), np.array([lb]), np.array([ub]))
    assert tuple(path_norms(problem, MiCPPoint([z])).values()) == pytest.approx(printed, rel=5e-5)


def test_norms_of_five_unknowns_are_those_that_path_prints() -> None:
    norms = path_norms(affine(M5, Q5, LB5, UB5), MiCPPoint(Z5))
    assert tuple(norms.values()) == pytest.approx(PRINTED5, rel=5e-5)


@pytest.mark.parametrize("seed", range(5))
def test_gradient_is_that_of_the_merit_function(seed: int) -> None:
    """φ is written here once more, plainly, and differentiated by differences."""
    rng = np.random.default_rng(seed)
    problem = affine(M5, Q5, LB5, UB5)
    z = np.clip(rng.standard_normal(5), LB5 + 0.05, UB5 - 0.05)

    def phi(a: float, b: float) -> float:
        return a + b - np.sqrt(a * a + b * b)

    def merit(x: np.ndarray) -> float:
        total = 0.0
        for i, F in enumerate(M5 @ x + Q5):
            inner = -phi(UB5[i] - x[i], -F) if np.isfinite(UB5[i]) else F
            total += (phi(x[i] - LB5[i], inner) if np.isfinite(LB5[i]) else inner) ** 2
        return 0.5 * total

    expected = np.abs(approx_fprime(z, merit, 1e-7)).max()
    assert path_norms(problem, MiCPPoint(z))["path_fischer_gradient"] == pytest.approx(expected, rel=1e-5)


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
        theirs = [row for row in judge_by_all(case.problem, case.point, 1e-6)[1] if row.source in sources]
        assert theirs
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


def test_osqp_by_exact_arithmetic() -> None:
    """E = [1 1; 1 0], y = −(λ, ν₁): Ez + y = (5/8, −1/4), s = (1, 0), Qz + p + Eᵀy = (−7/8, 3/2)."""
    rows = {row.name: row.value for row in judge_by_all(BOXED, POINT, 1e-6)[1]}
    primal = max(abs(Fraction(3, 4) - 1), abs(Fraction(1, 4) - 0)) / (1 + Fraction(1))
    dual = max(abs(Fraction(3, 4) - 1 - Fraction(5, 8)), abs(Fraction(5, 8) + 1 - Fraction(1, 8)))
    assert rows["osqp_primal"] == float(primal)
    assert rows["osqp_dual"] == float(dual / (1 + 1))


def test_qpbenchmark_by_qpsolvers() -> None:
    """qpsolvers has Gx ≤ h and multipliers of the opposite sign."""
    problem = qpsolvers.Problem(BOXED.Q, BOXED.p, -BOXED.A, -BOXED.b, lb=BOXED.lb, ub=BOXED.ub)
    theirs = qpsolvers.Solution(problem, found=True, x=POINT.z, z=POINT.lam, z_box=-POINT.nu)
    rows = {row.name: row.value for row in judge_by_all(BOXED, POINT, 1e-6)[1]}
    assert rows["qpbenchmark_primal"] == pytest.approx(theirs.primal_residual(), rel=1e-14)
    assert rows["qpbenchmark_dual"] == pytest.approx(theirs.dual_residual(), rel=1e-14)
    assert rows["qpbenchmark_gap"] == pytest.approx(theirs.duality_gap(), rel=1e-14)


def test_contactbench_by_exact_arithmetic() -> None:
    """W = 1: u = r + q = (−1/2, 3, 4), μ = 1/2, û = (2, 3, 4); K* is û_N ≥ ‖û_T‖/2 = 5/2, 1/2 away in û_N.

    The nearest point of K* is (2, 3, 4) + t(2, −3/5, −4/5)/√5 … with t = 1/√5: 2/5 along N, and (3, 4)/25 along T.
    """
    problem = FrictionContact(W=np.eye(3), q=[-1.5, 3.0, 4.0], mu=[0.5])
    rows = {row.name: row.value for row in judge_by_all(problem, FCPoint([1.0, 0.0, 0.0]), 1e-6)[1]}
    assert rows["contactbench_signorini [J]"] == 0.5
    assert rows["contactbench_complementarity [J]"] == 2.0
    assert rows["contactbench_dual_feasibility [m/s]"] == pytest.approx(0.4, rel=1e-15)
    assert rows["contactbench_dissipation [J]"] == 0.5 * 4.0


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
    code, told = verify("--rejudge", tmp_path / "r.sqlite", "--all-measures")
    assert code == 2
    assert "--all-measures is for one answer" in told
