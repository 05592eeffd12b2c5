"""How far data may change before a proof fails: against closed forms, and against problems drawn within the margin."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog
from test_certificates import infeasible_lcp, infeasible_mlcp, infeasible_qp

import cpbench
from cpbench.formulations import LCP, MLCP, QP
from cpbench.formulations.base import Problem
from cpbench.proofs import holds, prove
from cpbench.proofs.certificates import Infeasible
from cpbench.proofs.margins import contradiction
from cpbench.proofs.polyhedra import conditions

ALL = 1.0
"""A tolerance that no margin reaches, so that the best one is searched for."""
PAIR = np.array([[1.0, -1.0], [1.0, -1.0]])


def program(**conditions: object) -> QP:
    n = next(np.shape(v)[-1] for v in conditions.values())
    return QP.build(np.eye(n), np.zeros(n), **conditions)  # type: ignore[arg-type]


def between(kappa: float) -> dict[str, Problem]:
    """x ≥ 1 and x ≤ 1 − κ, written in several ways."""
    low, none = np.ones((1, 1)), np.zeros((0, 0))
    return {
        "rows": program(A=np.array([[1.0], [-1.0]]), b=[1.0, kappa - 1.0]),
        "equalities": program(C=np.ones((2, 1)), d=[1.0, 1.0 - kappa]),
        "a bound": program(A=low, b=[1.0], ub=[1.0 - kappa]),
        "sums": program(C=np.ones((2, 2)), d=[1.0, 1.0 - kappa], lb=np.zeros(2)),
        "lcp": LCP(M=np.array([[1.0, 0.0], [-1.0, 0.0]]), q=[-1.0, 1.0 - kappa]),
        "mlcp": MLCP(A=none, B=np.array([[1.0, 0.0], [-1.0, 0.0]]), C=np.zeros((0, 2)), D=np.zeros((2, 0)),
                     a=np.zeros(0), b=[-1.0, 1.0 - kappa]),
    }  # fmt: skip


def falling(kappa: float) -> dict[str, QP]:
    """Objectives that fall along the ray (1, 1) by κ, in slope or in curvature."""
    level = {"C": np.array([[1.0, -1.0]]), "d": [0.0], "lb": np.zeros(2)}
    side = -1.0 - kappa / 2.0
    return {
        "a slope": QP.build(np.zeros((2, 2)), [-1.0, 1.0 - kappa], **level),
        "a curvature": QP.build(np.array([[1.0, side], [side, 1.0]]), np.zeros(2), **level),
    }  # fmt: skip


def proved_and_refused(wide: Problem, narrow: Problem, claim: str, tolerance: float) -> str:
    """Assert that the claim is proved of `wide` only, and return what is said of `narrow`."""
    attempt = prove(wide, claim, tolerance=tolerance)
    assert attempt.proof is not None, attempt.message
    assert holds(wide, attempt.proof, tolerance)
    attempt = prove(narrow, claim, tolerance=tolerance)
    assert attempt.proof is None
    assert 0.0 < attempt.margin < tolerance
    return attempt.message


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("name", between(0.5))
def test_a_contradiction_of_a_hundred_tolerances_is_proved_and_of_one_is_not(name: str, tolerance: float) -> None:
    wide, narrow = between(100.0 * tolerance)[name], between(tolerance)[name]
    message = proved_and_refused(wide, narrow, "infeasible", tolerance)
    assert "the numbers in the file contradict each other by" in message


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("name", falling(0.5))
def test_a_fall_of_two_hundred_tolerances_is_proved_and_of_a_tenth_is_not(name: str, tolerance: float) -> None:
    wide, narrow = falling(200.0 * tolerance)[name], falling(0.1 * tolerance)[name]
    message = proved_and_refused(wide, narrow, "unbounded", tolerance)
    assert "along a ray the objective falls by" in message


def test_the_tolerance_is_1e6_where_none_is_given() -> None:
    assert prove(between(36e-6)["rows"], "infeasible").proof is not None  # margins of 1.5e-6 and 0.7e-6
    assert prove(between(17e-6)["rows"], "infeasible").proof is None


@pytest.mark.parametrize("kappa", [0.3, 1e-3, 1e-9])
@pytest.mark.parametrize("name", ["rows", "equalities"])
def test_the_margin_is_the_one_of_the_sum_of_the_conditions(name: str, kappa: float) -> None:
    """(1 ± t)x ≥ 1 − t − t and (1 ± t)x ≤ 1 − κ + t(1 − κ) + t with |x| ≤ 10: κ ≤ t(2 − κ + 2 + 20)."""
    exact = kappa / (24.0 - kappa)
    found = prove(between(kappa)[name], "infeasible", tolerance=ALL).margin
    assert 0.9 * exact <= found <= exact


@pytest.mark.parametrize("kappa", [0.1, 1e-5])
def test_solutions_up_to_ten_times_what_is_asked_are_excluded(kappa: float) -> None:
    """x₁ − x₂ = 1 and = 1 − κ with 0 ≤ x ≤ u: κ ≤ t(2 − κ + 2 + 2R₁ + 2R₂), R = 2u + 1 where that is less than 10."""
    for ub, far in ((np.inf, 10.0), (1e3, 10.0), (1.5, 4.0)):
        problem = program(C=PAIR, d=[1.0, 1.0 - kappa], lb=np.zeros(2), ub=np.full(2, ub))
        known = conditions(problem)
        assert known is not None
        assert known.sizes.reach.tolist() == [far, far]
        exact = kappa / (4.0 - kappa + 4.0 * far)
        found = prove(problem, "infeasible", tolerance=ALL).margin
        assert 0.9 * exact <= found <= exact


@pytest.mark.parametrize("side", [1e-17, 7e-18, 1e-14])
def test_a_side_that_is_rounding_contradicts_nothing(side: float) -> None:
    """0·z ≥ side and z₁ − z₂ ≥ side, z₂ − z₁ ≥ 0, beside rows that ask for 100, and beside limits of 100 that ask for
    nothing."""
    far = {"A": np.array([[1.0, 1.0]]), "b": [100.0]}
    limits = {"lb": np.full(2, -100.0), "ub": np.full(2, 100.0)}
    for row in ([[0.0, 0.0]], [[1.0, -1.0], [-1.0, 1.0]]):
        sides = [side, 0.0][: len(row)]
        asked = program(A=np.vstack([far["A"], row]), b=[*far["b"], *sides])
        limited = program(A=np.array(row), b=sides, **limits)
        for problem in (asked, limited):
            given = prove(problem, "infeasible", np.append(np.zeros(problem.b.size - len(row)), np.ones(len(row))))
            assert given.proof is None
            assert given.margin < 1e-7


def test_limits_that_nothing_asks_for_count_by_a_millionth() -> None:
    """x₁ − x₂ ≥ κ and ≤ 0 in a box of 100: κ ≤ t(κ + 2s + 2R₁ + 2R₂) with s = 1e-4 and R = 10 s."""
    kappa, limit = 1e-9, np.full(2, 100.0)
    problem = program(A=np.array([[1.0, -1.0], [-1.0, 1.0]]), b=[kappa, 0.0], lb=-limit, ub=limit)
    exact = kappa / (kappa + 42.0 * 1e-4)
    found = prove(problem, "infeasible", np.ones(2), tolerance=ALL).margin
    assert 0.9 * exact <= found <= exact * 1.01


def test_a_row_without_entries_that_asks_for_as_much_as_others_is_a_contradiction() -> None:
    rows = np.array([[1.0, 1.0], [0.0, 0.0]])
    for others in (1.0, -1.0, 1e3):
        assert prove(program(A=rows, b=[others, 1.0]), "infeasible").proof is not None
    limits = {"lb": np.full(2, -1e3), "ub": np.full(2, 1e10)}  # which ask for nothing
    assert prove(program(A=rows, b=[1.0, 1.0], **limits), "infeasible").proof is not None


def test_a_part_beside_sets_no_size() -> None:
    """A problem of size 1e4 that nothing connects leaves the margin what it is; an objective of that size does not."""
    alone = program(C=PAIR, d=[1.0, 0.9], lb=np.zeros(2))
    C = np.block([[PAIR, np.zeros((2, 1))], [np.zeros((1, 2)), np.ones((1, 1))]])
    beside = program(C=C, d=[1.0, 0.9, 1e4], lb=np.zeros(3))
    large = dataclasses.replace(alone, p=np.full(2, -1e4))
    found = [prove(problem, "infeasible", tolerance=ALL).margin for problem in (alone, beside, large)]
    assert found[0] == pytest.approx(found[1], rel=0.05)
    assert found[2] == pytest.approx(1e-4 * found[0], rel=0.2)


def test_a_contradiction_that_is_small_beside_the_solution_is_none() -> None:
    """x₁ = x₂ and x₁ = x₂ + 1e-12, where a bound or the objective alone puts the solution at 1."""
    pair = {"C": PAIR, "d": [0.0, 1e-12]}
    for problem in (
        QP.build(np.zeros((2, 2)), [-1.0, 0.0], ub=np.ones(2), lb=np.zeros(2), **pair),
        QP.build(np.eye(2), [-1.0, -1.0], **pair),
    ):
        attempt = prove(problem, "infeasible", np.array([-1.0, 1.0]))
        assert attempt.proof is None
        assert 0.0 < attempt.margin < 1e-7


def test_a_bound_that_stands_for_none_hides_no_contradiction_from_the_search() -> None:
    """z ≤ 1e15 beside z₁ ≥ 1, z₁ ≤ ½: the row of 1e15 is idle."""
    problem = program(A=np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]]), b=[1.0, -0.5, -1e15])
    assert prove(problem, "infeasible").proof is not None


@pytest.mark.parametrize("make", [infeasible_lcp, infeasible_mlcp, infeasible_qp])
def test_no_problem_within_the_margin_has_a_solution_within_reach(make) -> None:
    """Problems drawn at corners of the box of data, sides as loose as they may be, solved by HiGHS."""
    rng = np.random.default_rng(7)
    for seed in range(12):
        problem = make(seed)
        attempt, known = prove(problem, "infeasible"), conditions(problem)
        assert isinstance(attempt.proof, Infeasible)
        assert known is not None
        size, far, m = known.sizes, known.sizes.reach, known.h.size
        t = 0.99 * float(contradiction(known, attempt.proof.multipliers))

        def changed(matrix: object, t: float = t) -> np.ndarray:
            A = np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix)  # type: ignore[union-attr]
            return A * (1 + t * rng.choice([-1.0, 1.0], A.shape))

        def lowered(sides: np.ndarray, sizes: np.ndarray, t: float = t) -> np.ndarray:
            return sides - t * (np.abs(sides) + sizes)

        rows = np.flatnonzero(np.isfinite(known.h))
        h, low, high = lowered(known.h, size.rows[:m]), lowered(known.f, size.rows[m:]), -known.f
        lb, ub = lowered(known.lb, size.unknowns), -lowered(-known.ub, size.unknowns)
        high = lowered(high, size.rows[m:])
        bounds = np.stack([np.maximum(lb / far, -1.0), np.minimum(ub / far, 1.0)], 1)  # x in units of R
        if (bounds[:, 0] > bounds[:, 1]).any():
            continue
        for _ in range(5):
            G, E = changed(known.G)[rows] * far, changed(known.E) * far
            A, b = np.vstack([G, E, -E]), np.concatenate([h[rows], low, high])
            up = 1.0 / np.abs(A).max(axis=1, initial=1e-300)  # HiGHS' tolerance is absolute
            found = linprog(np.zeros(far.size), -A * up[:, None], -b * up, bounds=bounds)
            assert found.status == 2, (seed, found.message)


def test_units_change_a_margin_by_little() -> None:
    """Rows and unknowns in units of powers of two: R is in units of about one."""
    for seed in range(1, 30, 2):
        rng, problem = np.random.default_rng(seed), infeasible_qp(seed)
        row, column = 2.0 ** rng.integers(-20, 20, problem.b.size), 2.0 ** rng.integers(-20, 20, problem.p.size)
        scaled = dataclasses.replace(
            problem, Q=problem.Q * column[:, None] * column, p=problem.p * column, A=problem.A * row[:, None] * column,
            b=np.where(problem.b > -1e19, problem.b * row, problem.b), C=problem.C * column, lb=problem.lb / column,
            ub=problem.ub / column,
        )  # fmt: skip
        found = [prove(one, "infeasible", tolerance=ALL).margin for one in (problem, scaled)]
        assert 1 / 8 <= found[0] / found[1] <= 8, seed


def test_a_real_program_whose_rounding_contradicts_itself_is_not_infeasible(shared_data: Path) -> None:
    """QBORE3D (Maros and Mészáros 1999): its doubles have no solution, by less than 1e-16 of their size."""
    problem = cpbench.load(shared_data / "qp" / "QBORE3D.mat")
    attempt = prove(problem, "infeasible")
    assert attempt.proof is None
    assert attempt.margin < 1e-15
