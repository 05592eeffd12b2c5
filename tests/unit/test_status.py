"""One status for every verdict, claim, promise and measure of the solver's own problem."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from cpbench.errors import PointError
from cpbench.formulations.base import Kind
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.formulations.local_contact import FrictionContact
from cpbench.solvers.base import Claim
from cpbench.verification import (
    CHARGED_TO_ROUTE,
    FALSE_CLAIMS,
    INACCURATE_FACTOR,
    PROVEN,
    VERIFIED,
    Status,
    Verdict,
    judge,
    no_answer,
    status,
)

TOLERANCE = 1e-6
MET, CLOSE, FAR = 1e-7, 5e-5, 1e-2
INEXACT = (Kind.NECESSARY, Kind.APPROXIMATE, Kind.RELAXATION)


def verdict(error: float, *flags: str, tolerance: float = TOLERANCE) -> Verdict:
    return Verdict(tolerance, error <= tolerance and "unresolvable" not in flags, error, flags=flags)


@pytest.mark.parametrize(
    ("error", "target", "kind", "claim", "expected"),
    [
        # what was measured on the problem that was asked comes first, whoever claimed what
        (MET, None, "equivalent", "solved", "solved"),
        (MET, FAR, "equivalent", "failed", "solved"),
        (MET, FAR, "approximate", "infeasible", "solved"),
        # nothing is known of the solver's own problem: it is the one that was asked, or an older file
        (CLOSE, None, "equivalent", "solved", "inaccurate"),
        (CLOSE, None, "equivalent", "inaccurate", "inaccurate"),
        (CLOSE, None, "equivalent", "max_iter", "max_iter"),
        (CLOSE, None, "equivalent", "failed", "failed"),
        (FAR, None, "equivalent", "solved", "wrong"),
        (FAR, None, "one-way", "solved", "wrong"),
        (FAR, None, "equivalent", "inaccurate", "failed"),
        (FAR, None, "equivalent", "infeasible", "failed"),
        (FAR, None, "equivalent", "unbounded", "failed"),
        (math.inf, None, "equivalent", "inaccurate", "failed"),
        (math.inf, None, "equivalent", "solved", "wrong"),
        # the solver met its target: the route is charged, whoever claimed what
        (CLOSE, MET, "equivalent", "solved", "lost"),
        (FAR, MET, "equivalent", "solved", "lost"),
        (math.inf, MET, "one-way", "solved", "lost"),
        (FAR, MET, "equivalent", "max_iter", "lost"),
        (FAR, MET, "approximate", "solved", "approximate"),
        (FAR, MET, "necessary", "solved", "approximate"),
        (FAR, MET, "relaxation", "failed", "approximate"),
        # it missed its own target
        (FAR, FAR, "equivalent", "solved", "wrong"),
        (FAR, FAR, "approximate", "solved", "wrong"),
        (FAR, FAR, "relaxation", "inaccurate", "failed"),
        (FAR, FAR, "approximate", "max_iter", "max_iter"),
        (FAR, CLOSE, "equivalent", "solved", "inaccurate"),
        (FAR, CLOSE, "approximate", "inaccurate", "inaccurate"),
        (CLOSE, FAR, "equivalent", "solved", "inaccurate"),
        # a solver that drops a term by itself solves a problem that nobody has
        (FAR, None, "relaxation", "solved", "approximate"),
        (FAR, None, "relaxation", "failed", "failed"),
        (FAR, None, "relaxation", "inaccurate", "failed"),
    ],
)
def test_every_row_of_the_table(error: float, target: float | None, kind: str, claim: str, expected: str) -> None:
    there = None if target is None else verdict(target)
    assert status(verdict(error), claim, kind=Kind(kind), target=there) == expected


def test_flags_decide_where_they_are_about_the_answer() -> None:
    assert status(verdict(MET, "stationary"), "solved") == Status.STATIONARY
    assert status(verdict(MET, "stationary"), "solved", proven_unbounded=True) == Status.UNBOUNDED
    assert status(verdict(FAR, "stationary"), "solved") == Status.WRONG
    assert status(verdict(FAR, "scale"), "failed") == Status.FAILED
    for claim in Claim:
        assert status(verdict(MET, "unresolvable"), claim) == Status.UNRESOLVABLE
        assert status(verdict(FAR, "unresolvable"), claim) == Status.UNRESOLVABLE
        assert status(verdict(FAR), claim, target=verdict(FAR, "unresolvable")) == Status.UNRESOLVABLE
        assert status(verdict(FAR), claim, target=verdict(MET, "unresolvable")) == Status.UNRESOLVABLE
        assert status(verdict(MET), claim, target=verdict(FAR, "unresolvable")) == Status.SOLVED


def test_a_proof_is_a_status_of_its_own_but_never_beside_an_answer() -> None:
    for claim in Claim:
        assert status(verdict(FAR), claim, proven_infeasible=True) == Status.INFEASIBLE
        assert status(verdict(FAR), claim, proven_unbounded=True) == Status.UNBOUNDED
        assert status(verdict(MET), claim, proven_infeasible=True) == Status.SOLVED


def test_the_target_is_held_against_its_own_tolerance() -> None:
    """An edge may ask for more than the source needs; what was asked for counts."""
    there = verdict(1e-7, tolerance=1e-9)
    assert status(verdict(FAR), "solved", target=there) == Status.INACCURATE
    assert status(verdict(FAR), "solved", target=verdict(1e-6, tolerance=1e-9)) == Status.WRONG
    assert status(verdict(FAR), "solved", target=verdict(1e-9, tolerance=1e-9)) == Status.LOST


def test_a_solver_is_accused_only_where_it_missed_its_own_target() -> None:
    """Every combination: no rule charges two, none leaves an answer without a status."""
    errors = (MET, CLOSE, FAR, math.inf)
    for error, there, kind, claim in itertools.product(errors, (None, *errors), Kind, Claim):
        found = status(verdict(error), claim, kind=kind, target=None if there is None else verdict(there))
        case = (error, there, kind, claim, found)
        assert (found in VERIFIED) == (error <= TOLERANCE), case
        assert found not in PROVEN, case
        if found in FALSE_CLAIMS:
            assert claim in ("solved", "inaccurate"), case
            assert there is None or there > TOLERANCE, case
        if found in CHARGED_TO_ROUTE:
            assert error > TOLERANCE, case
            assert there is None or there <= TOLERANCE, case
        if found == Status.INACCURATE:
            assert min(error, math.inf if there is None else there) <= INACCURATE_FACTOR * TOLERANCE, case
        if found == Status.LOST:
            assert kind.exact, case
        if found == Status.APPROXIMATE:
            assert kind in INEXACT, case


# ----------------------------------------------------------------------- answers that once were called close


def _contact() -> tuple[FrictionContact, np.ndarray]:
    """One contact that sticks: W = I, u = Wr + q = 0 at r = −q."""
    r = np.array([1.0, 0.1, 0.0])
    return FrictionContact(W=np.eye(3), q=-r, mu=[0.5], dimension=3), r


@pytest.mark.parametrize("claim", Claim)
@pytest.mark.parametrize(
    "corrupted", [lambda r: 2 * r, lambda r: 0 * r, lambda r: r * np.nan, lambda r: np.where(r == 1.0, np.inf, r)]
)
def test_a_far_answer_is_never_inaccurate(claim: Claim, corrupted: object) -> None:
    problem, r = _contact()
    assert status(judge(problem, FCPoint(r), 1e-9), claim) == Status.SOLVED
    found = status(judge(problem, FCPoint(corrupted(r)), 1e-6), claim)  # type: ignore[operator]
    assert found == {"solved": "wrong", "max_iter": "max_iter"}.get(claim, "failed")


def test_nothing_is_not_close_to_anything() -> None:
    found = [str(status(no_answer(TOLERANCE), claim)) for claim in ("inaccurate", "infeasible", "unbounded", "failed")]
    assert found == ["failed"] * 4
    assert status(no_answer(TOLERANCE), "max_iter") == Status.MAX_ITER


def test_imaginary_parts_are_no_part_of_an_answer() -> None:
    problem = LCP(M=np.eye(2), q=[-1.0, -1.0])
    assert judge(problem, problem.point_from_vector([1.0, 1.0]), TOLERANCE).solved
    for given in ([1 + 1j, 1], np.array([1.0, 1.0], dtype=complex), [1.0, np.complex128(1)]):
        with pytest.raises(PointError, match=r"lcp: the answer is not a vector of numbers .*complex"):
            problem.point_from_vector(given)
    with pytest.raises(PointError, match="complex"):
        LCPPoint(z=np.array([1 + 1j, 1.0]))
