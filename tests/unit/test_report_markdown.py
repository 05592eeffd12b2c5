"""The Markdown report: complete, the same bytes twice, and unmoved by what names and messages contain."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pandas as pd
import pytest
from markdown_it import MarkdownIt
from synthetic_results import meta, row, suite, table
from tiers import some_by_day
from written_reports import whole, write_report

from cpbench.analysis import bootstrap, means, profiles
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import participating
from cpbench.analysis.run_table import RunTable
from cpbench.cli.answer import print_answer
from cpbench.report import documents, figures
from cpbench.report.run import ProblemOrigin, assembled
from cpbench.report.text import seconds, solve_command

RENDER = MarkdownIt("commonmark").enable("table")


def report(rows: pd.DataFrame, folder: Path, drawn: bool = False, **facts: object) -> str:
    path = write_report(rows, meta(**facts), folder, "A title", drawn=drawn)
    assert path == folder / "report.md"
    return whole(path)


def check_pictures(text: str, folder: Path) -> None:
    targets = re.findall(r"\]\(([^)]+\.(?:png|svg))\)", text)
    assert targets
    for target in targets:
        assert (folder / target).stat().st_size > 1000


def check_whole(text: str) -> None:
    """Every table is one, no cell is broken."""
    tokens = RENDER.parse(text)
    rows = [t for t in tokens if t.type == "tr_open"]
    head = sum(1 for line in text.splitlines() if re.fullmatch(r"\|(-+:?\|)+", line))
    assert sum(1 for t in tokens if t.type == "table_open") == head
    bodies = sum(1 for line in text.splitlines() if line.startswith("| "))
    assert len(rows) == bodies
    assert not re.search(r"\b(nan|None|inf)\b", text), "numbers that are none are shown as — and ∞"


def test_a_run_of_every_outcome(tmp_path: Path) -> None:
    text = report(suite(45, 20), tmp_path, drawn=True, refused=[["bad.h5", "bad.h5: W: is NaN at 3"]])
    check_pictures(text, tmp_path)
    check_whole(text)
    for heading in (
        "## False claims: claims that do not hold",
        "## Hardest problems",
        "## Limitations of this run",
        "## Where the details are",
        "## lcp",
        "### Ranking",
        "### Times",
        "### Verdicts",
        "### By family",
        "## Claims of each solver",
        "## Failures by reason",
        "## Accepted, but in a wrong direction",
        "## Routes that promise less than an answer",
        "## Never started",
        "## Refused files (1)",
        "## Limits and machine",
        "## Methods",
    ):
        assert f"\n{heading}" in text, heading
    assert "is NaN at 3" in text
    rows = pd.read_csv(tmp_path / "results.csv")
    assert len(rows) == 45 * 20
    assert (rows["time"] < float("inf")).sum() == (rows["status"] == "solved").sum()


@pytest.mark.nightly
def test_the_same_data_give_the_same_bytes(tmp_path: Path) -> None:
    rows = suite(6, 9)
    one, two = tmp_path / "one", tmp_path / "two"
    report(rows, one, drawn=True)
    report(rows.sample(frac=1.0, random_state=1), two, drawn=True)
    names = sorted(p.name for p in one.iterdir())
    assert names == ["answer.png", "details.md", "report.md", "results.csv"]
    for name in names:
        assert (one / name).read_bytes() == (two / name).read_bytes(), name


def test_the_measure_of_others_stands_beside_the_error(tmp_path: Path) -> None:
    """Of three answers one passes both at 1e-6, one the error alone and one the natural residual alone."""
    numbers = ((1e-9, 1e-8), (1e-7, 1e-5), (1e-3, 1e-7))
    rows = [
        row(
            f"a-{k}", "pgs", "solved" if error <= 1e-6 else "wrong", 1e-3, error=error, parts=f'{{"natural": {theirs}}}'
        )
        for k, (error, theirs) in enumerate(numbers)
    ]
    text = report(table(*rows, row("a-0", "lemke", "solved", 1e-3)), tmp_path)
    section = text[text.index("### Error and `natural`") :].split("\n\n")[1].splitlines()
    assert [line.split(" | ")[1:] for line in section[2:]] == [["3", "1e-07", "1e-07", "1", "1", "1 |"]]


def test_counts_in_the_report_are_those_of_the_table(tmp_path: Path) -> None:
    text = report(
        table(
            row("a-1", "lemke", "solved", 1e-3),
            row("a-2", "lemke", "wrong", 1e-6, message="thought so"),
            row("a-1", "pgs", "solved", 2e-3),
            row("a-2", "pgs", "solved", 5e-3, flags="direction", parts='{"slip_angle [deg]": 44.2}'),
        ),
        tmp_path,
    )
    assert text.splitlines()[2] == "- Too few to say, with fewer than 20 problems or one solver: lcp (2 problems)."
    assert "\n| solver | lcp |\n|---|---:|\n| `pgs` | 2/2 ×1.41 |\n| `lemke` | 1/2 ×1, 1 false |\n" in text
    assert "\n**3 of 4 pairs solved** (2 problems, 2 solver configurations); 1 false claim." in text
    assert "| `pgs` | 2 of 2 | · | · | · | 1 | 1 | 3.5 ms | 1.41 | 1.0e-09 | direct |" in text
    assert "| `lemke` | 1 of 2 | · | · | 1 | · | 1 | 1 ms | 1 | 1.0e-09 | direct | claims that fail 1 |" in text
    assert "| `pgs` | 5 ms | 5 ms | 1.5 | 100% | 3.29 ms | 2 ms | 1 |" in text
    assert "| a-2 | `pgs` | solved | 1e-09 | 44.2 |" in text
    again = "cpbench solve problems/a-2.h5 -s lemke --tolerance 1e-06 --timeout 10s"
    assert f"| a-2 | lcp | n 3 | `lemke` | solved | wrong | 0.2 | 1e-06 | `{again}` |" in text
    assert f"| wrong | 1 | `lemke 1` | thought so | `{again}` |" in text


def test_the_answer_of_enough_problems_says_what_to_use(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A busy machine takes away what hangs on times, and nothing of what was solved; on the terminal, too."""
    rows = table(*(row(f"p-{k}", s, "solved", t) for k in range(20) for s, t in (("fast", 1.0), ("slow", 2.0))))
    quiet = report(rows, tmp_path)
    assert "\n- **lcp** (linear complementarity problem): use **`fast`**: it solves 20 of 20 problems, " in quiet
    assert "| `slow` | 20/20 ×2 |" in quiet
    busy = report(rows.assign(loadavg=9.0), tmp_path, machine={"threads": 2})
    assert "problem): most problems were solved by `fast`, `slow`: 20 of 20.\n" in busy
    assert "| `slow` | 20/20 |" in busy
    assert "; load 9.0, at most 9.0. **Do not rely on these times: the load was beyond the 2 cores" in busy
    for load, said in ((0.1, "use fast: it solves"), (9.0, "most problems were solved by fast, slow: 20 of 20.")):
        print_answer(RunTable.of(rows.assign(loadavg=load), meta(machine={"threads": 2})))
        printed = capsys.readouterr().out
        assert f"lcp (linear complementarity problem): {said}" in printed
        assert ("Do not rely on these times" in printed) == ("Which solver to use:" not in printed) == (load > 2)
    # a mean of 20 ratios, each of which a machine changes by a factor ρ at most to either side, is within ρ^0.607 at
    # 95 % (Hoeffding): 3.12^0.607 < 2 < 3.14^0.607
    least = "; fast took least time, in the mean by more than the machine's changes explain."
    for longest, parts, said in ((0.0312, 1, least), (0.0314, 1, "."), (0.0312, 2, ".")):
        references = [{"seconds": 0.01, "pairs": 0}, {"seconds": longest, "pairs": 2 - parts}]
        print_answer(RunTable.of(rows.assign(loadavg=0.1), meta(machine={"threads": 2}, references=references)))
        assert f"most problems were solved by fast, slow: 20 of 20{said}\n" in " ".join(
            capsys.readouterr().out.split("\n    ")
        )


def test_a_solver_that_ends_at_stationary_points_is_named_beside_those_that_solve_most(tmp_path: Path) -> None:
    rows = [
        *(row(f"p-{k}", "local", "solved" if k < 8 else "stationary", 1.0) for k in range(20)),
        *(row(f"p-{k}", "convex", "solved" if k < 9 else "failed", 1.0) for k in range(20)),
    ]
    busy = report(table(*rows).assign(loadavg=9.0), tmp_path, machine={"threads": 2})
    assert "by `convex`: 9 of 20; `local` solved 8, and 12 more to a stationary point.\n" in busy


def test_the_hardest_problems_are_told_with_where_they_are_from(tmp_path: Path) -> None:
    rows = table(
        *(row("hard-1", label, "wrong", 1.0, error=error) for label, error in (("s", 0.5), ("t", 0.1))),
        *(row("easy-1", label, "solved", 1.0) for label in "st"),
        *(row("none-1", label, "infeasible") for label in "st"),
    )
    text = whole(write_report(rows, meta(), tmp_path, "t", origins={"hard": ProblemOrigin("a paper", "CC0-1.0")}))
    lines = text[text.index("## Hardest problems") :].split("\n\n")[2].splitlines()[2:]
    assert lines == ["| hard-1 | lcp | n 3 | 0 of 2 | 0.1 | `t` | a paper | CC0-1.0 | `problems/hard-1.h5` |"]


@pytest.mark.parametrize(
    "rows",
    some_by_day(
        [
            pd.DataFrame(),
            table(),
            table(row("p", "s", "solved", 1.0)),
            table(row("p", "s", "crash", signal=-11)),
            table(row("p", "s", "not_run"), row("p", "t", "not_run")),
            table(*(row(f"p-{i}", s, "timeout") for i in range(3) for s in ("s", "t"))),
            table(*(row(f"p-{i}", "s", "solved", 0.0) for i in range(3))),
        ],
        3,
    ),
    ids=["no columns", "no rows", "one solved", "one crashed", "nothing run", "none solved", "zero seconds"],
)
def test_small_and_sad_tables(rows: pd.DataFrame, tmp_path: Path) -> None:
    check_whole(report(rows, tmp_path))


def test_facts_may_be_missing(tmp_path: Path) -> None:
    path = write_report(suite(3, 3).assign(seconds=math.inf), {}, tmp_path, "t")
    assert "; limit none" in path.read_text()


@pytest.mark.nightly
def test_settings_are_reported_apart(tmp_path: Path) -> None:
    text = report(
        table(
            row("p", "s", "solved", 1.0),
            row("p", "s", "wrong", 1.0, tolerance=1e-8, key="2"),
            *(row("p", other, "solved", 2.0, tolerance=1e-8, key=other) for other in ("t", "u")),
            row("q", "s", "solved", 1.0, node="qp"),
        ),
        tmp_path,
    )
    check_whole(text)
    for heading in ("## lcp, tolerance 1e-08", "## lcp, tolerance 1e-06", "## qp"):
        assert f"\n{heading}\n" in text


def test_one_solver_alone_has_no_profile(tmp_path: Path) -> None:
    text = report(suite(6, 1), tmp_path, drawn=True)
    check_whole(text)
    assert "answer.png" not in text
    assert not list(tmp_path.glob("*.png"))


def test_no_folder_of_the_machine_is_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    here = str(tmp_path)
    text = report(
        table(row("p", "s", "error", address=f"{here}/in/p.h5", message=f"cannot read {here}/in/p.h5")),
        tmp_path / "out",
        refused=[[f"{here}/bad.h5", f"{here}/bad.h5: is no HDF5 file"]],
        command=f"cpbench run {here}/in",
    )
    assert here not in text
    assert here not in (tmp_path / "out" / "results.csv").read_text()
    assert "cpbench solve in/p.h5 -s s" in text


def test_commands_load_the_file_that_a_solver_comes_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    sheets = {
        "mine": {"name": "mine", "plugin": f"{tmp_path}/mine.toml"},
        "pgs@x": {"name": "pgs@x", "plugin": f"{tmp_path}/other.toml", "variant_of": ""},
    }
    text = report(
        table(row("p", "mine", "error"), row("p", "pgs@x", "crash", key="2", request="exact")),
        tmp_path / "out",
        solvers=sheets,
    )
    assert "-s mine --tolerance 1e-06 --timeout 10s --plugin mine.toml`" in text
    assert "-s pgs@x --tolerance 1e-06 --timeout 10s --plugin other.toml`" in text


def test_commands_name_the_route() -> None:
    base = {"address": "p.h5", "tolerance": 1e-8, "solver": "lemke", "seconds": math.inf, "start": "cold"}

    def command(label: str, request: str) -> str:
        return solve_command({**base, "label": label, "request": request})

    assert command("lemke[rule=x]", "exact") == "cpbench solve p.h5 -s 'lemke[rule=x]' --tolerance 1e-08"
    warm = {**base, "address": "s.h5::3", "label": "nsgs", "request": "exact", "start": "previous"}
    assert (
        solve_command(warm) == "cpbench run s.h5 --plan none -o again.sqlite -s nsgs --tolerance 1e-08 --start previous"
    )
    assert command("lemke@outer8-mlcp", "outer8-mlcp") == (
        "cpbench solve p.h5 -s lemke --via 'fc-mlcp-outer[facets=8]' --tolerance 1e-08"
    )
    assert command("admm-coneqp@fc-coneqp-compliant[compliance=0.001]", "fc-coneqp-compliant[compliance=0.001]") == (
        "cpbench solve p.h5 -s admm-coneqp --via 'fc-coneqp-compliant[compliance=0.001]' --tolerance 1e-08"
    )
    assert command("lemke@fc-lcp-inner[facets=16]", "fc-lcp-inner[facets=16]") == (
        "cpbench solve p.h5 -s lemke --via 'fc-lcp-inner[facets=16]' --tolerance 1e-08"
    )
    assert command("lemke@gfc-fc+fc-lcp-inner", "gfc-fc+fc-lcp-inner") == (
        "cpbench solve p.h5 -s lemke --via gfc-fc --via fc-lcp-inner --tolerance 1e-08"
    )
    assert command("lemke@necessary", "necessary") == "cpbench solve p.h5 -s lemke --routes all --tolerance 1e-08"


def test_times_of_a_drifting_machine_are_marked(tmp_path: Path) -> None:
    rows = suite(3, 3)
    references = [{"at": "t", "pairs": k, "seconds": s, "loadavg": 0.5} for k, s in enumerate((1e-3, 2e-3, math.nan))]
    busy = report(rows.assign(jobs=2.0), tmp_path, references=references)
    assert "taken while up to 2 solves ran side by side" in busy
    assert "it took 1 ms to 2 ms, a drift of the machine by a factor 2.00. Ratios of two times below that are" in busy
    assert "**Do not rely on these times: one and the same solve took up to 2.0 times as long" in busy


def test_warm_starts_are_set_beside_cold_ones(tmp_path: Path) -> None:
    cold = [row(f"p-{i}", "s", "solved", 2.0) for i in range(4)]
    warm = [row(f"p-{i}", "s", "solved", 1.0, start="previous", started="previous") for i in range(4)]
    text = report(table(*cold, *warm), tmp_path)
    assert "| lcp | `s` | `previous` | 4 | 4 | 4 | 0 | 0.5 | — |" in text
    assert "## Warm against cold" not in report(table(*cold), tmp_path)


def test_what_does_not_compare_has_a_remark(tmp_path: Path) -> None:
    rows = table(
        row("a", "s", "solved", 1.0, start="previous", started="cold: no ids"),
        row("b", "s", "solved", 1.0, start="previous", started="previous"),
        row("a", "path", "solved", 1.0, start="previous", started="previous"),
    )
    text = report(rows, tmp_path, solvers={"path": {"launches": True}})
    assert re.search(r"\| `s` \|.*\| fell back to cold 1 \|", text)
    assert re.search(r"\| `path` \|.*\| launches a program \|", text)


def test_stationary_has_a_column_and_is_counted_where_that_is_environment(tmp_path: Path) -> None:
    rows = table(
        row("a-1", "lemke", "solved", 1e-3),
        row("a-2", "lemke", "stationary", 1e-3, claim="solved", flags="stationary"),
    )
    text = report(rows, tmp_path)
    assert "**1 of 2 pairs solved**" in text
    assert "1 more stationary, not counted as solved." in text
    assert "| `lemke` | 1 of 2 | · | 1 | · |" in text
    counted = write_report(rows, meta(), tmp_path, "A title", count_stationary=True).read_text(encoding="utf-8")
    assert "**2 of 2 pairs solved**" in counted
    assert "Stationary answers are counted as solved (--count-stationary)." in counted
    assert "| `lemke` | 2 of 2 | · | · | · |" in whole(tmp_path / "report.md")


@pytest.mark.parametrize(("number", "lines"), [(3, 100), pytest.param(20, 120, marks=pytest.mark.nightly)])
def test_a_report_of_a_large_run_is_short(tmp_path: Path, number: int, lines: int) -> None:
    """Of many formulations, each with failures of every kind: the answer and what must be known fit some lines."""
    nodes = [f"node{k:02d}" for k in range(number)]
    parts = [suite(9, 18, seed=k).assign(node=node) for k, node in enumerate(nodes)]
    rows = pd.concat([part.assign(key=part["key"] + part["node"]) for part in parts], ignore_index=True)
    text = write_report(rows, meta(), tmp_path, "A title").read_text(encoding="utf-8")
    check_whole(text)
    assert len(text.splitlines()) <= lines
    for node in nodes:
        assert f"{node} (9 problems)" in text
        assert f"[{node}](details.md#{node})" in text
        assert f"\n## {node}\n" in (tmp_path / "details.md").read_text(encoding="utf-8")


def test_pairs_that_could_not_be_run_are_not_counted(tmp_path: Path) -> None:
    refused = [row(f"p-{k}", "flat", "unsupported", message="takes 2 dimensions") for k in range(7)]
    text = report(table(row("p-0", "s", "solved", 1.0), row("p-9", "flat", "solved", 2.0), *refused), tmp_path)
    assert "\n**2 of 2 pairs solved** (8 problems" in text
    assert "\n7 more pairs could not be run, and are not counted." in text
    assert "| `flat` | 1/1 ×1 |" in text, "one that it could run"


def test_problems_that_have_not_begun_are_no_failures(tmp_path: Path) -> None:
    """Of two problems, one has a pair that ran and one that waits, the other waits with both."""
    statuses = ("solved", "not_run", "not_run", "not_run")
    rows = pd.DataFrame({"problem": ["p", "p", "q", "q"], "label": ["s", "t"] * 2, "node": "lcp", "solve": 1.0})
    rows = rows.assign(key=list("abcd"), status=statuses, tolerance=1e-6, threads=1)
    run = assembled(RunTable.of(rows, {}), tmp_path)
    assert set(run.rows["problem"]) == {"p"}
    assert run.incomplete == "Incomplete: 3 of 4 pairs not run yet."
    text = documents.write(run, "half a run")[0].read_text("utf-8")
    assert text.splitlines()[2] == "**Incomplete: 3 of 4 pairs not run yet.**"
    whole = assembled(RunTable.of(rows[:1], {}), tmp_path)
    assert whole.incomplete == ""
    none = assembled(RunTable.of(rows[2:], {}), tmp_path)
    assert (len(none.rows), none.incomplete) == (2, "Incomplete: 2 of 2 pairs not run yet.")


def section(rows: pd.DataFrame, folder: Path) -> str:
    """The table of times and what is said below it, '' where the report has none."""
    write_report(rows, meta(), folder, "t")
    text = (folder / "details.md").read_text(encoding="utf-8")
    return text.partition("\n### Times\n")[2].partition("\n### ")[0]


def cells(text: str) -> dict[str, dict[str, str]]:
    """Cells of each row of the table, by its first and the heading."""
    head, _, *rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    return {row[0].strip("`"): dict(zip(head[1:], row[1:], strict=True)) for row in rows}


def test_means_stand_with_their_intervals(tmp_path: Path) -> None:
    text = section(suite(), tmp_path)
    group = participating(rows_of.normalised(suite()))
    times = rows_of.times(group)
    leading = profiles.performance_profile(times).leading(figures.EMPHASISED)
    every, common = means.means(times, limit=10.0), means.means(times, limit=10.0, common=leading)
    around = bootstrap.mean_time(times, every.shift, 10.0, families=bootstrap.families_of(group))
    shown = cells(text)
    assert set(shown) == set(times.columns)
    for label, found in shown.items():
        low, high = (float(around.at[label, end]) for end in ("low", "high"))
        assert found["mean over all 45"] == seconds(float(every.mean[label]))
        assert found["95 % interval"] == f"{seconds(low)} to {seconds(high)}"
        assert (found[f"mean over {common.problems} in common"] == "—") == (label not in leading)
    assert f"shift {seconds(every.shift)} (median of all times); a problem not solved is charged 10 s." in text


def test_little_to_resample_or_to_charge_is_reported(tmp_path: Path) -> None:
    rows = table(*(row(f"f-{i}", s, "solved" if i % 3 else "timeout", 1.0 + i) for i in range(6) for s in ("a", "b")))
    assert "interval" not in section(rows, tmp_path), "of one family it would say nothing"
    boundless = section(rows.assign(seconds=math.inf), tmp_path)
    assert "a problem not solved leaves none (no limit was set)" in boundless
    assert cells(boundless)["a"]["mean over all 6"] == "—"
    assert section(table(*(row(f"f-{i}", s, "timeout") for i in range(3) for s in ("a", "b"))), tmp_path) == ""


def test_solvers_that_solve_something_stand_with_their_distance_to_the_best(tmp_path: Path) -> None:
    rows = table(
        *(row(f"p-{i}", "a", "solved", t) for i, t in enumerate((1e-5, 1.0, 1.0))),
        *(row(f"p-{i}", "b", "solved", t) for i, t in enumerate((2e-5, 4.0, 1.0))),
        row("p-3", "a", "crash"),
        row("p-3", "b", "solved", 2.0),
        *(row(f"p-{i}", "idle", "timeout") for i in range(4)),
    )
    found = cells(section(rows, tmp_path))
    assert set(found) == {"a", "b"}
    assert (found["a"]["within 2 times"], found["a"]["best without it"]) == ("75%", f"{4 ** (1 / 4):.3g}")
    assert (found["b"]["within 2 times"], found["b"]["best without it"]) == ("75%", "1")
