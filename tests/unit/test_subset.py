"""Problems for short runs: the value is submodular, the choice is greedy, families are there, the plan runs."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import synthetic_results as synthetic
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import kendalltau
from tiers import some_by_day

from cpbench.advice import costs, subset, subset_plan
from cpbench.analysis import table as rows_of
from cpbench.bench.planning import plan_file, plan_text
from cpbench.bench.results.store import Store, read_results
from cpbench.cli import main
from cpbench.errors import StoreError


def outcomes(problems: int, labels: int, seed: int) -> pd.DataFrame:
    """Times with failures, and labels that take no part."""
    rng = np.random.default_rng(seed)
    times = np.exp(rng.normal(-3, 2, (problems, labels)))
    kind = rng.uniform(size=times.shape)
    times[kind < 0.25] = math.inf
    times[kind > 0.9] = math.nan
    index = [f"p{k:03d}" for k in range(problems)]
    return pd.DataFrame(times, index=index, columns=[f"s{k}" for k in range(labels)])


def prices(index: pd.Index, seed: int, families: int = 4) -> tuple[pd.Series, pd.Series]:
    rng = np.random.default_rng(seed)
    cost = pd.Series(np.exp(rng.normal(0, 1, len(index))), index=index)
    return cost, pd.Series([f"f{k}" for k in rng.integers(0, families, len(index))], index=index)


# ------------------------------------------------------------------------------------------------ value


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 2**8 - 1), st.integers(0, 2**8 - 1), st.integers(0, 8))
def test_the_value_grows_by_less_and_less(seed: int, small: int, more: int, added: int) -> None:
    """f(A + x) - f(A) >= f(B + x) - f(B) >= 0 for A in B."""
    times = outcomes(9, 5, seed)
    names = list(times.index)
    a = {names[k] for k in range(8) if small >> k & 1}
    b = a | {names[k] for k in range(8) if more >> k & 1}
    x = names[added]
    gains = [subset.value(times, [*s, x]) - subset.value(times, list(s)) for s in (a, b)]
    assert gains[1] >= -1e-12
    assert x in b or gains[0] >= gains[1] - 1e-12


def test_what_tells_nothing_apart_is_worth_nothing() -> None:
    """Solved by everybody at once (below the floor), by nobody, by the only one who takes part."""
    times = pd.DataFrame(
        {"a": [1e-6, math.inf, 1.0, 1.0], "b": [9e-5, math.inf, math.nan, math.inf]},
        index=["at once", "nobody", "one", "x"],
    )
    assert subset.value(times, ["at once", "nobody", "one"]) == 0.0
    assert subset.value(times, ["x"]) == 1.0
    cost = pd.Series(1.0, index=times.index)
    family = pd.Series("f", index=times.index)
    assert subset.choose(times, cost, family, 9.0).problems[1:] in (["x"], [])


# ----------------------------------------------------------------------------------------------- choice


def plain_greedy(times: pd.DataFrame, cost: pd.Series, chosen: list[str], budget: float, by_cost: bool) -> list[str]:
    """Without bounds and queues."""
    chosen = list(chosen)
    while True:
        here = subset.value(times, chosen)
        room = budget - sum(cost[p] for p in chosen)
        free = [p for p in times.index if p not in chosen and cost[p] <= room]
        gains = {p: (subset.value(times, [*chosen, p]) - here) / (cost[p] if by_cost else 1.0) for p in free}
        best = max(gains, key=gains.__getitem__, default=None)
        if best is None or gains[best] <= 1e-12:
            return chosen
        chosen.append(best)


@pytest.mark.parametrize("seed", range(6))
def test_the_choice_is_the_greedy_one(seed: int) -> None:
    times = outcomes(14, 5, seed)
    cost, family = prices(times.index, seed)
    budget = 0.4 * float(cost.sum())
    found = subset.choose(times, cost, family, budget)
    first = [pick.problem for pick in found.picks if pick.representative]
    tried = [plain_greedy(times, cost, first, budget, by_cost) for by_cost in (True, False)]
    assert found.value == pytest.approx(max(subset.value(times, t) for t in tried), abs=1e-9)
    assert found.problems in tried
    assert found.cost <= budget * (1 + 1e-12)
    assert math.fsum(pick.gain for pick in found.picks) == pytest.approx(found.value, abs=1e-9)


@pytest.mark.parametrize("seed", some_by_day(range(8), 1))
def test_it_comes_near_the_best_choice(seed: int) -> None:
    """The bounds of Nemhauser et al. (equal costs) and Leskovec et al., against all subsets; one family, no duty."""
    times = outcomes(11, 4, 100 + seed)
    cost, _ = prices(times.index, seed)
    one = pd.Series("f", index=times.index)
    subsets = [s for k in range(12) for s in itertools.combinations(times.index, k)]
    values = {s: subset.value(times, s) for s in subsets}
    for price, budget, bound in (
        (cost, 0.35 * float(cost.sum()), (1 - 1 / math.e) / 2),
        (cost * 0 + 1.0, 4.0, 1 - 1 / math.e),
    ):
        found = subset.choose(times, price, one, budget)
        first = (found.picks[0].problem,)
        best = max(v for s, v in values.items() if set(first) <= set(s) and sum(price[p] for p in s) <= budget)
        base = values[first]
        assert found.value - base >= bound * (best - base) - 1e-12


@pytest.mark.parametrize("seed", range(8))
def test_no_choice_has_more_families(seed: int) -> None:
    times = outcomes(10, 3, seed)
    cost, family = prices(times.index, seed, families=5)
    for part in (0.05, 0.15, 0.3, 1.0):
        budget = part * float(cost.sum())
        found = subset.choose(times, cost, family, budget)
        most = max(
            len({family[p] for p in s})
            for k in range(6)
            for s in itertools.combinations(times.index, k)
            if sum(cost[p] for p in s) <= budget
        )
        assert len({pick.family for pick in found.picks}) == most
        assert set(found.missed) == set(family) - {pick.family for pick in found.picks}


def test_the_seed_decides_ties_and_nothing_else() -> None:
    times = outcomes(20, 5, 3)
    cost, family = prices(times.index, 3)
    found = subset.choose(times, cost, family, 0.3 * cost.sum(), seed=0)
    assert found == subset.choose(times, cost, family, 0.3 * cost.sum(), seed=7)
    shuffled = times.sample(frac=1.0, random_state=2)
    assert found.problems == subset.choose(shuffled, cost, family, 0.3 * cost.sum(), seed=0).problems
    twins = pd.concat([times.iloc[[0]]] * 6).set_axis(list("abcdef"))
    same = pd.Series(1.0, index=twins.index)
    drawn = {
        tuple(subset.choose(twins, same, pd.Series("f", index=twins.index), 1.0, seed).problems) for seed in range(30)
    }
    assert len(drawn) > 3
    picked = [subset.choose(t, same, pd.Series("f", index=twins.index), 1.0, 4).problems for t in (twins, twins[::-1])]
    assert picked[0] == picked[1]


@pytest.mark.nightly
def test_random_problems_of_the_same_cost_tell_less() -> None:
    """Pairs of solvers of which some problem clearly puts one first, and the order of all: 200 random choices that
    fill the budget, fixed seeds."""
    table = synthetic.suite(problems=60, labels=16, seed=4)
    times = table.assign(time=table["solve"].where(table["status"] == "solved", math.inf)).pivot(
        index="problem", columns="label", values="time"
    )
    cost, _ = prices(times.index, 9)
    family = pd.Series([p.rpartition("-")[0] for p in times.index], index=times.index)
    budget = 0.12 * float(cost.sum())
    chosen = subset.choose(times, cost, family, budget, seed=1)

    def apart(problems: list[Any]) -> int:
        level = np.log2(times.loc[problems].clip(lower=1e-4).to_numpy())
        with np.errstate(invalid="ignore"):
            ahead = level[:, np.newaxis, :] - level[:, :, np.newaxis] >= 2.0
        return int(ahead.any(axis=0).sum())

    def order(problems: list[Any]) -> float:
        return subset.agreement(times, problems)[0]

    rng = np.random.default_rng(0)
    drawn: list[list[Any]] = []
    for _ in range(200):
        taken: list[Any] = []
        for p in rng.permutation(times.index):
            if sum(cost[q] for q in taken) + cost[p] <= budget:
                taken.append(p)
        drawn.append(taken)
    assert np.mean([apart(d) < apart(chosen.problems) for d in drawn]) >= 0.95
    assert np.mean([subset.value(times, d) < chosen.value for d in drawn]) >= 0.95
    assert order(chosen.problems) > np.mean([order(d) for d in drawn])


def test_the_agreement_is_that_of_scipy() -> None:
    times = outcomes(12, 6, 0)
    part = list(times.index[:5])
    both = pd.concat([subset.scores(times), subset.scores(times.loc[part])], axis=1).dropna()
    assert subset.agreement(times, part) == (kendalltau(both[0], both[1]).statistic, len(both))
    assert math.isnan(subset.agreement(times[["s0"]], part)[0])


# ------------------------------------------------------------------------------------------------ costs


SOLVERS = ("--solver", "lemke", "--solver", "psor", "--solver", "pgs-relay")


def timed(seconds: list[float], **given: Any) -> pd.DataFrame:
    """A run of pairs one after the other, each with so much wall time, and a second between two."""
    ends = pd.Timestamp("2026-01-01") + pd.to_timedelta(np.cumsum(np.array(seconds) + 1.0), unit="s")
    rows = [synthetic.row(f"p-{k}", "s", "solved", 0.1, **given) for k in range(len(seconds))]
    frame = synthetic.table(*rows)
    return frame.assign(wall=seconds, convert=0.0, origin=None, finished=[f"{end:%Y-%m-%dT%H:%M:%S}" for end in ends])


def test_the_factor_is_what_passed_over_what_was_spent() -> None:
    found = costs.measured_costs(timed([4.0] * 101))
    assert (found.factor, found.assumed) == (pytest.approx((500 - costs.START) / 400), False)
    assert found.expected(found.cost.sum()) == pytest.approx(costs.START + 1.25 * 404, rel=2e-3)
    assert found.affordable(found.expected(3.0)) == pytest.approx(3.0)
    pause = timed([4.0] * 101)
    late = pd.to_datetime(pause["finished"]) + pd.to_timedelta(np.where(np.arange(101) > 50, 9999, 0), unit="s")
    paused = costs.measured_costs(pause.assign(finished=late.dt.strftime("%Y-%m-%dT%H:%M:%S")))
    assert paused.factor == pytest.approx(found.factor, rel=0.02)
    assert costs.measured_costs(timed([0.1] * 5)).assumed


def test_who_does_not_take_part_is_no_failure() -> None:
    rows = [synthetic.row("a", "s", "unsupported"), synthetic.row("a", "t", "timeout", 10.0)]
    found = costs.measured_costs(synthetic.table(*rows, synthetic.row("b", "s", "solved", 0.1)))
    assert found.outcomes.loc["f-a"].isna().tolist() == [True, False]
    assert math.isinf(found.outcomes.loc["f-a", "t"])
    assert found.solvers == 2


def test_a_sequence_that_is_followed_is_one_problem() -> None:
    rows = [
        synthetic.row(
            f"step-{k}", "s", "solved", 0.1, start=start, sequence="scene", step=k, address=f"x/scene.h5::step-{k}"
        )
        | {"key": f"{k}{start}"}
        for k in range(3)
        for start in ("previous", "cold")
    ]
    found = costs.measured_costs(pd.DataFrame(rows))
    assert len(found.cost) == 1
    assert found.outcomes.iloc[0].tolist() == pytest.approx([0.3, 0.3])


def test_nothing_run_is_said() -> None:
    with pytest.raises(StoreError, match="no pair was run"):
        costs.measured_costs(synthetic.table(synthetic.row("a", "s", "not_run")))


# ------------------------------------------------------------------------------------------------- plan


def plan_of(problems: list[str], found: list[str], **keys: Any) -> dict[str, Any]:
    """What results keep of a plan with one set."""
    return {"threads": 1, "sets": [{"name": "", "problems": problems, "found": found, "routes": "", **keys}]}


def written(tmp_path: Path, table: pd.DataFrame, *plans: dict[str, Any]) -> plan_file.PlanFile:
    """The plan of all problems of a table, read again."""
    measured = costs.measured_costs(table)
    chosen = subset.choose(measured.outcomes, measured.cost, measured.family, 1e6)
    told = subset_plan.Chosen(chosen, measured, 1e6, 1.25, (0.5, 3), "cpbench select r.sqlite")
    sources = [subset_plan.source(f"r{k}.sqlite", plan) for k, plan in enumerate(plans)]
    text = subset_plan.text(told, sources, tmp_path, None)
    plan_text.write(tmp_path / "ci.toml", text)
    return plan_file.read(tmp_path / "ci.toml")


def test_settings_and_places_come_from_the_results(tmp_path: Path) -> None:
    table = synthetic.table(
        synthetic.row("a-1", "s", "solved", 1.0, address=str(tmp_path / "x" / "odd[1].h5::a*1")),
        synthetic.row("b-1", "s", "failed", 1.0, address=str(tmp_path / "b.h5")),
    )
    plan = plan_of(
        ["x"], ["f-a-1", "f-b-1"], solvers=["nsgs[omega=1.2]"], tolerance=[1e-4, 1e-8], timeout=2.5, repeats=7
    )
    file = written(tmp_path, table, plan)
    assert set(file.top["problems"]) == {str(tmp_path / "x" / "odd[[]1].h5::a[*]1"), str(tmp_path / "b.h5")}
    assert (file.top["tolerance"], file.top["timeout"], file.top["repeats"]) == ((1e-4, 1e-8), 2.5, 7)
    assert file.top["solvers"] == ("nsgs[omega=1.2]",)
    assert "routes" not in file.top
    assert file.top["report"] is None


def test_sets_of_other_settings_stay_apart(tmp_path: Path) -> None:
    rows = [synthetic.row(f"{f}-1", "s", "solved", 1.0, address=str(tmp_path / f"{f}.h5")) for f in "abc"]
    plans = [plan_of(["builtin"], ["f-a-1"]), plan_of(["y"], ["f-b-1"]), plan_of(["z"], ["f-c-1"])]
    file = written(tmp_path, synthetic.table(*rows), *plans)
    assert [part["problems"] for part in file.sets] == [
        (str(tmp_path / "a.h5"),),
        (str(tmp_path / "b.h5"), str(tmp_path / "c.h5")),
    ]
    assert [part.get("routes") for part in file.sets] == ["facets", None]


def test_results_without_a_plan_are_refused(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="do not tell by which plan"):
        written(tmp_path, synthetic.table(synthetic.row("a-1", "s", "solved", 1.0)), {})


# ----------------------------------------------------------------------------------------- command line


@pytest.fixture
def cpbench(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str, str]]:
    """The command line in this process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["cpbench", *words])
        code = 0
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
        return code, *capsys.readouterr()

    return call


@pytest.mark.parametrize(
    ("words", "message"),
    some_by_day(
        [
            (("none.sqlite",), "no such results file"),
            (("empty.sqlite",), "empty.sqlite: "),
            (("text.sqlite",), "not a results file"),
            (("idle.sqlite",), "no pair was run"),
            (("run.sqlite", "--budget", "500ms"), "use --budget 3s or more"),
            (("run.sqlite", "--budget", "none"), "nothing to select"),
            (("run.sqlite", "-o", "ci.txt"), "a plan is a .toml file"),
            (("run.sqlite", "-o", "there.toml"), "exists already: --force replaces it"),
            (("run.sqlite", "-o", "none/ci.toml"), "cannot be written"),
        ],
        3,
    ),
)
def test_bad_input_is_one_line(
    tmp_path: Path, cpbench: Callable[..., tuple[int, str, str]], words: tuple[str, ...], message: str
) -> None:
    table = synthetic.table(synthetic.row("a", "s", "failed", 1.0))
    about = synthetic.meta(plan=plan_of(["x"], ["f-a"]))
    synthetic.results_file(tmp_path / "run.sqlite", table, about)
    idle = synthetic.table(synthetic.row("a", "s", "not_run"))
    synthetic.results_file(tmp_path / "idle.sqlite", idle, about)
    (tmp_path / "empty.sqlite").touch()
    (tmp_path / "there.toml").touch()
    (tmp_path / "text.sqlite").write_text("hello\n" * 100)
    code, _, err = cpbench("select", *words)
    assert (code, err.count("\n")) == (2, 1), err
    assert message in err


@pytest.mark.parametrize("status", ["solved", "failed"])
def test_one_solver_or_none_that_solves_gives_a_plan_of_families(
    tmp_path: Path, cpbench: Callable[..., tuple[int, str, str]], status: str
) -> None:
    table = synthetic.table(*(synthetic.row(f"{f}-{k}", "s", status, 1.0) for f in "ab" for k in range(3)))
    plan = plan_of(["problems"], sorted(table["fingerprint"]))
    synthetic.results_file(tmp_path / "run.sqlite", table, synthetic.meta(plan=plan))
    code, out, err = cpbench("select", "run.sqlite", "--seed", "3")
    assert code == 0, err
    assert "2 of 6 problems, 2 of 2 families" in out
    assert "no order to compare" in out
    assert "no further problem tells the solvers apart" in err
    first = (tmp_path / "ci.toml").read_bytes()
    cpbench("select", "run.sqlite", "--seed", "3", "--force")
    assert (tmp_path / "ci.toml").read_bytes() == first


@pytest.mark.nightly
def test_the_plan_runs_within_its_budget(tmp_path: Path, cpbench: Callable[..., tuple[int, str, str]]) -> None:
    """Two solvers on two collections, a choice of them, and the choice run for real."""
    given = ("builtin/lcp/lcp-classics.h5", "builtin/relay/relays.h5", *SOLVERS, "--timeout", "2s")
    common = ("--plan", "none", "--repeats", "1", "-q", "--no-report")
    assert cpbench("run", *given, *common, "-o", "all.sqlite")[0] == 0
    whole = costs.measured_costs(read_results("all.sqlite"))
    budget = 1.25 * whole.expected(0.5 * float(whole.cost.sum()))
    code, _, err = cpbench("select", "all.sqlite", "--budget", f"{budget:.3f}", "-o", "ci.toml")
    assert code == 0, err
    told = (tmp_path / "ci.toml").read_text()
    assert '"builtin/lcp/lcp-classics.h5::' in told
    assert str(tmp_path) not in told
    assert cpbench("run", "--plan", "ci.toml", "-q")[0] == 0
    with Store("ci.sqlite") as store:
        table = store.table()
    part = costs.measured_costs(table)
    assert set(table["family"]) == set(whole.family)
    assert 0 < len(part.cost) < len(whole.cost)
    assert set(table["label"]) == set(whole.rows["label"])
    assert whole.expected(float(part.cost.sum())) <= 2 * budget  # the machine may be busy; the plan itself is within


@pytest.mark.parametrize("kept", [object, "str"])
def test_no_rows_tell_no_costs(kept: Any) -> None:
    """However pandas keeps texts: those of pyarrow are strict about what they are joined with."""
    with pytest.raises(StoreError, match="no pair was run"):
        costs.measured_costs(pd.DataFrame(columns=list(rows_of.TEXT), dtype=kept))
