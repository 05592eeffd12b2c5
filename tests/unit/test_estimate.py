"""How long a run may take, from what was measured on the same problems, by hand."""

from __future__ import annotations

import pytest

from cpbench.api.estimate import NOTHING, SolveTimes, Span, shipped_times, solves
from cpbench.bench.planning.plan import Entry, Limits, Pair, Request, exact
from cpbench.generators.collection import catalogue
from cpbench.solvers.base import solvers

TIMES = {"fast": 0.5, "slow": 20.0, "failing": None}
MEASURED: SolveTimes = {"a": TIMES, "b": {**TIMES, "elsewhere": 1.0}}


def pair(solver: str, request: Request | None = None, fingerprint: str = "a") -> Pair:
    limits = Limits(seconds=10.0, repeats=3)
    return Pair("p.h5", "p", fingerprint, "lcp", "made", {}, request or exact(), Entry(solver), "lcp", 1e-6, limits)


def test_a_pair_takes_what_was_measured_or_what_others_took_on_its_problem() -> None:
    """A time below a second is repeated, 3 · 0.5; one beyond the limit ends there; 5.75 is the mean of the two."""
    approximate = Request("inner8")
    todo = [pair("fast"), pair("slow"), pair("failing"), pair("fast", approximate), pair("elsewhere"), pair("new")]
    others = Span(5.75, 10.0)
    assert solves(todo, MEASURED) == ([Span(1.5, 1.5), Span(10.0, 10.0), others, others, NOTHING, others], 2)


def test_a_problem_without_measurements_has_no_time() -> None:
    assert solves([pair("fast", fingerprint="unknown")], MEASURED) == ([None], 0)


def test_a_range_says_both_ends_where_they_differ() -> None:
    assert str(Span(1000.0, 2900.0)) == "17 min to 49 min"
    assert str(Span(1.5, 1.5) + NOTHING * 2) == "about 1.5 s"


@pytest.mark.needs("cpbench_solvers")
def test_the_shipped_times_are_of_problems_of_the_collection_and_of_solvers_that_may_be_named() -> None:
    known = shipped_times()
    here = {entry.fingerprint for entry in catalogue()}
    assert len(known) >= 200
    assert set(known) <= here
    labels = {label for times in known.values() for label in times}
    assert all(label in solvers and not solvers.get(label).spec.publishing for label in labels)
    assert all(time is None or time > 0 for times in known.values() for time in times.values())
