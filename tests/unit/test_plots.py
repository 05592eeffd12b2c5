"""Figures of runs: what is drawn are the numbers of the analysis, and what cannot be drawn says why."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from synthetic_results import meta, results_file, row, suite, table
from tiers import some_by_day

from cpbench.analysis import profiles
from cpbench.analysis import table as rows_of
from cpbench.analysis.run_table import RunTable
from cpbench.cli import cli
from cpbench.errors import CpbenchError, UnknownName
from cpbench.report import canvas, figures
from cpbench.report.chosen import Choice, choose
from cpbench.report.figure_kinds import Drawing, find
from cpbench.report.run import Run, assembled

ROOM = "cpbench.report.plots"
SUITE = suite(20, 12)


def run_of(rows: pd.DataFrame, iterates: pd.DataFrame | None = None) -> Run:
    return assembled(RunTable.of(rows, meta()), Path(), iterates)


ALL = Choice()


def draw(kind: str, run: Run, choice: Choice = ALL, **options: Any) -> Drawing:
    with canvas.drawing(formulas=False):
        return find(ROOM, kind).draw(run, choice, **options)


def lines(drawn: Drawing, axes: int = 0) -> list[Any]:
    return list(drawn.figure.axes[axes].lines)


def of_colour(drawn: Drawing, style: int, axes: int = 0) -> Any:
    """The data of the curve with a style."""
    form = figures.line_style(style)
    (found,) = [
        line for line in lines(drawn, axes) if (line.get_color(), line.get_marker()) == (form["color"], form["marker"])
    ]
    return np.asarray(found.get_xdata(), dtype=float), np.asarray(found.get_ydata(), dtype=float)


def test_profile_draws_the_curves_of_the_analysis() -> None:
    drawn = draw("profile", run_of(SUITE))
    times = rows_of.times(rows_of.normalised(SUITE))
    profile = profiles.performance_profile(times)
    upto = figures.right_end(profile)
    curves = {curve.label: curve for curve in profile.curves}
    for label in profile.leading(3):
        tau, height = curves[label].steps(upto)
        assert np.array_equal(of_colour(drawn, run_of(SUITE).line_styles[label]), (tau, height))


def test_hidden_solvers_do_not_count_for_the_ratios_but_n_stays() -> None:
    times = rows_of.times(rows_of.normalised(SUITE))
    best = profiles.performance_profile(times).leading(1)[0]
    others = [label for label in times.columns if not label.startswith(best.partition("@")[0])]
    drawn = draw("profile", run_of(SUITE), Choice(solvers=tuple(others)))
    apart = profiles.performance_profile(times[others], 20)
    upto = figures.right_end(apart)
    first = {c.label: c for c in apart.curves}[apart.leading(1)[0]]
    assert np.array_equal(of_colour(drawn, run_of(SUITE).line_styles[first.label]), first.steps(upto))
    assert "N = 20 problems of lcp" in drawn.guide


def test_a_solver_has_one_look_in_all_figures_whatever_is_shown() -> None:
    """The curve of a solver that is not the first of all is drawn alike beside all others, beside one, and alone."""
    run = run_of(SUITE)
    label = profiles.performance_profile(rows_of.times(rows_of.normalised(SUITE))).leading(3)[2]
    other = next(name for name in run.line_styles if name != label)
    for chosen in ((), (label, other), (label,)):
        of_colour(draw("profile", run, Choice(solvers=chosen)), run.line_styles[label])
    assert len(set(run.line_styles.values())) == len(run.line_styles)
    leading = profiles.performance_profile(rows_of.times(rows_of.normalised(SUITE))).leading(figures.EMPHASISED)
    assert len({figures.colour(run.line_styles[name]) for name in leading}) == len(leading)


def recorded() -> tuple[pd.DataFrame, pd.DataFrame]:
    rows = table(*(row(p, s, "solved", 1.0) for p in ("p-1", "p-2") for s in ("fast", "slow")))
    parts = []
    for key, pace in zip(rows["key"], (0.1, 0.5, 0.1, 0.5), strict=True):
        told = {"iteration": range(4), "residual": 1e-3, "error": [1e-1, 1e-3, 1e-5, 1e-7]}
        parts.append(
            pd.DataFrame({"key": key, "time": [pace * k for k in range(4)], "share": np.arange(4) * pace, **told})
        )
    return rows, pd.concat(parts, ignore_index=True)


def test_convergence_is_of_one_problem_and_draws_its_iterates() -> None:
    rows, iterates = recorded()
    run = run_of(rows, iterates)
    with pytest.raises(CpbenchError, match=r"2 problems: name one with --name: p-1, p-2"):
        draw("convergence", run)
    drawn = draw("convergence", run, name="p-2")
    assert of_colour(drawn, 0)[1].tolist() == [1e-1, 1e-3, 1e-5, 1e-7]
    assert of_colour(drawn, 0)[0].tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert draw("convergence", run, name="*-2").title == drawn.title
    with pytest.raises(CpbenchError, match=r"p-\* names 2 problems: name one with --name: p-1, p-2"):
        draw("convergence", run, name="p-*")
    with pytest.raises(UnknownName, match="q-"):
        draw("convergence", run, name="q-*")


def test_without_iterates_the_option_that_records_them_is_named() -> None:
    with pytest.raises(CpbenchError, match="run with --history"):
        draw("convergence", run_of(SUITE))


def test_several_formulations_are_not_thrown_together() -> None:
    rows = pd.concat([SUITE, SUITE.assign(node="mlcp", key=SUITE["key"] + "m")])
    with pytest.raises(CpbenchError, match=r"2 formulations: choose one with --node: lcp \(20 problems\), mlcp"):
        choose(run_of(rows), Choice())
    assert choose(run_of(rows), Choice(node="mlcp")).node == "mlcp"


def test_a_tolerance_that_was_not_run_is_refused() -> None:
    with pytest.raises(CpbenchError, match=r"--tolerance 0\.0001: nothing was run at it; there are 1e-06"):
        choose(run_of(table(row("a", "s", "solved", 1.0))), Choice(tolerance=1e-4))


@pytest.mark.parametrize(
    ("arguments", "message"),
    some_by_day(
        [
            (["profile", "FILE", "-o", "x.bmp"], "unknown suffix '.bmp'"),
            (["profile", "FILE", "-o", "x.svg", "-p", "metric=timee"], "unknown metric 'timee': did you mean time"),
            (["profile", "FILE", "-o", "x.svg", "--solver", "nobody"], "unknown solver of the results 'nobody'"),
            (["profile", "FILE", "-o", "x.svg", "--node", "fc"], "unknown formulation 'fc'"),
            (["profile", "FILE", "-o", "x.svg", "--family", "x*"], "unknown family 'x\\*'"),
            (["profile", "none.sqlite", "-o", "x.svg"], "none.sqlite"),
            (["profil", "FILE", "-o", "x.svg"], "unknown figure 'profil': did you mean profile"),
        ],
        5,
    ),
)
def test_bad_input_is_refused_in_one_line(tmp_path: Path, arguments: list[str], message: str) -> None:
    file = results_file(tmp_path / "r.sqlite", SUITE)
    given = [str(file) if argument == "FILE" else argument for argument in arguments]
    done = CliRunner().invoke(cli, ["plot", *given])
    assert isinstance(done.exception, CpbenchError)
    assert re.search(message, str(done.exception))


def test_an_empty_results_file_says_how_to_fill_it(tmp_path: Path) -> None:
    file = results_file(tmp_path / "r.sqlite", table())
    done = CliRunner().invoke(cli, ["plot", "profile", str(file), "-o", str(tmp_path / "x.svg")])
    assert "have no rows" in str(done.exception)
