"""Baselines: the text is the outcome and nothing else, the ratchet turns one way, mistakes by hand have a line."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import synthetic_results as synthetic
from tiers import some_by_day

from cpbench.analysis import baseline, ratchet
from cpbench.analysis import table as rows_of
from cpbench.analysis.ratchet import Change
from cpbench.cli import main
from cpbench.errors import FormatError, StoreError
from cpbench.report import baseline_file


def one(status: str = "solved", **given: object) -> pd.DataFrame:
    """The baseline of one pair."""
    return baseline.outcomes(synthetic.table(synthetic.row("gear-1", "nsgs", status, 0.1, **given)))


def change(old: pd.DataFrame, new: pd.DataFrame, slack: float = ratchet.SLACK) -> tuple[str, str]:
    row = ratchet.changes(old, new, slack).iloc[0]
    return str(row["change"]), str(row["detail"])


# -------------------------------------------------------------------------------------------------- text


def test_times_machine_order_and_date_do_not_show() -> None:
    table = synthetic.suite(problems=12, labels=8)
    rng = np.random.default_rng(3)
    other = table.sample(frac=1.0, random_state=5).assign(
        solve=rng.uniform(size=len(table)), finished="2031-02-03T04:05:06", cpu=1.0, version="9.9", address="/elsewhere"
    )
    text = baseline.text(baseline.outcomes(table))
    assert text == baseline.text(baseline.outcomes(other))
    assert "2026" not in text
    assert "problems/" not in text
    assert "1.0" not in text


def test_text_and_lines_are_one_another() -> None:
    lines = baseline.outcomes(synthetic.suite(problems=6, labels=20))
    kept = baseline.parse(baseline.text(lines), "b.csv")
    assert baseline.text(kept) == baseline.text(lines)
    assert len(kept) == (~lines["status"].isin(baseline.UNMEASURED)).sum() < len(lines)
    assert (ratchet.changes(kept, lines)["change"].isin([Change.SAME, Change.UNMEASURED])).all()


def test_text_columns_as_a_results_file_hands_them_over() -> None:
    """Of this type an empty column and a text make a column of objects, which no other text is added to."""
    table = synthetic.table(synthetic.row("gear-1", "nsgs", "solved", 0.1))
    kind = pd.StringDtype("python", na_value=np.nan)
    read = table.assign(
        sequence=pd.Series("", table.index, dtype=kind), start=pd.Series("cold", table.index, dtype=kind)
    )
    assert baseline.text(baseline.outcomes(read)) == baseline.text(baseline.outcomes(table))


def test_names_may_hold_anything() -> None:
    table = synthetic.table(
        synthetic.row('a "b",\u00e9', "pgs[w=1,s=2]@inner8", "solved", counters='{"inner steps, all": 3, "a=b": 4}'),
        synthetic.row("#c", "mine@head", "solved"),
    ).assign(request=["inner8", "exact"])
    lines = baseline.outcomes(table)
    kept = baseline.parse(baseline.text(lines), "b.csv")
    assert kept.equals(lines)
    assert set(baseline.labels(kept)) == {"pgs[w=1,s=2]@inner8", "mine@head"}
    assert baseline.counters(str(kept["counters"].max())) == {"inner steps, all": 3, "a=b": 4}


@pytest.mark.parametrize(
    ("error", "told"),
    [(0.0, "<=1e-06"), (1e-6, "<=1e-06"), (1.0000001e-6, "1e-05"), (1e-3, "1e-03"), (1.1e-3, "1e-02"), (np.inf, "inf")],
)
def test_an_error_is_reported_by_its_decade(error: float, told: str) -> None:
    assert baseline.decades(pd.Series([error]), pd.Series([1e-6])).tolist() == [told]


def test_a_decade_is_never_below_its_error() -> None:
    errors = pd.Series(10.0 ** np.random.default_rng(0).uniform(-20, 20, 2000))
    upper = baseline.bounds(baseline.decades(errors, pd.Series(1e-6, index=errors.index)))
    assert (upper >= errors * (1 - 1e-9)).all()
    assert (upper <= np.maximum(10.1 * errors, 1e-6)).all()


def test_as_a_table_it_has_the_outcomes_and_no_times() -> None:
    table = synthetic.suite(problems=6, labels=5)
    found = baseline.as_table(baseline.outcomes(table), table)
    merged = found.merge(table, on=["fingerprint", "label"], suffixes=("", "_run"))
    assert len(merged) == len(table) == len(found)
    assert (merged["status"] == merged["status_run"]).all()
    assert (merged["solver"] == merged["solver_run"]).all()
    assert found["solve"].isna().all()
    assert (found["finished"] == "").all()


def test_two_rows_of_one_pair_are_refused() -> None:
    table = synthetic.table(synthetic.row("a", "s", "solved"), synthetic.row("a", "s", "solved"))
    with pytest.raises(StoreError, match="a, s: two rows of one pair"):
        baseline.outcomes(table)


BROKEN = [
    ("", "line 1: is not a baseline"),
    ("node,problem\n", "line 1: is not a baseline"),
    ("# cpbench baseline 7\n", "line 1: is a baseline of version 7"),
    (baseline.HEADER + "\n", "line 2: is not there"),
    ("{head}\na,b\n", "line 2: is 'a,b', expected node,problem"),
    ("{all}<<<<<<< HEAD\n", "line 5: is a mark of a merge conflict"),
    ("{all}# mine\n", "line 5: is a comment"),
    ("{all}lcp,a,f9\n", "line 5: has 3 cells, expected 14"),
    ("{all}{first}", "line 5: tells of the same pair as line 3"),
    ("{all}lcp,a,f9,s,exact,1e-06,cold,1,,,slved,,,\n", "line 5: has status 'slved'"),
    ("{all}lcp,a,f9,s,exact,1e-06,cold,1,,,not_run,,,\n", "line 5: has status 'not_run'"),
    ("{all}lcp,a,f9,s,exact,-1,cold,1,,,solved,,,\n", "line 5: has tolerance '-1'"),
    ("{all}lcp,a,f9,s,exact,1e-06,cold,two,,,solved,,,\n", "line 5: has threads 'two'"),
    ("{all}lcp,a,f9,s,exact,1e-06,cold,1,,,solved,good,,\n", "line 5: has error 'good'"),
    ("{all}lcp,a,f9,s,exact,1e-06,cold,1,,,solved,,iterations,\n", "line 5: has counter 'iterations'"),
    ("{all}lcp,a,f9,s,exact,1e-06,previous,1,,seq,solved,,,\n", "line 5: has sequence 'seq'"),
    ("{all}lcp,a,,s,exact,1e-06,cold,1,,,solved,,,\n", "line 5: has no fingerprint"),
    ('{all}lcp,"a,f9\n', "line 5: is not a line of a table"),
]


@pytest.mark.parametrize(("content", "message"), some_by_day(BROKEN, 9))
def test_mistakes_by_hand_have_a_line(content: str, message: str) -> None:
    whole = baseline.text(baseline.outcomes(synthetic.suite(problems=2, labels=1)))
    head, _columns, first, _ = whole.splitlines(keepends=True)
    content = content.replace("{all}", whole).replace("{head}", head.strip()).replace("{first}", first)
    with pytest.raises(FormatError) as told:
        baseline.parse(content, "b.csv")
    assert str(told.value).startswith(f"b.csv: {message}")
    assert "\n" not in str(told.value)


# ----------------------------------------------------------------------------------------------- changes


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("solved", "solved", Change.SAME),
        ("solved", "timeout", Change.REGRESSED),
        ("timeout", "solved", Change.IMPROVED),
        ("timeout", "max_iter", Change.CHANGED),
        ("crash", "wrong", Change.CHANGED),
        ("wrong", "failed", Change.IMPROVED),
        ("solved", "unavailable", Change.UNMEASURED),
    ],
)
def test_the_status_decides_first(before: str, after: str, expected: Change) -> None:
    assert change(one(before), one(after))[0] == expected


def test_errors_within_the_guard_are_rounding() -> None:
    old = one("inaccurate", error=3e-5)
    assert change(old, one("inaccurate", error=3e-4))[0] == Change.SAME
    assert change(old, one("inaccurate", error=3e-3)) == (Change.REGRESSED, "error 1e-04 -> 1e-02, inaccurate")
    assert change(one("solved", error=0.0), one("solved", error=9e-7))[0] == Change.SAME


def test_counters_within_the_slack_are_rounding() -> None:
    old = one(counters='{"iterations": 100, "pivots": 2}')
    assert change(old, one(counters='{"iterations": 110, "pivots": 3}'))[0] == Change.SAME
    assert change(old, one(counters='{"iterations": 110, "pivots": 3}'), 0.0)[0] == Change.REGRESSED
    worse = one(counters='{"iterations": 111, "pivots": 2}')
    assert change(old, worse) == (Change.REGRESSED, "iterations 100 -> 111")
    assert change(worse, old)[0] == Change.IMPROVED
    mixed = one(counters='{"iterations": 50, "pivots": 9}')
    assert change(old, mixed) == (Change.REGRESSED, "iterations 100 -> 50, pivots 2 -> 9")


def test_a_known_failure_is_strict() -> None:
    """Still failing, otherwise failing, lying, passing; and one that says it is flaky."""
    old = one("timeout").assign(known="upstream 17")
    assert change(old, one("timeout"))[0] == Change.KNOWN
    assert change(old, one("failed"))[0] == Change.KNOWN
    assert change(old, one("wrong"))[0] == Change.REGRESSED
    assert change(old, one("solved")) == (Change.FIXED, "timeout -> solved")
    flaky = old.assign(known="flaky: near the limit")
    assert change(flaky, one("solved"))[0] == Change.KNOWN
    assert change(one("solved").assign(known="flaky"), one("timeout"))[0] == Change.KNOWN
    assert change(flaky, one("crash"))[0] == Change.REGRESSED


# ------------------------------------------------------------------------------------------------ ratchet


def pairs(**status: str) -> pd.DataFrame:
    rows = [synthetic.row(name.replace("_", "-"), "nsgs", told) for name, told in status.items()]
    return baseline.outcomes(synthetic.table(*rows))


def after(lines: pd.DataFrame) -> dict[str, tuple[str, str]]:
    return {row["problem"]: (row["status"], row["known"]) for _, row in lines.iterrows()}


def test_the_ratchet_turns_one_way() -> None:
    old = pairs(better="timeout", worse="solved", gone="solved", mended="crash", same="solved", away="solved")
    old["known"] = old["problem"].map({"mended": "upstream 3"}).fillna("")
    new = pairs(better="solved", worse="wrong", fresh="failed", mended="solved", same="solved", away="not_run")
    found = ratchet.changes(old, new)
    none = ratchet.accepted(found, [])
    kept = {"better": ("solved", ""), "same": ("solved", ""), "mended": ("solved", ""), "fresh": ("failed", "")}
    kept |= {"gone": ("solved", ""), "away": ("solved", "")}
    assert after(ratchet.updated(found, none, "")) == {**kept, "worse": ("solved", "")}
    pruned = after(ratchet.updated(found, none, "", prune=True))
    assert set(pruned) == {*kept, "worse"} - {"gone"}
    meant = ratchet.accepted(found, ["worse:*"])
    taken = ratchet.updated(found, meant, "law changed")
    assert after(taken) == {**kept, "worse": ("wrong", "law changed")}
    again = ratchet.changes(taken, new)
    assert after(ratchet.updated(again, ratchet.accepted(again, []), ""))["worse"] == ("wrong", "law changed")
    assert Change.REGRESSED not in set(again["change"])


def test_drift_within_the_slack_never_adds_up() -> None:
    """A counter that creeps up by 5 % a run is told as soon as it is 10 % above what the file has."""
    lines, told = one(counters='{"iterations": 1000}'), []
    for k in range(1, 4):
        found = ratchet.changes(lines, one(counters=f'{{"iterations": {1000 + 50 * k}}}'))
        lines = ratchet.updated(found, ratchet.accepted(found, []), "")
        told.append(str(found["change"].iloc[0]))
    assert told == ["same", "same", "regressed"]
    assert lines["counters"].tolist() == ["iterations=1000"]


def test_labels_with_brackets_mean_themselves() -> None:
    table = synthetic.table(synthetic.row("p", "nsgs[omega=1.2]", "solved"))
    found = ratchet.changes(baseline.outcomes(table), baseline.outcomes(table.assign(status="failed")))
    for pattern in ("nsgs[omega=1.2]", "p:nsgs[omega=1.2]", "p", "nsgs*", "p:*"):
        assert ratchet.accepted(found, [pattern]).all(), pattern
    assert not ratchet.accepted(found, ["q*"]).any()


# --------------------------------------------------------------------------------------------------- files


def test_files_come_back_and_are_written_whole(tmp_path: Path) -> None:
    table = synthetic.suite(problems=4, labels=3)
    path = tmp_path / "b.csv"
    baseline_file.write(path, baseline.outcomes(table))
    assert path.read_bytes() == baseline.text(baseline.outcomes(table)).encode()
    assert [p.name for p in tmp_path.iterdir()] == ["b.csv"]
    found = baseline_file.table(path, table)
    assert set(found["fingerprint"]) == set(table["fingerprint"])
    with pytest.raises(FormatError, match="no such baseline"):
        baseline_file.read(tmp_path / "none.csv")
    path.write_bytes(path.read_bytes() + b"\xff\n")
    with pytest.raises(FormatError, match=r"line \d+: is not UTF-8"):
        baseline_file.read(path)
    with pytest.raises(FormatError, match="cannot be written"):
        baseline_file.write(tmp_path / "none" / "b.csv", baseline.outcomes(table))


# ----------------------------------------------------------------------------------------- command line


@dataclass(frozen=True)
class Told:
    code: int
    out: str
    err: str


@pytest.fixture
def cpbench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Told]:
    """The command line, in this process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> Told:
        monkeypatch.setattr(sys, "argv", ["cpbench", *words])
        code = 0
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
        return Told(code, *capsys.readouterr())

    return run


def test_the_command_writes_checks_and_updates(tmp_path: Path, cpbench: Callable[..., Told]) -> None:
    table = synthetic.suite(problems=4, labels=3)
    done = table.index[table["status"] == "solved"]
    synthetic.results_file(tmp_path / "a.sqlite", table)
    later = table.copy()
    later.loc[done[0], ["status", "error"]] = ["wrong", 0.2]
    synthetic.results_file(tmp_path / "w.sqlite", later)
    wrote = cpbench("baseline", "a.sqlite", "-o", "b.csv")
    assert wrote.code == 0, wrote
    first = (tmp_path / "b.csv").read_bytes()
    assert cpbench("baseline", "a.sqlite", "-o", "b.csv").code == 2
    same = cpbench("baseline", "a.sqlite", "--check", "b.csv", "--fail-on", "regression,wrong,changed")
    assert same.code == 0
    assert "same" in same.out
    worse = cpbench("baseline", "w.sqlite", "--check", "b.csv")
    assert worse.code == 0
    assert "solved -> wrong" in worse.out
    failed = cpbench("baseline", "w.sqlite", "--check", "b.csv", "--fail-on", "regression,wrong")
    assert failed.code == 1
    assert "1 regression, 1 wrong" in failed.err
    cpbench("baseline", "w.sqlite", "--update", "-o", "b.csv")
    assert (tmp_path / "b.csv").read_bytes() == first
    row = table.loc[done[0]]
    how = ("--accept", f"{row['problem']}:{row['label']}", "--reason", "law, changed")
    taken = cpbench("baseline", "w.sqlite", "--update", "-o", "b.csv", *how, "--fail-on", "regression")
    assert taken.code == 0, taken
    assert ',"law, changed"\n' in (tmp_path / "b.csv").read_text()
    mended = cpbench("baseline", "a.sqlite", "--check", "b.csv", "--fail-on", "fixed")
    assert mended.code == 1
    assert "fixed" in mended.out


@pytest.mark.parametrize(
    ("words", "message"),
    some_by_day(
        [
            (("none.sqlite", "-o", "b.csv"), "no such results file"),
            (("empty.sqlite", "-o", "b.csv"), "empty.sqlite: "),
            (("idle.sqlite", "-o", "b.csv"), "none of 2 pairs was run"),
            (("text.sqlite", "-o", "b.csv"), "not a results file"),
            (("run.sqlite",), "say -o FILE"),
            (("run.sqlite", "--check", "text.sqlite"), "line 1: is not a baseline"),
            (("run.sqlite", "--check", "none.csv"), "no such baseline"),
            (("run.sqlite", "--check", "good.csv", "--fail-on", "regresion"), "unknown change 'regresion'"),
            (("run.sqlite", "--update", "-o", "good.csv", "--accept", "x*"), "--accept PATTERN needs --reason"),
            (("run.sqlite", "--update", "-o", "good.csv", "--accept", "x*", "--reason", "r"), "no pair that got worse"),
            (("run.sqlite", "-o", "good.csv", "--prune"), "add --update"),
        ],
        5,
    ),
)
def test_bad_input_is_one_line(
    tmp_path: Path, cpbench: Callable[..., Told], words: tuple[str, ...], message: str
) -> None:
    table = synthetic.table(synthetic.row("a", "s", "solved", 0.1), synthetic.row("b", "s", "failed", 0.1))
    synthetic.results_file(tmp_path / "run.sqlite", table)
    idle = synthetic.table(synthetic.row("a", "s", "not_run"), synthetic.row("b", "s", "not_run"))
    synthetic.results_file(tmp_path / "idle.sqlite", idle)
    (tmp_path / "empty.sqlite").touch()
    (tmp_path / "text.sqlite").write_text("hello\n" * 100)
    baseline_file.write(tmp_path / "good.csv", baseline.outcomes(table))
    told = cpbench("baseline", *words)
    assert (told.code, told.err.count("\n")) == (2, 1), told
    assert message in told.err


def test_licences_that_restrict_publishing_are_named(tmp_path: Path, cpbench: Callable[..., Told]) -> None:
    about = synthetic.meta(solvers={"s": {"name": "s", "publishing": "ask first"}})
    synthetic.results_file(tmp_path / "r.sqlite", synthetic.table(synthetic.row("a", "s", "solved", 0.1)), about)
    told = cpbench("baseline", "r.sqlite", "-o", "b.csv")
    assert (told.code, told.err.count("\n")) == (0, 1)
    assert "restrict publishing figures of s" in told.err


@pytest.mark.parametrize("kept", [object, "str"])
def test_no_rows_are_a_baseline_without_lines(kept: Any) -> None:
    """However pandas keeps texts: those of pyarrow are strict about what they are joined with."""
    none = baseline.outcomes(pd.DataFrame(columns=list(rows_of.TEXT), dtype=kept))
    assert baseline.parse(baseline.text(none), "b.csv").empty
    assert baseline.as_table(none.astype(kept)).empty
    found = ratchet.changes(none.astype(kept), none.astype(kept))
    assert found.empty
    accept = ratchet.accepted(found, ["*"])
    assert ratchet.updated(found, accept, "known").empty
    assert ratchet.changes(one(), none.astype(kept))["change"].tolist() == [Change.VANISHED]
    assert ratchet.changes(none.astype(kept), one())["change"].tolist() == [Change.NEW]


@pytest.mark.needs("cpbench_solvers")
def test_a_run_without_any_sequence_has_a_baseline(tmp_path: Path) -> None:
    """Columns of a real file that hold nothing are none of text."""
    from cpbench import LCP, run
    from cpbench.api import baselines

    run(LCP(M=[[2.0]], q=[-1.0], name="one"), ["lemke"], repeats=1, out=tmp_path / "r.sqlite")
    kept, restricted = baselines.outcomes(tmp_path / "r.sqlite")
    assert kept[["problem", "status", "sequence"]].values.tolist() == [["one", "solved", ""]]
    assert (baselines.measured(kept), restricted) == (1, [])
