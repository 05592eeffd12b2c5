"""Two results compared: which rows are pairs, what each gate rules, and what becomes of the whole."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from synthetic_results import row, suite, table
from tiers import some_by_day

from cpbench.analysis.comparison import (
    Comparison,
    ComparisonSide,
    PairVerdict,
    Thresholds,
    compare,
    compare_labels,
    equal_pairs,
    noise,
    pairs,
    suites,
    times,
)
from cpbench.errors import CpbenchError, UnknownName

HERE = {"here": {"cpu": "a processor", "cores": 2, "load": 0.1}}
BOTH_SOLVED = ("solved", "solved")
USUAL = Thresholds()


def side(*rows: dict[str, Any], name: str = "side", machines: Any = HERE, **meta: Any) -> ComparisonSide:
    return ComparisonSide(name, table(*rows).assign(**_extra(rows)), meta, machines)


def _extra(rows: tuple[dict[str, Any], ...]) -> dict[str, list[Any]]:
    """Columns that the made-up rows have beyond those of `table`."""
    known = row("p", "s", "solved")
    names = {name for r in rows for name in r} - known.keys()
    return {"host": ["here"] * len(rows), **{name: [r.get(name) for r in rows] for name in names}}


def one(base: dict[str, Any], new: dict[str, Any], settings: Thresholds = USUAL) -> pd.Series:
    """The pair of two rows of one problem and solver, `status` and what else is given."""
    before, after = (row("p", "s", **given) for given in (base, new))
    found = compare(side(before), side(after), settings)
    assert len(found.pairs) == 1
    return found.pairs.iloc[0]


# ------------------------------------------------------------------------------------------------ pairs


def test_a_pair_is_a_problem_a_solver_and_all_its_settings() -> None:
    base = side(row("p", "s", "solved"))
    for other in (
        {"tolerance": 1e-8},
        {"options": '{"a": 1}'},
        {"request": "inner8"},
        {"start": "file"},
        {"threads": 2},
        {"measure": "natural"},
        {"fingerprint": "other"},
        {"solver": "t"},
    ):
        with pytest.raises(CpbenchError, match="no pair in common"):
            compare(base, side(row("p", "s", "solved", **other)))
    told = compare(base, side(row("another name", "s", "solved", fingerprint="f-p", address="elsewhere.h5")))
    assert len(told.pairs) == 1


def test_rows_without_a_partner_are_counted() -> None:
    found = compare(
        side(row("p", "s", "solved"), row("q", "s", "solved")),
        side(row("p", "s", "solved"), row("p", "t", "solved"), row("r", "s", "solved")),
    )
    assert found.only_base["problem"].tolist() == ["q"]
    assert sorted(zip(found.only_new["problem"], found.only_new["label"], strict=True)) == [("p", "t"), ("r", "s")]
    assert any("1 rows are in the base only, 2 in the new" in note for note in found.notes)


def test_a_problem_that_changed_under_its_name_is_reported() -> None:
    found = compare(
        side(row("p", "s", "solved"), row("q", "s", "solved")),
        side(row("p", "s", "solved"), row("q", "s", "solved", fingerprint="new")),
    )
    assert found.changed == ("q",)
    assert any("others under their old names" in note and "q" in note for note in found.notes)


def test_sets_steps_and_names_tell_equal_problems_apart() -> None:
    """A scene at rest has the same problem at every step; a plan may have it in two sets."""
    same = {"fingerprint": "f"}
    for column, values in (("set", ["a", "b"]), ("step", [1, 2])):
        rows = [row("p", "s", "solved", key=str(k), **same, **{column: v}) for k, v in enumerate(values)]
        found = compare(side(*rows), side(*rows[::-1]))
        assert len(found.pairs) == 2
        assert not len(found.only_base)
    rows = [row("p", "s", "solved", key="0", **same), row("p", "s", "wrong", key="1", **same)]
    other = row("q", "s", "solved")
    found = compare(side(*rows, other), side(rows[0], other))
    assert found.pairs["problem"].tolist() == ["q"]
    assert any("3 rows could not be told apart" in note for note in found.notes)


def test_two_labels_of_a_run_by_solver_or_by_label() -> None:
    rows = [
        row("p", label, "solved", solver=solver, request=request, options=options, address=problem)
        for problem in ("p",)
        for solver, options, request, label in (
            ("x@base", "{}", "exact", "x@base"),
            ("x@head", "{}", "exact", "x@head"),
            ("x@base", '{"w": 1}', "inner8", "x@base[w=1]@inner8"),
            ("x@head", '{"w": 1}', "inner8", "x@head[w=1]@inner8"),
        )
    ]
    run = side(*rows)
    found = compare_labels(run, "x@base", "x@head")
    assert sorted(found.pairs["label_new"]) == ["x@head", "x@head[w=1]@inner8"]
    found = compare_labels(run, "x@base[w=1]@inner8", "x@head")
    assert found.pairs[["label_base", "label_new"]].values.tolist() == [["x@base[w=1]@inner8", "x@head"]]
    with pytest.raises(UnknownName, match="did you mean x@head"):
        compare_labels(run, "x@base", "x@haed")
    with pytest.raises(CpbenchError, match="compared with itself"):
        compare_labels(run, "x@base", "x@base")


# ------------------------------------------------------------------------------------------------ status


@pytest.mark.parametrize(
    ("base", "new", "verdict", "kind"),
    some_by_day(
        [
            ("solved", "timeout", "regressed", "timeout"),
            ("solved", "wrong", "regressed", "wrong"),
            ("stationary", "crash", "regressed", "crash"),
            ("infeasible", "failed", "regressed", "failed"),
            ("solved", "stationary", "regressed", "stationary"),
            ("stationary", "solved", "improved", "stationary"),
            ("stationary", "stationary", "same", ""),
            ("max_iter", "solved", "improved", "max_iter"),
            ("crash", "infeasible", "improved", "crash"),
            ("failed", "wrong", "regressed", "wrong"),
            ("timeout", "crash", "regressed", "crash"),
            ("crash", "wrong", "regressed", "wrong"),
            ("wrong", "failed", "improved", "wrong"),
            ("wrong", "wrong", "same", ""),
            ("failed", "timeout", "same", ""),
            ("solved", "unavailable", "inconclusive", "not compared"),
            ("unsupported", "solved", "inconclusive", "not compared"),
            ("not_run", "crash", "inconclusive", "not compared"),
            ("solved", "infeasible", "inconclusive", "contradiction"),
            ("infeasible", "unbounded", "inconclusive", "contradiction"),
            ("wrong", "lost", "improved", "wrong"),
            ("solved", "lost", "regressed", "lost"),
            ("approximate", "solved", "improved", "approximate"),
            ("lost", "approximate", "inconclusive", "charged elsewhere"),
            ("unresolvable", "lost", "inconclusive", "charged elsewhere"),
        ],
        10,
    ),
)
def test_status_comes_first(base: str, new: str, verdict: str, kind: str) -> None:
    told = one({"status": base}, {"status": new, "message": "why"})
    assert (told["verdict"], told["kind"]) == (verdict, kind)
    if verdict != "same":
        assert told["gate"] == "status"
        assert told["why"].startswith(f"{base} → {new}".replace("_", " "))
        assert math.isnan(told["ratio"]), "a change of status is never a ratio"


def test_what_never_started_is_no_pair() -> None:
    rows = [row("p", "s", "solved"), row("p", "t", "unavailable")]
    found = compare(side(*rows), side(*rows))
    assert found.idle == 1
    assert len(found.pairs) == 1
    assert any("1 pairs were started on neither side" in note for note in found.notes)


def test_other_limits_make_no_change_of_status() -> None:
    told = one({"status": "timeout", "seconds": 1.0}, {"status": "solved", "solve": 3.0})
    assert (told["verdict"], told["kind"]) == ("inconclusive", "other limits")
    told = one({"status": "solved", "memory": 2.0**33}, {"status": "memout"})
    assert (told["verdict"], told["kind"]) == ("inconclusive", "other limits")
    told = one({"status": "solved", "seconds": 1.0, "solve": 0.1}, {"status": "wrong"})
    assert told["verdict"] == "regressed", "limits do not excuse what is no limit"


def test_a_solve_near_its_limit_may_run_into_it() -> None:
    near, far = {"status": "solved", "solve": 6.0}, {"status": "solved", "solve": 4.0}
    for base, new in ((near, {"status": "timeout"}), ({"status": "timeout"}, near)):
        assert one(base, new)["kind"] == "at the limit"
    assert one(far, {"status": "timeout"})["verdict"] == "regressed"
    assert one({"status": "timeout"}, far)["verdict"] == "improved"


# ---------------------------------------------------------------------------------------- error, counters


def test_errors_within_the_tolerance_are_equal_and_beyond_it_a_decade_counts() -> None:
    def of(base: float, new: float, status: str = "max_iter") -> str:
        return one({"status": status, "error": base}, {"status": status, "error": new})["verdict"]

    assert of(1e-15, 9e-7, "solved") == "same"
    assert of(1e-4, 9e-4) == "same"
    assert of(1e-4, 2e-3) == "regressed"
    assert of(2e-3, 1e-4) == "improved"
    assert of(1e-12, 9e-6) == "same", "the smaller one counts as the tolerance"
    assert of(math.inf, 1e-3) == "same", "no answer and a useless one"


def counted(before: dict[str, Any] | str, after: dict[str, Any] | str, **given: Any) -> pd.Series:
    texts = [c if isinstance(c, str) else json.dumps(c) for c in (before, after)]
    return one(
        {"status": "solved", "counters": texts[0], **given.get("base", {})},
        {"status": "solved", "counters": texts[1], **given.get("new", {})},
        given.get("settings", USUAL),
    )


def test_counters_need_no_clock() -> None:
    assert counted({"iterations": 100}, {"iterations": 106})["verdict"] == "regressed"
    assert counted({"iterations": 100}, {"iterations": 105})["verdict"] == "same"
    assert counted({"iterations": 106}, {"iterations": 100})["verdict"] == "improved"
    assert counted({"iterations": 3}, {"iterations": 4})["verdict"] == "same", "one more is within a unit"
    assert counted({"iterations": 0}, {"iterations": 2})["verdict"] == "regressed"
    told = counted({"pivots": 10, "a": 1}, {"pivots": 20, "b": 1})
    assert (told["gate"], told["why"]) == ("counters", "pivots 10 → 20")
    told = counted({"pivots": 10, "iterations": 20}, {"pivots": 30, "iterations": 10})
    assert (told["verdict"], told["why"]) == (
        "inconclusive",
        "counters moved apart: iterations 20 → 10, pivots 10 → 30",
    )
    assert (
        counted({"iterations": 100}, {"iterations": 120}, settings=Thresholds(counter_margin=0.3))["verdict"] == "same"
    )
    for broken in ("", "[1]", "{", '{"iterations": "many"}', '{"iterations": NaN}'):
        assert counted(broken, {"iterations": 9})["verdict"] == "same"
    unsolved = {"status": "max_iter"}
    assert counted({"iterations": 10}, {"iterations": 90}, base=unsolved, new=unsolved)["verdict"] == "same"


def test_counters_against_time_are_inconclusive() -> None:
    quick = {"solve": 1e-2, "cpu": 1e-2, "samples": json.dumps([1e-2, 1.01e-2, 0.99e-2])}
    slow = {"solve": 5e-2, "cpu": 5e-2, "samples": json.dumps([5e-2, 5.01e-2, 4.99e-2])}
    told = counted({"iterations": 50}, {"iterations": 10}, base=quick, new=slow)
    assert told["verdict"] == "inconclusive"
    assert "iterations 50 → 10, but 5 times the time" in told["why"]
    told = counted({"iterations": 10}, {"iterations": 50}, base=quick, new=slow)
    assert (told["verdict"], told["gate"]) == ("regressed", "counters")


# ------------------------------------------------------------------------------------------------- times


def timed(factor: float, **given: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    def made(seconds: float, wobble: tuple[float, ...]) -> dict[str, Any]:
        samples = json.dumps([seconds * w for w in wobble])
        return {"status": "solved", "solve": seconds, "cpu": seconds, "samples": samples}

    return made(1e-2, (0.99, 1.0, 1.01)), {**made(1e-2 * factor, (0.99, 1.0, 1.012)), **given}


def test_one_pair_decides_far_beyond_what_a_moment_explains() -> None:
    told = one(*timed(3.0))
    assert (told["verdict"], told["gate"]) == ("regressed", "time")
    assert told["low"] < 3.0 < told["high"]
    assert one(*timed(1 / 3))["verdict"] == "improved"
    assert one(*timed(1.3))["verdict"] == "inconclusive"
    assert one(*timed(3.0, cpu=1e-2))["verdict"] == "inconclusive", "another program's time is not the solver's"
    assert one(*timed(3.0, samples="[0.03]"))["verdict"] == "inconclusive", "one sample has no interval"
    assert one(*timed(1.001))["verdict"] == "same"


def test_times_count_on_one_machine_one_at_a_time() -> None:
    for given in ({"host": "there"}, {"jobs": 2}):
        base, new = timed(3.0)
        after = side(row("p", "s", **new)).table.assign(**given)
        found = compare(side(row("p", "s", **base)), ComparisonSide("new", after, {}, {**HERE, "there": HERE["here"]}))
        told = found.pairs.iloc[0]
        assert (told["verdict"], found.verdict) == ("same", PairVerdict.SAME)
        assert told["ratio"] == pytest.approx(3.0), "told all the same"
        assert not told["comparable"]
    base, new = timed(3.0)
    other = {"here": {"cpu": "a quicker one", "cores": 2}}
    found = compare(side(row("p", "s", **base)), side(row("p", "s", **new), machines=other))
    assert found.verdict == PairVerdict.SAME
    assert any("times are of two machines" in note for note in found.notes)
    trusted = compare(
        side(row("p", "s", **base)), side(row("p", "s", **new), machines=other), Thresholds(same_machine=True)
    )
    assert trusted.verdict == PairVerdict.REGRESSED


def test_times_below_the_floor_are_those_of_calls() -> None:
    base = {"status": "solved", "solve": 1e-5, "cpu": 1e-5}
    found = compare(
        side(row("p", "s", **base), row("q", "s", **base)),
        side(row("p", "s", **{**base, "solve": 9e-5}), row("q", "s", **{**base, "solve": 1e-3})),
    )
    p, q = found.pairs["below"].tolist()
    assert (p, q) == (True, False)
    assert found.pairs["ratio"].tolist() == [1.0, pytest.approx(10.0)], "the floor stands for what is shorter"
    assert found.suites[0].timed == 1
    assert found.suites[0].below == 1
    assert any("below the floor" in note for note in found.notes)


def test_the_range_of_a_pair_is_that_of_its_samples() -> None:
    before = row("p", "s", "solved", 1.0, samples="[1.0, 1.0, 4.0]")
    after = row("p", "s", "solved", 8.0, samples="[8.0, 2.0]")
    told = compare(side(before), side(after)).pairs.iloc[0]
    assert told["ratio"] == pytest.approx(16.0**0.5 / 4.0 ** (1 / 3))
    assert (told["low"], told["high"], told["significant"]) == (0.5, 8.0, 0)


@pytest.mark.parametrize("families", some_by_day([3, 4, 6, 10], 1))
def test_the_interval_of_a_mean_is_widened_once(rng: np.random.Generator, families: int) -> None:
    """Coverage of 95 % within three standard errors of 300 trials, and the width of Student's interval."""
    covered, widths = 0, []
    for seed in range(300):
        log = np.repeat(rng.normal(0, 0.1, families), 4) + rng.normal(0, 0.05, 4 * families)
        names = pd.Series(np.repeat([f"f{k}" for k in range(families)], 4))
        _, low, high, _ = suites.mean_ratio(pd.Series(np.exp(log)), names, names, seed)
        covered += low <= 1 <= high
        own = log.reshape(families, 4).mean(axis=1)
        half = stats.t.ppf(0.975, families - 1) * own.std(ddof=1) / math.sqrt(families)
        widths.append(math.log(high / low) / (2 * half))
    assert abs(covered / 300 - 0.95) <= 3 * math.sqrt(0.95 * 0.05 / 300) + 0.01  # the bootstrap's law is no normal one
    assert np.median(widths) == pytest.approx(1.0, abs=0.06)


def test_what_a_time_is_made_of() -> None:
    assert times.samples_of("[1, 2, 3]", 2.0, 2.5, "") == [1.5, 2.5, 3.5]
    assert times.samples_of("[1, 0.001]", 1.0, 1.5, "clock,remembered") == [1.5], "the first solve is the only one"
    assert times.samples_of("broken", 1.0, 1.5, "") == [1.5]


# ----------------------------------------------------------------------------------------------- suites


def ten(
    factor: float, labels: tuple[str, ...] = ("s",), spread: float = 0.01, families: int = 5
) -> tuple[ComparisonSide, ComparisonSide]:
    rng = np.random.default_rng(1)
    made: list[list[dict[str, Any]]] = [[], []]
    for label in labels:
        for k in range(10):
            size = 1e-2 * (k + 1)
            for rows, times_ in ((made[0], 1.0), (made[1], factor)):
                seconds = float(size * times_ * np.exp(rng.normal(0, spread)))
                rows.append(row(f"{'abcdefghij'[k % families]}-{k}", label, "solved", seconds))
    return side(*made[0], name="base"), side(*made[1], name="new")


def test_the_mean_of_all_pairs_decides() -> None:
    slower = compare(*ten(1.2))
    assert slower.verdict == PairVerdict.REGRESSED
    whole = slower.suites[0]
    log = np.log(slower.pairs["ratio"])
    assert whole.ratio == pytest.approx(math.exp(log.mean()))
    assert whole.apart
    assert whole.families == 5
    assert whole.low < whole.ratio < whole.high
    assert compare(*ten(1 / 1.2)).verdict == PairVerdict.IMPROVED
    assert compare(*ten(1.0)).verdict == PairVerdict.SAME
    assert compare(*ten(1.03)).verdict == PairVerdict.SAME, "less than the margin"
    wide = compare(*ten(1.0, spread=0.3))
    assert wide.verdict == PairVerdict.INCONCLUSIVE
    assert "would decide" in wide.suites[0].why


def test_the_machine_is_to_blame_only_for_noise_beyond_the_margin() -> None:
    """What would decide: more problems, unless equal code differs by more than was asked for."""
    pairs = compare(*ten(1.0, spread=0.05)).pairs
    quiet, noisy = (suites.by_label(pairs, noise.Noise(0.01, equal=f), 0.05, 0)[0].why for f in (1.005, 1.2))
    assert "times as many problems" in quiet
    assert noisy == "equal code differs by 20.0% here: a quieter machine would decide"


def test_a_bias_of_the_process_is_not_averaged_away() -> None:
    """Six per cent on every problem alike may be where a worker's memory lies, however narrow the interval is."""
    found = compare(*ten(1.055, spread=1e-4))
    assert found.suites[0].low > 1.05
    assert not found.suites[0].apart
    assert found.verdict == PairVerdict.INCONCLUSIVE
    assert "another run, with other processes" in found.suites[0].why


@pytest.mark.nightly
def test_families_are_resampled_not_problems() -> None:
    """Two families that disagree leave the mean open, whatever ten pairs say."""
    base, _ = ten(1.0, spread=0.0, families=2)
    factor = base.table["family"].map({"a": 1.6, "b": 1.0})
    new = ComparisonSide("new", base.table.assign(solve=base.table["solve"] * factor), {}, HERE)
    assert compare(base, new).suites[0].time == PairVerdict.INCONCLUSIVE
    alone = [ComparisonSide(s.name, s.table.assign(family=""), {}, HERE) for s in (base, new)]
    assert compare(*alone).suites[0].families == 10
    low, high = (compare(base, new).suites[0], compare(*alone).suites[0])
    assert low.high / low.low > high.high / high.low


def test_labels_share_the_level() -> None:
    """What one label may say with a level of 5 %, one of fifty may not."""
    pairs = compare(*ten(1.07, spread=0.002)).pairs
    assert suites.by_label(pairs, noise.Noise(0.05), 0.05, 0)[0].apart
    many = pd.concat([pairs.assign(label_new=f"s{k}") for k in range(50)])
    assert not any(suite.apart for suite in suites.by_label(many, noise.Noise(0.05), 0.05, 0))


def test_few_problems_never_suffice() -> None:
    base, new = ten(1.3)
    few = [ComparisonSide(s.name, s.table.head(5), {}, HERE) for s in (base, new)]
    found = compare(*few)
    assert found.verdict == PairVerdict.INCONCLUSIVE
    assert "at least 6 problems" in found.suites[0].why
    single = [ComparisonSide(s.name, s.table.head(1), {}, HERE) for s in (base, new)]
    assert compare(*single).verdict == PairVerdict.INCONCLUSIVE


# ------------------------------------------------------------------------------------------------ noise


def test_the_reference_solves_of_two_runs_widen_the_margin() -> None:
    base, new = ten(1.15, spread=0.002)
    still = {"references": [{"seconds": 1e-4}, {"seconds": 1e-4}]}
    moved = {"references": [{"seconds": 1.2e-4}, {"seconds": None}]}
    quiet = compare(ComparisonSide("b", base.table, still, HERE), ComparisonSide("n", new.table, still, HERE))
    assert quiet.verdict == PairVerdict.REGRESSED
    loud = compare(ComparisonSide("b", base.table, still, HERE), ComparisonSide("n", new.table, moved, HERE))
    assert loud.noise.delta == pytest.approx(0.2)
    assert loud.verdict != PairVerdict.REGRESSED
    assert any("the machine may differ by a factor 1.2" in note for note in loud.notes)
    other = compare(
        ComparisonSide("b", base.table, still, HERE),
        ComparisonSide("n", new.table, {**moved, "reference": "another"}, HERE),
    )
    assert math.isnan(other.noise.drift)
    assert any("no equal reference solves" in note for note in other.notes)


def test_two_labels_of_equal_code_tell_the_noise() -> None:
    rng = np.random.default_rng(0)
    rows = [
        row(f"{'abcde'[k % 5]}-{k}", label, "solved", 1e-2 * factor * float(np.exp(rng.normal(0, 0.005))),
            solver=label, request="exact", counters=json.dumps({"iterations": count, "draws": draws}))
        for label, factor, count, draws in (("x@a", 1.0, 10, 5), ("x@b", 1.1, 10, 9), ("x@c", 1.12, 10, 20))
        for k in range(12)
    ]  # fmt: skip
    run = side(*rows)
    unaware = compare_labels(run, "x@a", "x@c")
    assert unaware.suites[0].time == PairVerdict.REGRESSED
    assert set(unaware.pairs["gate"]) == {"counters"}
    found = compare_labels(run, "x@a", "x@c", equal=("x@a", "x@b"))
    assert found.noise.equal == pytest.approx(1.1, abs=0.01)
    assert found.noise.unsteady == {("x", "draws")}
    assert found.verdict == PairVerdict.INCONCLUSIVE
    assert any("counters that differ between equal builds" in note for note in found.notes)


def test_noise_by_hand() -> None:
    def drift(*files: list[float]) -> float:
        return noise.drift([[{"seconds": s} for s in solves] for solves in files])[0]

    assert drift([2.0, 2.0], [3.0]) == pytest.approx(1.5)
    assert drift([2.0, 4.0], [6.0]) > 3.0, "what varies by a factor of two may have been anything"
    assert drift([2.0, 2.1, 2.0], [2.0, 2.1, 2.0]) > 1.02, "equal medians that vary are not known to be equal"
    assert 1.4 < drift([1.0, 1.01, 0.99], [1.4, 1.41, 1.39]) < 1.45
    assert math.isnan(noise.drift([[], [{"seconds": 6.0}]])[0])
    assert noise.drift([[]])[0] == 1.0, "one run drifts alike for both sides"
    assert noise.Noise(0.05).delta == 0.05
    assert noise.Noise(0.05, drift=1.1, equal=1.07).delta == pytest.approx(0.1)
    seen = noise.Noise(0.05, equal=1.07)
    assert seen.bias == pytest.approx(math.sqrt((2 * 2 * 0.02**2 + math.log(1.07) ** 2) / 3))
    # freedom (b² + s²)² / (b⁴/3) with s = b
    assert seen.reach(seen.bias, 0.05) == pytest.approx(math.sqrt(2.0) * seen.bias * stats.t.isf(0.025, 12.0))


# ------------------------------------------------------------------------------------------- the whole


def whole(*changes: tuple[str, str]) -> Comparison:
    base = [row(f"p{k}", "s", old) for k, (old, _) in enumerate(changes)]
    new = [row(f"p{k}", "s", now) for k, (_, now) in enumerate(changes)]
    return compare(side(*base), side(*new))


def test_the_verdict_is_the_worst() -> None:
    assert whole(BOTH_SOLVED).verdict == PairVerdict.SAME
    assert whole(BOTH_SOLVED, ("failed", "solved")).verdict == PairVerdict.IMPROVED
    assert whole(("failed", "solved"), ("solved", "unavailable")).verdict == PairVerdict.INCONCLUSIVE
    assert whole(("failed", "solved"), ("solved", "unavailable"), ("solved", "wrong")).verdict == PairVerdict.REGRESSED
    assert whole(("failed", "failed")).verdict == PairVerdict.SAME
    assert any("no pair was solved on both sides" in note for note in whole(("failed", "failed")).notes)


def test_new_failures_are_those_that_were_not_there() -> None:
    found = whole(("wrong", "wrong"), ("solved", "wrong"), ("crash", "wrong"), ("wrong", "crash"))
    assert len(found.became("wrong")) == 2
    assert len(found.became("crash")) == 1


def test_a_run_is_the_same_as_itself_and_mirrored_by_its_mirror() -> None:
    run = ComparisonSide("run", suite(), {}, HERE)
    same = compare(run, run)
    assert set(same.pairs.loc[same.pairs["gate"] != "time", "verdict"]) == {"same"}
    assert all(s.time in (None, PairVerdict.SAME, PairVerdict.INCONCLUSIVE) for s in same.suites)
    other = ComparisonSide("other", suite(seed=2), {}, HERE)
    there, back = compare(run, other), compare(other, run)
    mirror = {"regressed": "improved", "improved": "regressed"}
    merged = there.pairs.merge(back.pairs, on=["fingerprint", "label_new"], suffixes=("", "_back"))
    sure = merged[(merged["status_base"] != merged["status_new"])]
    kept = sure[~sure["verdict"].isin(["same", "inconclusive"])]
    assert len(kept) > 100
    assert [mirror[v] for v in kept["verdict"]] == kept["verdict_back"].tolist()


def test_a_table_without_times_is_compared_by_the_rest() -> None:
    """Status, error and counters."""
    run = table(row("p", "s", "solved", 1.0, counters='{"iterations": 10}'), row("q", "s", "max_iter", error=2e-3))
    columns = ["problem", "fingerprint", "solver", "label", "request", "tolerance", "start", "threads", "status"]
    before = run[[*columns, "error", "counters"]].assign(error=[1e-6, 1e-2])
    assert compare(ComparisonSide("before", before), ComparisonSide("run", run)).verdict == PairVerdict.SAME
    worse = run.assign(counters=['{"iterations": 20}', "{}"])
    found = compare(ComparisonSide("before", before), ComparisonSide("run", worse))
    assert found.verdict == PairVerdict.REGRESSED
    assert found.pairs["ratio"].isna().all()
    assert not any("machines" in note for note in found.notes)


def test_equal_pairs_need_common_problems() -> None:
    run = side(row("p", "x@a", "solved", solver="x@a"), row("q", "x@b", "solved", solver="x@b"))
    with pytest.raises(CpbenchError, match="x@a and x@b have no pair in common"):
        equal_pairs(run, ("x@a", "x@b"))
    assert pairs.KEY[0] == "fingerprint"
