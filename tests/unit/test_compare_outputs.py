"""`cpbench compare`: exit codes, messages on bad input, and what it writes."""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import command_line
import pandas as pd
import pytest
from synthetic_results import row, suite
from tiers import some_by_day

from cpbench.analysis.comparison import ComparisonSide, compare
from cpbench.bench.results.rows import MEASURED, PLANNED, Row
from cpbench.bench.results.store import Store
from cpbench.report.comparison import markdown

NAMES = (*PLANNED, *MEASURED)
Make = Callable[..., Path]


@pytest.fixture
def made(tmp_path: Path) -> Make:
    """Writes a results file of rows."""

    def make(name: str, rows: list[dict[str, Any]] | pd.DataFrame, **meta: Any) -> Path:
        path = tmp_path / name
        records: list[Any] = rows.to_dict("records") if isinstance(rows, pd.DataFrame) else rows
        with Store(path, create=True) as store:
            store.add(
                Row(**{n: None if pd.isna(value := given.get(n)) else value for n in NAMES})
                for given in ({"host": "here", **r} for r in records)
            )
            store.set_meta(cpbench="0.1.0", **meta)
            store.note_machine("here", {"cpu": "a processor", "cores": 2})
            store.add_reference(0, 1e-4)
        return path

    return make


@pytest.fixture
def cpbench() -> Callable[..., tuple[int, str, str]]:
    """Exit code, what was printed, and what was said on stderr."""

    def run(*words: object) -> tuple[int, str, str]:
        done = command_line.cpbench(Path.cwd(), "compare", *words)
        return done.returncode, done.stdout, done.stderr

    return run


def changed(*statuses: tuple[str, str]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    base = [row(f"p{k}", "s", old, 1e-3) for k, (old, _) in enumerate(statuses)]
    return base, [row(f"p{k}", "s", new, 1e-3) for k, (_, new) in enumerate(statuses)]


# ------------------------------------------------------------------------------------------ exit codes


@pytest.mark.parametrize(
    ("statuses", "asked", "code"),
    some_by_day(
        [
            ([("solved", "crash")], None, 0),
            ([("solved", "crash")], "wrong", 0),
            ([("solved", "crash")], "wrong,crash", 1),
            ([("solved", "timeout")], "regression", 1),
            ([("solved", "timeout")], "timeout", 1),
            ([("wrong", "wrong")], "regression,wrong,crash", 0),
            ([("failed", "wrong")], "wrong", 1),
            ([("failed", "solved")], "regression,wrong,crash,inconclusive", 0),
            ([("solved", "unavailable")], "regression,wrong,crash", 0),
            ([("solved", "unavailable")], "inconclusive", 1),
            ([("failed", "failed")], "regression,wrong,crash,inconclusive", 0),
        ],
        4,
    ),
)
def test_only_fail_on_ends_with_1(made: Make, cpbench, statuses, asked, code) -> None:
    base, new = changed(*statuses)
    files = made("base.sqlite", base), made("new.sqlite", new)
    assert cpbench(*files, *(["--fail-on", asked] if asked else []))[0] == code


def test_stationary_answers_count_where_that_is_environment(made: Make, cpbench) -> None:
    base, new = changed(("solved", "stationary"), ("stationary", "stationary"))
    files = made("base.sqlite", base), made("new.sqlite", new)
    code, told, _ = cpbench(*files, "--fail-on", "regression")
    assert code == 1
    assert "stationary, and not among the solved: 1 in the base, 2 in the new results" in told
    code, told, _ = cpbench(*files, "--fail-on", "regression", "--count-stationary")
    assert code == 0, told
    assert "stationary answers are counted as solved (--count-stationary)" in told


@pytest.mark.nightly
def test_two_builds_of_one_run(made: Make, cpbench) -> None:
    rows = [
        row(f"{'abc'[k % 3]}-{k}", f"x@{name}", "solved", 1e-3 * factor * (1 + 0.01 * (k % 3)), solver=f"x@{name}",
            request="exact")
        for name, factor in (("base", 1.0), ("again", 1.001), ("head", 1.5))
        for k in range(12)
    ]  # fmt: skip
    run = made("run.sqlite", rows)
    code, told, err = cpbench(
        run, "--a", "x@base", "--b", "x@head", "--noise", "x@base,x@again", "--fail-on", "regression"
    )
    assert code == 1, told + err
    assert told.startswith("regressed: 12 pairs compared; ") or told.startswith("regressed: 12 pairs compared: ")
    assert "x@head: 1.500" in told
    assert "equal builds 0.1% apart" in told
    assert cpbench(run, "--a", "x@base", "--b", "x@again", "--fail-on", "regression,inconclusive")[0] == 0
    assert cpbench(run, run, "--noise", "x@base,x@again")[0] == 0


# ------------------------------------------------------------------------------------------- bad input


def test_bad_input_is_one_line(made: Make, cpbench, tmp_path: Path) -> None:
    good = made("good.sqlite", [row("p", "s", "solved"), row("p", "x@a", "solved", solver="x@a")])
    empty = tmp_path / "empty.sqlite"
    empty.touch()
    foreign = tmp_path / "foreign.sqlite"
    foreign.write_bytes(b"this is no database" * 100)
    newer = made("newer.sqlite", [row("p", "s", "solved")])
    with sqlite3.connect(newer) as db:
        db.execute("PRAGMA user_version=99")
    db.close()
    bare = made("bare.sqlite", [])
    others = made("others.sqlite", [row("q", "s", "solved")])
    for words, expected in (
        ([empty, good], "empty.sqlite"),
        ([good, empty], "empty.sqlite"),
        ([foreign, good], "foreign.sqlite"),
        ([good, newer], "newer"),
        ([tmp_path / "nowhere.sqlite", good], "no such results file"),
        ([good, bare], "has no rows"),
        ([good, others], "no pair in common: they share no problem"),
        ([good], "NEW, or --a and --b is missing"),
        ([good, "--a", "s"], "--b is missing"),
        ([good, "--b", "s"], "--a is missing"),
        ([good, "--a", "s", "--b", "s"], "compared with itself"),
        ([good, "--a", "s", "--b", "x@b"], "did you mean x@a"),
        ([good, "--a", "x", "--b", "s"], "unknown solver or label of the results 'x'"),
        ([good, good, "--a", "s"], "leave"),
        ([good, good, "--noise", "s"], "is not two labels"),
        ([good, good, "--noise", "s,t"], "'t'"),
        ([good, good, "--fail-on", "wrogn"], "did you mean wrong"),
        ([good, good, "-o", tmp_path / "x.html"], "unknown suffix '.html'"),
        ([good, good, "-o", tmp_path / "no" / "x.md"], "cannot be written"),
        ([good, good, "--margin", "-1"], "--margin"),
        ([good, good, "--margin", "-1"], "--margin"),
    ):
        code, out, err = cpbench(*words)
        assert code == 2, (words, out, err)
        assert expected in err, (words, err)
        assert err.startswith("cpbench: ")
        assert err.count("\n") == 1, err


def test_a_solver_that_the_other_file_lacks_is_named(made: Make, cpbench) -> None:
    one, two = made("one.sqlite", [row("p", "s", "solved")]), made("two.sqlite", [row("p", "t", "solved")])
    code, _, err = cpbench(one, two)
    assert code == 2
    assert "they share 1 problems and no solver; two solvers of one run: --a X --b Y" in err


def test_what_is_little_is_a_result(made: Make, cpbench) -> None:
    """One solver, one problem; nothing solved anywhere; nothing started."""
    one = made("one.sqlite", [row("p", "s", "solved", 1e-3)])
    assert cpbench(one, one)[0] == 0
    failed = made("failed.sqlite", [row("p", "s", "timeout"), row("q", "s", "wrong", 1e-3)])
    code, told, _ = cpbench(failed, failed, "--fail-on", "regression,wrong,crash,inconclusive")
    assert code == 0
    assert told.startswith("same: ")
    assert "no pair was solved on both sides" in told
    idle = made("idle.sqlite", [row("p", "s", "unavailable")])
    code, told, _ = cpbench(idle, idle)
    assert code == 0
    assert told.startswith("inconclusive: 0 pairs compared")
    assert "1 pairs were started on neither side" in told


# --------------------------------------------------------------------------------------------- outputs


@pytest.fixture
def found():
    base = suite(labels=10)
    new = base.assign(solve=base["solve"] * 1.3, host="here")
    solved, failed = (base.index[base["status"] == status] for status in ("solved", "failed"))
    for at, status in ((solved[3], "crash"), (solved[30], "wrong"), (solved[50], "unavailable"), (failed[0], "solved")):
        new.loc[at, ["status", "message"]] = [status, "because | of *this*"]
    machines = {"here": {"cpu": "x"}}
    return compare(
        ComparisonSide("base.sqlite", base.assign(host="here"), {"cpbench": "0.1"}, machines),
        ComparisonSide("new.sqlite", new, {"cpbench": "0.2"}, machines),
    )


def test_all_forms_are_written(made: Make, cpbench, tmp_path: Path) -> None:
    files = made("base.sqlite", suite(labels=4)), made("new.sqlite", suite(labels=4, seed=2))
    paths = [tmp_path / f"out.{suffix}" for suffix in ("md", "json")]
    code, _, err = cpbench(*files, *(word for path in paths for word in ("-o", path)))
    assert code == 0, err
    assert all(path.stat().st_size > 1000 for path in paths)
    told = json.loads(paths[1].read_text(), parse_constant=pytest.fail)
    assert told["schema"] == 1
    assert told["verdict"] == "regressed"
    assert sum(told["counts"].values()) == len(told["pairs"])
    assert {p["verdict"] for p in told["pairs"]} <= set(told["counts"])
    assert told["pairs"][0]["command"].startswith("cpbench solve ")
    assert {p["time_new"] for p in told["pairs"] if p["status_new"] == "wrong"} == {"inf"}
    assert None in {p["ratio"] for p in told["pairs"]}


def test_markdown_begins_with_the_verdict_and_shows_commands(found) -> None:
    told = markdown.document(found)
    first, *_ = told.splitlines()
    assert first.startswith("**❌ Regressed**: ")
    assert told.index("## Regressed (") < told.index("## By solver") < told.index("## Improved (")
    assert told.index("## Improved (") < told.index("## Inconclusive (") < told.index("## Notes")
    assert "| crash | solved → crash |" in told
    assert "`cpbench solve " in told
    assert "cpbench 0.1 → 0.2" in told


def test_names_cannot_become_markup() -> None:
    evil = "<b>|`x`](http://e)\n# h"
    base = [row(evil, evil, "solved", message=evil), row("p", evil, "solved")]
    new = [{**base[0], "status": "unavailable"}, {**base[1], "status": "wrong"}]
    pair = compare(ComparisonSide("a", pd.DataFrame(base)), ComparisonSide("b`\n", pd.DataFrame(new)))
    told = markdown.document(pair)
    assert "<b>" not in re.sub(r"(`+) .*? \1", "", told), "but in code spans"
    assert "\n# h" not in told
    assert len({line.count("|") - line.count("\\|") for line in told.splitlines() if line.startswith("| p |")}) == 1


def test_a_restriction_on_publishing_is_reported() -> None:
    rows = pd.DataFrame([row("p", "vendor", "solved")])
    sheets = {"vendor": {"name": "vendor", "publishing": "ask first"}}
    pair = compare(ComparisonSide("a", rows, {"solvers": sheets}), ComparisonSide("b", rows))
    assert "publishing figures of vendor is restricted: ask first" in pair.notes
