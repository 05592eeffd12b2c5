"""How far data may change before a proof fails: against closed forms, and against problems drawn within the margin."""

from __future__ import annotations

import dataclasses
from fractions import Fraction
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
from cpbench.proofs.margins import FarkasMultipliers, reach
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
def test_a_contradiction_of_ten_tolerances_is_proved_and_of_a_tenth_is_not(name: str, tolerance: float) -> None:
    wide, narrow = between(10.0 * tolerance)[name], between(0.1 * tolerance)[name]
    message = proved_and_refused(wide, narrow, "infeasible", tolerance)
    assert "the numbers in the file contradict each other by" in message


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("name", falling(0.5))
def test_a_fall_of_a_hundred_tolerances_is_proved_and_of_a_tenth_is_not(name: str, tolerance: float) -> None:
    wide, narrow = falling(100.0 * tolerance)[name], falling(0.1 * tolerance)[name]
    message = proved_and_refused(wide, narrow, "unbounded", tolerance)
    assert "along a ray the objective falls by" in message


def test_the_tolerance_is_1e6_where_none_is_given() -> None:
    assert prove(between(6e-6)["rows"], "infeasible").proof is not None  # margins of 1.5e-6 and 0.7e-6
    assert prove(between(2.8e-6)["rows"], "infeasible").proof is None


@pytest.mark.parametrize("kappa", [0.3, 1e-3, 1e-9])
@pytest.mark.parametrize("name", ["rows", "equalities"])
def test_the_margin_is_the_one_of_the_interval_problem(name: str, kappa: float) -> None:
    """(1 + t)x ≥ 1 − t and (1 − t)x ≤ (1 − κ)(1 + t) have a solution x > 0 from ((1 − t)/(1 + t))² = 1 − κ on."""
    root = np.sqrt(1.0 - kappa)
    exact = kappa / (1.0 + root) ** 2  # (1 − root)/(1 + root)
    found = prove(between(kappa)[name], "infeasible", tolerance=ALL).margin
    assert 0.9 * exact <= found <= exact * (1 + 1e-9)


@pytest.mark.parametrize("kappa", [0.1, 1e-5])
def test_solutions_up_to_ten_times_what_is_asked_are_excluded(kappa: float) -> None:
    """x₁ − x₂ = 1 and = 1 − κ with x ≥ 0: κ = t(2 − κ) + 2t(x₁ + x₂) at the nearest problem with a solution x ≤ R."""
    problem = program(C=PAIR, d=[1.0, 1.0 - kappa], lb=np.zeros(2))
    known = conditions(problem)
    assert known is not None
    assert reach(known).tolist() == [10.0, 10.0]
    exact = kappa / (2.0 - kappa + 2.0 * 20.0)
    found = prove(problem, "infeasible", tolerance=ALL).margin
    assert 0.9 * exact <= found <= exact


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
        attempt = prove(problem, "infeasible")
        assert attempt.proof is None
        assert 0.0 < attempt.margin < 1e-12


def test_a_bound_that_stands_for_none_hides_no_contradiction_from_the_search() -> None:
    """z ≤ 1e15 beside z₁ ≥ 1, z₁ ≤ ½: the row of 1e15 is idle."""
    problem = program(A=np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]]), b=[1.0, -0.5, -1e15])
    assert prove(problem, "infeasible").proof is not None


@pytest.mark.parametrize("make", [infeasible_lcp, infeasible_mlcp, infeasible_qp])
def test_no_problem_within_the_margin_has_a_solution_within_reach(make) -> None:
    """Problems drawn at corners of the box of data, solved by HiGHS."""
    rng = np.random.default_rng(7)
    for seed in range(12):
        problem = make(seed)
        attempt, known = prove(problem, "infeasible"), conditions(problem)
        assert isinstance(attempt.proof, Infeasible)
        assert known is not None
        far = reach(known)
        best = FarkasMultipliers(known, attempt.proof.multipliers, far)
        t = 0.99 * best.margin()
        assert best.survives(Fraction(t))
        assert not best.survives(Fraction(1.3 * t)) or t > 0.38

        def changed(x: object, t: float = t) -> np.ndarray:
            x = np.asarray(x.toarray() if hasattr(x, "toarray") else x)  # type: ignore[union-attr]
            finite = np.where(np.isfinite(x), x, 0.0)
            return np.where(np.isfinite(x), finite * (1 + t * rng.choice([-1.0, 1.0], x.shape)), x)

        for _ in range(5):
            rows = np.flatnonzero(np.isfinite(known.h))
            G, h, E, f = changed(known.G)[rows] * far, changed(known.h)[rows], changed(known.E) * far, changed(known.f)
            up, level = (1.0 / np.abs(M).max(axis=1, initial=1e-300) for M in (G, E))  # HiGHS' tolerance is absolute
            unit = 1.0 / np.maximum(far, 1e-300)  # x in units of R
            bounds = np.stack(
                [np.maximum(changed(known.lb) * unit, -1.0), np.minimum(changed(known.ub) * unit, 1.0)], 1
            )
            if (bounds[:, 0] > bounds[:, 1]).any():
                continue
            found = linprog(np.zeros(far.size), -G * up[:, None], -h * up, E * level[:, None], f * level, bounds)
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
    assert 0.0 < attempt.margin < 1e-15
    assert "the numbers in the file contradict each other by" in attempt.message
