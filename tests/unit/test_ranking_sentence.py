"""Sentences of rankings of made-up tables: each says what such a table supports, and no more."""

from __future__ import annotations

import math
from fractions import Fraction
from math import comb

import pandas as pd
import pytest
from synthetic_results import row

from cpbench.analysis import table as rows_of
from cpbench.analysis.ranking import Ranking, rankings
from cpbench.analysis.ranking_order import LEVEL, mcnemar, tiers
from cpbench.analysis.ranking_sentence import FEW, TIE, ratio

Rows = list[dict[str, object]]


def _ranked(rows: Rows) -> Ranking:
    [found] = rankings(rows_of.normalised(pd.DataFrame(rows)))
    return found


def _all(count: int, label: str, seconds: float, missed: dict[int, str] | None = None, **given: object) -> Rows:
    """Rows of a solver on so many problems, of which it solves all but those that are missed."""
    lacks = missed or {}
    return [row(f"p-{k:03}", label, lacks.get(k, "solved"), seconds, **given) for k in range(count)]


def _near_miss() -> Rows:
    """One step of 200 is missed by a factor of 1.19; the only solver with all of them is 99 times slower."""
    ours = _all(200, "ours", 1e-3, {36: "inaccurate"})
    ours[36]["error"] = 1.19e-6
    return [*ours, *_all(200, "theirs", 0.099)]


def _denied() -> Rows:
    rows = [*_all(20, "lemke", 2.0), *_all(20, "denier", 1.0, {7: "failed"})]
    rows[27]["claim"] = "infeasible"
    return rows


def _lost(count: int, lost: int) -> Rows:
    return _all(count, "osqp", 1e-3, dict.fromkeys(range(lost), "lost"), route="lcp-qp")


TABLES: dict[str, tuple[Rows, str]] = {
    # 1 against 0 discordant problems is p = 1: no difference, so that the factor of 99 decides
    "one miss of 200": (
        _near_miss(),
        "lcp: use ours: it solves 199 of 200 problems, 99 times faster than theirs, the only one with 200; "
        "it missed p-036 (error 1.2 times the tolerance).",
    ),
    # 6 against 0 is p = 1/32 < 5 %: a difference, so that the number of problems decides
    "six misses of 200": (
        [*_all(200, "quick", 1e-3, dict.fromkeys(range(6), "timeout")), *_all(200, "steady", 0.1017)],
        "lcp: use steady: it solves 200 of 200 problems, alone on 6; "
        "quick is 102 times faster on the 194 that both solve.",
    ),
    # two problems tell hardly anything
    "two problems": (
        [*_all(2, "nsgs", 1.0), *_all(2, "slow", 3.0)],
        "lcp: a hint from 2 problems: nsgs solves 2 of 2, fastest on 2.",
    ),
    # one miss of three costs the limit of 10 s: (0.1·0.1·10)^(1/3) = 0.46 s is more than the 0.25 s of the other
    "a fast solver with a miss of three": (
        [*_all(3, "quick", 0.1, {2: "failed"}), *_all(3, "steady", 0.25)],
        "lcp: a hint from 3 problems: steady solves 3 of 3, alone on 1; "
        "quick is 2.5 times faster on the 2 that both solve.",
    ),
    # as many solved in the same time
    "a tie": (
        [*_all(20, "one", 1.0), *_all(20, "two", 1.05)],
        "lcp: use one: it solves 20 of 20 problems, fastest on 20; two is as good: 20 solved in 1.05 times the time.",
    ),
    # the conversion is charged with it: there is nothing to say of the solver
    "all lost": (_lost(12, 12), "lcp: no solver solved any of 12 problems; lcp-qp lost 12 answers of osqp."),
    # 18 of 60 answers of a fast solver are lost: it solves all of the others, and gives 18 answers fewer
    "some lost": (
        [*_lost(60, 18), *_all(60, "lemke", 2e-3)],
        "lcp: use lemke: it solves 60 of 60 problems, alone on 18; osqp is 2 times faster on the 42 that both solve.",
    ),
    # a claim that there is no solution, beside a verified answer: fast, and not to be trusted
    "false claim of no solution": (
        _denied(),
        "lcp: use denier: it solves 19 of 20 problems, 2 times faster than lemke, the only one with 20; "
        "it missed p-007 (failed); claims that fail 1, so check its answers.",
    ),
    # nothing is compared
    "one solver": (_all(12, "s", 1.0, {0: "timeout"}), "lcp: only s ran: it solves 11 of 12 problems."),
    "none solved": (
        [*_all(3, "s", 1.0, dict.fromkeys(range(3), "failed")), *_all(3, "t", 1.0, dict.fromkeys(range(3), "timeout"))],
        "lcp: no solver solved any of 3 problems.",
    ),
    # what the solver could not be started on is not charged to it; it gives 8 answers fewer all the same
    "a part of the problems": (
        [*_all(20, "part", 1e-3, dict.fromkeys(range(8), "unsupported")), *_all(20, "whole", 1.0)],
        "lcp: use whole: it solves 20 of 20 problems, alone on 8; "
        "part is 1000 times faster on the 12 that both solve.",
    ),
    # problems without a solution are left out
    "proved to have no solution": (
        [*_all(11, "s", 1.0, {0: "infeasible"}), *_all(11, "t", 3.0, {0: "failed"})],
        "lcp: use s: it solves 10 of 10 problems, fastest on 10. 1 more was proved to have no solution.",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_a_made_up_table_gets_its_sentence(name: str) -> None:
    rows, sentence = TABLES[name]
    assert _ranked(rows).sentence == sentence


def test_lost_answers_are_counted_by_themselves() -> None:
    found = {one.solver: one for one in _ranked(TABLES["some lost"][0]).rows}
    assert (found["osqp"].solved, found["osqp"].counted, found["osqp"].lost, found["osqp"].started) == (42, 42, 18, 60)
    assert (found["lemke"].counted, found["lemke"].lost) == (60, 0)


@pytest.mark.parametrize(("one", "other"), [(0, 0), (5, 0), (6, 0), (0, 6), (3, 11), (7, 7), (40, 62)])
def test_the_test_is_exact(one: int, other: int) -> None:
    """Against the sum of binomial coefficients, in whole numbers."""
    count = one + other
    tail = Fraction(sum(comb(count, k) for k in range(min(one, other) + 1)), 2**count)
    assert mcnemar(one, other) == pytest.approx(float(min(Fraction(1), 2 * tail)), rel=1e-12)


def _tiers(misses: int) -> list[list[str]]:
    solved = pd.DataFrame({"all": [True] * 50, "few": [k >= misses for k in range(50)]})
    return tiers(solved)


def test_the_level_decides_from_both_sides() -> None:
    """Five misses are p = 0.0625, six are p = 0.03125: half of the level would tie both, twice the level neither."""
    assert LEVEL / 2 < mcnemar(6, 0) < LEVEL < mcnemar(5, 0) < 2 * LEVEL
    assert _tiers(5) == [["all", "few"]]
    assert _tiers(6) == [["all"], ["few"]]


def test_fewer_than_ten_problems_are_a_hint() -> None:
    def sentence(count: int) -> str:
        return _ranked([*_all(count, "s", 1.0), *_all(count, "t", 2.0)]).verdict

    assert sentence(FEW - 1).startswith("a hint from 9 problems: s solves 9 of 9, ")
    assert sentence(FEW).startswith("use s: it solves 10 of 10 problems, ")


@pytest.mark.parametrize(("factor", "tied"), [(1 + 0.9 * (TIE - 1), True), (1 + 1.2 * (TIE - 1), False)])
def test_a_tie_ends_at_a_tenth(factor: float, tied: bool) -> None:
    found = _ranked([*_all(20, "one", 1.0), *_all(20, "two", factor)])
    assert ("is as good" in found.sentence) == tied
    assert pytest.approx(1.1) == TIE


def test_a_tier_is_in_order_of_time_with_misses_charged() -> None:
    """One miss of 20 costs 10 s: 0.01·1000^(1/20) = 0.0141 s; a solver without a miss leads below that only."""
    missing = _all(20, "missing", 0.01, {3: "timeout"})
    for seconds, first in ((0.013, "whole"), (0.016, "missing")):
        assert _ranked([*missing, *_all(20, "whole", seconds)]).rows[0].solver == first
    assert math.isclose(0.01 * 1000 ** (1 / 20), 0.01413, rel_tol=1e-3)


def test_without_a_limit_a_tier_is_in_order_of_what_was_solved() -> None:
    rows = [*_all(20, "missing", 1e-3, {3: "failed"}), *_all(20, "whole", 1.0)]
    assert _ranked(rows).rows[0].solver == "missing"
    assert _ranked([{**one, "seconds": None} for one in rows]).rows[0].solver == "whole"


def test_factors_have_no_exponent() -> None:
    assert [ratio(x) for x in (1.04, 9.84, 99.6, 102.4, 1e6)] == ["1", "9.8", "100", "102", "1000000"]
