"""Runs in order of time: counts, ratios over what was solved twice, machines that are not chained."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import synthetic_results as synthetic
from tiers import by_night

from cpbench.advice import timeline_tables
from cpbench.advice.timeline import COLUMNS, TimelineRun, moved, timeline
from cpbench.advice.timeline_figure import timeline_figure
from cpbench.cli import main

HERE = {"cpu": "a processor", "cores": 2, "ram_gib": 8.0}
THERE = {"cpu": "another", "cores": 2, "ram_gib": 8.0}


def run(
    name: str, table: pd.DataFrame, day: int, machine: dict[str, object] | None = None, reference: float = 1e-3
) -> TimelineRun:
    table = table.assign(finished=f"2026-01-{day:02d}T12:00:00")
    return TimelineRun(name, table, "0.1.0", machine=HERE if machine is None else machine, references=[reference] * 3)


def point(points: pd.DataFrame, label: str, file: str) -> dict[str, object]:
    rows = points[(points["label"] == label) & (points["file"] == file)]
    assert len(rows) == 1
    return rows.iloc[0].to_dict()


def test_the_ratio_is_the_geometric_mean_over_what_was_solved_twice() -> None:
    """Against a loop over pairs, with statuses that change from run to run."""
    first, rng = synthetic.suite(problems=20, labels=6, seed=2), np.random.default_rng(0)
    later = first.assign(solve=first["solve"] * rng.uniform(0.5, 2.0, len(first)))
    later["status"] = later["status"].mask(rng.uniform(size=len(first)) < 0.2, "timeout")
    points = timeline([run("b", later, 9), run("a", first, 3)])
    for label in sorted(set(first["label"])):
        logs = []
        for (_, x), (_, y) in zip(first.iterrows(), later.iterrows(), strict=True):
            if x["label"] == label and x["status"] == "solved" and y["status"] == "solved":
                logs.append(math.log(max(y["solve"], 1e-4) / max(x["solve"], 1e-4)))
        found = point(points, label, "b")
        assert found["base"] == "a"
        assert found["common"] == len(logs)
        assert found["ratio"] == pytest.approx(math.exp(sum(logs) / len(logs)), rel=1e-12)
        assert found["solved"] == ((later["label"] == label) & (later["status"] == "solved")).sum()
        assert point(points, label, "a")["ratio"] == 1.0


def test_another_machine_begins_anew() -> None:
    table = synthetic.suite(problems=8, labels=2)
    slow = table.assign(solve=3 * table["solve"])
    runs = [
        run("1", table, 1),
        run("2", slow, 2, THERE, 3e-3),
        run("3", slow, 3, reference=2e-3),
        run("4", table, 4, THERE),
    ]
    points = timeline(runs)
    label = str(table["label"].iloc[0])
    assert [point(points, label, name)["base"] for name in "1234"] == ["1", "2", "1", "2"]
    ratios = [point(points, label, name)["ratio"] for name in "1234"]
    assert ratios[:3] == pytest.approx([1.0, 1.0, 3.0], rel=0.2)  # the shortest times are floored
    assert [point(points, label, name)["reference"] for name in "1234"] == pytest.approx([1.0, 1.0, 2.0, 1 / 3])


def test_machines_of_which_nothing_is_known_are_never_one() -> None:
    table = synthetic.suite(problems=4, labels=1)
    points = timeline([run("1", table, 1, {}), run("2", table, 2, {})])
    assert points["base"].tolist() == ["1", "2"]
    assert points["reference"].isna().all()


def test_lanes_and_hosts_are_part_of_the_machine() -> None:
    table = synthetic.suite(problems=4, labels=1)
    runs = [run("1", table.assign(jobs=1.0), 1), run("2", table.assign(jobs=4.0), 2)]
    points = timeline(runs)
    assert points["machine"].tolist() == ["a processor, 2 cores, 8 GiB", "a processor, 2 cores, 8 GiB, 4 at a time"]
    assert points["base"].tolist() == ["1", "2"]


def test_who_solves_nothing_has_no_ratio_and_liars_no_time() -> None:
    table = synthetic.table(synthetic.row("a", "s", "wrong", 1e-3), synthetic.row("b", "s", "crash"))
    points = timeline([run("1", table, 1), run("2", table, 2)])
    assert points[["solved", "wrong", "crash", "common"]].values.tolist() == [[0, 1, 1, 0]] * 2
    assert points["ratio"].isna().all()


def test_rows_that_were_not_run_do_not_count() -> None:
    table = synthetic.table(synthetic.row("a", "s", "solved", 1.0), synthetic.row("b", "s", "not_run"))
    assert timeline([run("1", table, 1)])["pairs"].tolist() == [1]


def test_labels_that_moved_most_come_first() -> None:
    table = synthetic.table(*(synthetic.row("a", label, "solved", 1.0) for label in ("same", "slower", "lost")))
    later = table.assign(solve=[1.0, 5.0, 1.0], status=["solved", "solved", "timeout"])
    assert moved(timeline([run("1", table, 1), run("2", later, 2)])) == ["lost", "slower", "same"]


def test_the_tables_have_every_point() -> None:
    table = synthetic.suite(problems=5, labels=3)
    points = timeline([run("a|b.sqlite", table, 1), run("c.sqlite", table, 2, THERE)])
    assert len(points) == 6
    lines = timeline_tables.columns(points)
    assert sum("c.sqlite" in line for line in lines) == 3
    text = timeline_tables.markdown(points, "T")
    assert text.count("a\\|b.sqlite") == 3
    told = json.loads(timeline_tables.as_json(points))
    assert len(told) == 6
    assert list(told[0]) == list(COLUMNS)
    assert timeline_tables.as_csv(points).count("\n") == 7


@pytest.mark.parametrize("labels", [1, 5, *by_night([30])])
def test_the_figure_is_drawn_for_any_number_of_labels(labels: int) -> None:
    rows = [synthetic.row(p, f"solver-{k}", "solved", 0.01 * (k + 1)) for p in "ab" for k in range(labels)]
    table = synthetic.table(*rows)
    runs = [run("1", table, 1), run("2", table.assign(version="2"), 2), run("3", table, 3, THERE)]
    figure = timeline_figure(timeline(runs), "3 runs")
    figure.canvas.draw()
    shown = [axes for axes in figure.axes if axes.axison]
    assert len(shown) == 2 * min(labels, 24)


# ----------------------------------------------------------------------------------------- command line


@pytest.fixture
def history(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str, str]]:
    """`cpbench history` in this process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["cpbench", "history", *words])
        code = 0
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
        return code, *capsys.readouterr()

    return call


@pytest.mark.nightly
def test_the_command_shows_and_writes(tmp_path: Path, history: Callable[..., tuple[int, str, str]]) -> None:
    table = synthetic.suite(problems=4, labels=3)
    (tmp_path / "old").mkdir()
    synthetic.results_file(tmp_path / "old" / "r.sqlite", table, references=(1e-3,))
    synthetic.results_file(tmp_path / "r.sqlite", table.assign(finished="2026-02-01T00:00:00"), references=(2e-3,))
    code, out, err = history("old/r.sqlite", "r.sqlite", "r.sqlite")
    assert (code, err) == (0, "")
    assert out.count("old/r.sqlite") == 3
    assert out.count("× 2.00") == 3
    label = str(table["label"].iloc[0])
    assert history("r.sqlite", "--label", label)[1].count("r.sqlite") == 1
    outputs = [word for end in ("md", "csv", "json", "svg", "png") for word in ("-o", f"h.{end}")]
    assert history("old/r.sqlite", "r.sqlite", *outputs)[0] == 0
    assert all((tmp_path / f"h.{end}").stat().st_size > 100 for end in ("md", "csv", "json", "svg", "png"))
    before = (tmp_path / "h.svg").read_bytes()
    assert history("r.sqlite", "old/r.sqlite", "-o", "h.svg")[0] == 0
    assert (tmp_path / "h.svg").read_bytes() == before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "Missing argument"),
        (("none.sqlite",), "no such results file"),
        (("empty.sqlite",), "empty.sqlite: "),
        (("text.sqlite",), "not a results file"),
        (("run.sqlite", "-o", "h.pdf"), "unknown suffix"),
        (("run.sqlite", "-o", "none/h.md"), "there is no folder"),
        (("run.sqlite", "--label", "lemk"), "unknown label 'lemk'"),
    ],
)
def test_bad_input_is_one_line(
    tmp_path: Path, history: Callable[..., tuple[int, str, str]], words: tuple[str, ...], message: str
) -> None:
    synthetic.results_file(tmp_path / "run.sqlite", synthetic.table(synthetic.row("a", "s", "failed", 0.1)))
    (tmp_path / "empty.sqlite").touch()
    (tmp_path / "text.sqlite").write_text("hello\n" * 100)
    code, _, err = history(*words)
    assert (code, err.count("\n")) == (2, 1), err
    assert message in err


def test_files_in_which_nothing_was_run_are_told(tmp_path: Path, history: Callable[..., tuple[int, str, str]]) -> None:
    idle = synthetic.table(synthetic.row("a", "s", "not_run"))
    synthetic.results_file(tmp_path / "idle.sqlite", idle)
    synthetic.results_file(tmp_path / "run.sqlite", synthetic.table(synthetic.row("a", "s", "failed", 0.1)))
    code, out, err = history("idle.sqlite", "run.sqlite")
    assert code == 0
    assert "idle.sqlite: no pair was run; left out" in err
    assert "run.sqlite" in out
    code, _, err = history("idle.sqlite")
    assert code == 2
    assert "none of the files has a row that was run" in err
