"""The estimate of the time that is left: against planted populations, and a clock that the test turns."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cpbench.bench.events import Done, Solving, Starting
from cpbench.bench.pace import FEWEST, Expected, Pace, expected, recent
from cpbench.bench.pilot import EACH, draw
from cpbench.bench.planning.plan import Entry, Limits, Pair, exact
from cpbench.bench.results.rows import Outcome


def pair(problem: str, solver: str = "lemke") -> Pair:
    return Pair(
        f"{problem}.h5", problem, problem, "lcp", "", {"n": 2}, exact(), Entry(solver), "lcp", 1e-6, Limits(repeats=1)
    )


def covered(draws: int, left: int, blocks: int, seed: int) -> float:
    """The share of 400 populations whose rest takes a time within the interval; times of a block differ by a factor of
    their own."""
    random = np.random.default_rng(seed)
    hits = 0
    for _ in range(400):
        factors = np.repeat(random.lognormal(0.0, 0.5, (draws + left) // blocks), blocks)
        times = factors * random.exponential(1.0, factors.size)
        found = expected(times[:draws].tolist(), times.size - draws)
        assert found is not None
        hits += found.low <= times[draws:].sum() <= found.high
    return hits / 400


@pytest.mark.parametrize(("draws", "left", "blocks"), [(200, 2000, 1), (400, 400, 4)])
def test_the_interval_holds_the_truth_in_about_95_of_100_runs(draws: int, left: int, blocks: int) -> None:
    """An interval of half or of double its width holds it in 67 and in 99.9 of 100."""
    assert 0.90 <= covered(draws, left, blocks, 5) <= 0.985


def test_the_mean_is_that_of_the_sample() -> None:
    found = expected([0.5] * FEWEST + [1.5] * FEWEST, 30)
    assert found is not None
    assert found.mean == pytest.approx(30.0)
    assert found.low < 30.0 < found.high
    assert expected([1.0] * (FEWEST - 1), 30) is None
    even = expected([2.0] * FEWEST, 10)
    assert even is not None
    assert (even.mean, even.low, even.high) == (20.0, 20.0, 20.0)


def test_both_ends_are_printed_where_they_differ() -> None:
    assert str(Expected(170.0, 165.0, 175.0)) == "about 3 min"
    assert str(Expected(170.0, 165.0, 235.0)) == "about 3 min, 3 min to 4 min"


def test_what_a_solver_takes_to_start_is_no_part_of_the_pace() -> None:
    """A minute before the first pair and 20 s of a start belong to no pair; each takes 3 s from there on."""
    now = [0.0]
    pace = Pace(clock=lambda: now[0])
    outcome = Outcome(status="solved")
    now[0] = 60.0
    for k in range(FEWEST + 1):
        if k in (0, 7):
            pace.note(Starting("lemke"))
            now[0] += 20.0
        pace.note(Solving(pair(f"p{k}")))
        now[0] += 3.0
        pace.note(Done(pair(f"p{k}"), outcome))
    assert pace.pairs == FEWEST
    assert pace.seconds == pytest.approx(3.0 * FEWEST)
    found = pace.expected(100)
    assert found is not None
    assert found.mean == pytest.approx(300.0)


def test_a_start_holds_up_one_of_several_slots() -> None:
    now = [0.0]
    pace = Pace(slots=4, clock=lambda: now[0])
    pace.note(Done(pair("b"), Outcome(status="solved")))
    pace.note(Starting("lemke"))
    now[0] = 8.0
    pace.note(Solving(pair("a")))
    pace.note(Done(pair("a"), Outcome(status="solved")))
    assert pace.seconds == pytest.approx(8.0 - 2.0)


def test_a_pilot_sees_many_problems_where_there_are_many_solvers() -> None:
    solvers = [f"s{k}" for k in range(3 * EACH)]
    todo = [pair(f"p{k}", solver) for k in range(300) for solver in solvers]
    drawn = draw(todo, 3)
    counts = {name: sum(p.problem == name for p in drawn) for name in {p.problem for p in drawn}}
    assert set(counts.values()) == {EACH}
    assert len(counts) == math.ceil(2000 / EACH)
    assert {p.key for p in draw(todo, 3)} == {p.key for p in drawn} != {p.key for p in draw(todo, 4)}


def test_the_rest_is_estimated_by_the_pace_of_the_last_minute() -> None:
    """10 pairs a second for 100 s, then 4 a second: after 30 s half of the minute is slow, after 60 s all of it."""
    now, outcome = [0.0], Outcome(status="solved")
    pace = Pace(clock=lambda: now[0])

    def run(count: int, each: float) -> float:
        for k in range(count):
            now[0] += each
            pace.note(Done(pair(f"p{k}"), outcome))
        found = pace.expected(1000)
        assert found is not None
        return found.mean

    assert run(1000, 0.1) == pytest.approx(100.0)
    assert run(120, 0.25) == pytest.approx(1000.0 * 60.0 / (120 + 300), rel=1e-2)
    assert run(120, 0.25) == pytest.approx(250.0, rel=1e-2)


def test_slow_pairs_are_as_many_as_an_estimate_needs() -> None:
    """A minute of pairs that take 10 s would be six of them."""
    assert len(recent([1.0] * 300 + [10.0] * 150)) == 200
    assert len(recent([0.1] * 5000)) in (600, 601)
    assert len(recent([10.0] * 30)) == 30
