"""Checks of a solver: it solves what was planted, or says honestly that it did not."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from cpbench import matrices
from cpbench.errors import UnknownName
from cpbench.formulations import Kind, formulations
from cpbench.solvers.base import Budget, Claim, Solver, SolverOutput, Trait, parse_options
from cpbench.testing.cases import Case, infeasible
from cpbench.verification import certified_infeasible, judge

TOLERANCE = 1e-6
SLACK = 1.001
"""A claim at the tolerance may be rounded; nothing beyond that."""


def _run(solver: Solver, case: Case, **budget: Any) -> SolverOutput:
    return solver.run(case.problem, Budget(**{"tolerance": TOLERANCE, "seconds": 20.0, **budget}))


def _open(solver: Solver, cases: list[Case]) -> Iterator[Case]:
    """Cases that the solver takes and, by its own word (`known_failures`), does not fail on."""
    for case in cases:
        if solver.obstacle(case.problem) is None and f"case-{case.name}" not in solver.spec.known_failures:
            yield case


def _false(solver: Solver, case: Case, output: SolverOutput, tolerance: float) -> str | None:
    """What is false in a claim, if anything. A relaxation's claim is about its own problem."""
    if output.claim is not Claim.SOLVED or solver.spec.kind is Kind.RELAXATION:
        return None
    if output.point is None:
        return f"{case.name}: claims solved and gives no answer"
    error = judge(case.problem, output.point, tolerance).error
    return None if error <= SLACK * tolerance else f"{case.name}: claims solved, error {error:.1e} > {tolerance:.0e}"


def check_some_case_is_solved(solver: Solver, cases: list[Case]) -> None:
    """One at least whose solution is not simply 0."""
    if solver.spec.kind is Kind.RELAXATION:
        return
    for case in _open(solver, cases):
        if not judge(case.problem, case.problem.zero_point(), TOLERANCE).solved:
            point = _run(solver, case).point
            if point is not None and judge(case.problem, point, TOLERANCE).solved:
                return
    raise AssertionError("no planted case is solved")


def check_claims_are_true(solver: Solver, cases: list[Case]) -> None:
    for tolerance in (1e-4, TOLERANCE):
        for case in _open(solver, cases):
            why = _false(solver, case, _run(solver, case, tolerance=tolerance), tolerance)
            assert why is None, why


def check_one_iteration_claims_nothing_false(solver: Solver, cases: list[Case]) -> None:
    for case in _open(solver, cases):
        why = _false(solver, case, _run(solver, case, iterations=1), TOLERANCE)
        assert why is None, why


def check_answers_have_their_shape(solver: Solver, cases: list[Case]) -> None:
    for case in _open(solver, cases):
        output = _run(solver, case)
        if output.point is not None:
            sizes = {name: value.size for name, value in output.point.arrays().items()}
            assert sizes == case.problem.point_sizes, f"{case.name}: the answer has sizes {sizes}"
        assert isinstance(output.claim, Claim)
        assert all(isinstance(v, int) and v >= 0 for v in output.counters.values()), output.counters


def check_the_problem_stays(solver: Solver, cases: list[Case]) -> None:
    for case in _open(solver, cases):
        before = {k: matrices.digest(v) for k, v in case.problem.data().items()}
        _run(solver, case)
        assert before == {k: matrices.digest(v) for k, v in case.problem.data().items()}, case.name


def check_infeasibility_is_proved_or_not_claimed_solved(solver: Solver, cases: list[Case]) -> None:
    """The node's problems without a solution, where it has any: never solved; a certificate must hold."""
    for case in infeasible(solver.spec.node):
        if solver.obstacle(case.problem) is None:
            try:
                output = _run(solver, case)
            except Exception:  # no claim: the runner gives it a row of its own
                continue
            assert output.claim is not Claim.SOLVED, f"{case.name}: claims to solve what has no solution"
            if output.certificate is not None:
                assert certified_infeasible(case.problem, output.certificate), f"{case.name}: the certificate is false"


def check_the_same_twice(solver: Solver, cases: list[Case]) -> None:
    if Trait.DETERMINISTIC not in solver.spec.traits:
        return
    for case in _open(solver, cases):
        first, second = _run(solver, case), _run(solver, case)
        assert first.claim is second.claim, case.name
        assert (first.point is None) == (second.point is None), case.name
        if first.point is not None and second.point is not None:
            for a, b in zip(first.point.arrays().values(), second.point.arrays().values(), strict=True):
                np.testing.assert_array_equal(a, b, err_msg=case.name)


def check_warm_starts_are_taken(solver: Solver, cases: list[Case]) -> None:
    """Started from a solution, a solver with the trait ends in a true claim."""
    if Trait.WARM_START not in solver.spec.traits:
        return
    for case in _open(solver, cases):
        output = solver.run(case.problem, Budget(tolerance=TOLERANCE), start=case.point)
        why = _false(solver, case, output, TOLERANCE)
        assert why is None, why


def check_options_are_known_by_name(solver: Solver, cases: list[Case]) -> None:
    with pytest.raises(UnknownName, match="option"):
        parse_options(solver.spec, {"no_such_option": "1"})
    assert parse_options(solver.spec, {}) == solver.spec.options()


def check_the_spec_is_complete(solver: Solver, cases: list[Case]) -> None:
    spec = solver.spec
    assert spec.node in formulations
    assert spec.summary
    assert spec.method
    assert spec.licence
    assert inspect.getdoc(type(solver)), "the class has no docstring"
    assert all(reason for reason in spec.known_failures.values())
