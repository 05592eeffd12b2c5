"""Figures: what they say, that they are the same bytes twice, and that no label breaks them."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure
from synthetic_results import line_styles_of, results_file, suite
from tiers import some_by_day

from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import Profile, performance_profile
from cpbench.analysis.run_table import RunTable
from cpbench.bench.results.store import Store
from cpbench.cli.plot_command import command as plot
from cpbench.cli.types import LENGTH
from cpbench.errors import CpbenchError
from cpbench.report import canvas, figures
from cpbench.report.chosen import Choice
from cpbench.report.figure_kinds import Drawing, find
from cpbench.report.run import assembled
from cpbench.report.text import seconds

INF = math.inf


def profile_of(problems: int, labels: int) -> tuple[Profile, dict[str, str]]:
    rows = rows_of.normalised(suite(problems, labels))
    return performance_profile(rows_of.times(rows)), rows_of.label_kinds(rows)


def line_styles(profile: Profile) -> dict[str, int]:
    return line_styles_of(curve.label for curve in profile.curves)


def texts(figure) -> list[str]:
    import matplotlib.text

    return [t.get_text() for t in figure.findobj(matplotlib.text.Text) if t.get_text()]


def drawn(profile: Profile, kinds: Mapping[str, str]) -> Figure:
    figure, axes = figures.with_room(len(profile.curves))
    figures.profile_axes(axes, profile, kinds, line_styles(profile))
    return figure


def test_the_figure_says_what_it_shows() -> None:
    profile, kinds = profile_of(45, 20)
    said = " ".join(" ".join(texts(drawn(profile, kinds))).split())
    for curve in profile.curves:
        assert curve.label in said
    assert "solved none: highs" in said
    assert "lemke@inner8 ≈" in said


def test_axes_and_curves() -> None:
    """Every curve is drawn from τ = 1 to the right end, as steps that hold their value to the right."""
    profile, kinds = profile_of(45, 22)
    axes = drawn(profile, kinds).axes[0]
    assert axes.get_xscale() == "log"
    assert axes.get_ylim() == (0.0, 1.0)
    assert axes.get_xlim()[0] == 1.0
    assert axes.get_xlim()[1] > profile.widest
    lines = axes.get_lines()
    assert len(lines) == sum(1 for c in profile.curves if c.solved)
    ends = sorted(float(line.get_ydata()[-1]) for line in lines)
    assert ends == sorted(c.at(INF) for c in profile.curves if c.solved)
    for line in lines:
        assert line.get_drawstyle() == "steps-post"
        assert line.get_xdata()[0] == 1.0
        assert line.get_xdata()[-1] == axes.get_xlim()[1]


def test_colours_markers_and_dashes_tell_curves_apart() -> None:
    profile, kinds = profile_of(45, 22)
    lines = drawn(profile, kinds).axes[0].get_lines()
    coloured = [line for line in lines if line.get_color() != figures.GREY]
    assert len(coloured) == figures.EMPHASISED
    assert len({(line.get_color(), line.get_marker()) for line in coloured}) == len(coloured)
    inexact = sum(1 for c in profile.curves if c.solved and kinds[c.label] == "approximate")
    assert inexact > 0
    assert sum(1 for line in lines if line.get_linestyle() != "-") == inexact


def test_a_curve_of_many_steps_is_drawn_with_as_many_as_can_be_seen() -> None:
    rng = np.random.default_rng(0)
    times = pd.DataFrame(np.exp(rng.normal(0, 2, (20_000, 2))), columns=["a", "b"])
    profile = performance_profile(times)
    shown_lines: Any = drawn(profile, {}).axes[0].get_lines()
    assert [len(line.get_xdata()) for line in shown_lines] == [figures.POINTS] * 2
    for curve in profile.curves:
        upto = figures.right_end(profile)
        tau, height = curve.outline(upto, figures.POINTS)
        every, true = curve.steps(upto)
        shown = height[np.searchsorted(tau, every, side="right") - 1]
        assert (shown <= true).all()
        assert (true - shown).max() <= 1 / figures.POINTS


@pytest.mark.parametrize(
    "times",
    some_by_day(
        [
            pd.DataFrame({"a": [INF, INF]}),
            pd.DataFrame({"a": [1.0]}),
            pd.DataFrame({"a": [1.0], "b": [1e9]}),
            pd.DataFrame({"<b>&": [1.0], "$x$": [2.0], "_hidden": [3.0], "漢": [4.0], "x" * 200: [5.0], "a\nb": [6.0]}),
            pd.DataFrame({f"solver {i}": [float(i + 1)] for i in range(60)}),
            pd.DataFrame(),
        ],
        2,
    ),
    ids=["none solved", "one", "far apart", "labels", "sixty", "nothing"],
)
def test_any_table_can_be_drawn(times: pd.DataFrame, tmp_path: Path) -> None:
    profile = performance_profile(times)
    with canvas.drawing(formulas=False):
        canvas.write(Drawing(drawn(profile, {}), "", ""), tmp_path / "f.png", bare=True)
    assert (tmp_path / "f.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.nightly
def test_no_date_no_version_no_pyplot(tmp_path: Path) -> None:
    profile, kinds = profile_of(5, 4)
    files = [tmp_path / name for name in ("one.png", "two.png", "one.svg", "two.svg")]
    for path in files:
        canvas.write(Drawing(drawn(profile, kinds), "title", "guide"), path)
    one, two, drawing, again = (path.read_bytes() for path in files)
    assert (one, drawing) == (two, again)
    assert b"dc:date" not in drawing
    assert b"Software" not in one
    assert "matplotlib.pyplot" not in sys.modules, "pyplot keeps global state and may look for a display"


@pytest.mark.parametrize("ends", [(1.7e-3, 1.02e-2), (1e-3, 2.9e-3), (1e-3, 7.9e-3), (4e-3, 3.1e-2), (1e-6, 9.9e-5)])
def test_labels_of_a_logarithmic_axis_do_not_touch(ends: tuple[float, float]) -> None:
    made, axes = figures.with_room(1)
    axes.plot(ends, (1.0, 1e-6))
    figures.log_axis(axes, "x", seconds)
    made.draw_without_rendering()
    low, high = axes.get_xlim()
    boxes = [t.label1.get_window_extent() for t in axes.xaxis.get_major_ticks() if low <= t.get_loc() <= high]
    assert len(boxes) >= 2
    assert all(left.x1 + 2 < right.x0 for left, right in pairwise(boxes))


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_file(tmp_path_factory.mktemp("results") / "r.sqlite", suite(12, 9))


def test_a_figure_for_a_column_gives_the_plot_the_room(results: Path, tmp_path: Path) -> None:
    """The axes take 65 % of the area without the title, their labels nine tenths; no word is outside; the explanation
    is printed for the caption; the title says tolerance and start."""
    path = tmp_path / "c.svg"
    done = CliRunner().invoke(plot, ["profile", str(results), "-o", str(path), "--width", "89mm"])
    assert done.exit_code == 0, done.output
    assert "\ncaption: The height of a curve at τ is the fraction" in done.output
    with Store(results) as store:
        run = assembled(RunTable.of(store.table(), store.meta()), tmp_path)
    with canvas.drawing(formulas=False):
        made = find("cpbench.report.plots", "profile").draw(run, Choice())
        canvas.resize(made.figure, 89 / 25.4, math.nan)
        made.figure.draw_without_rendering()
        (axes,) = made.figure.axes
        box, labels = axes.get_position(), axes.get_tightbbox()
    assert box.width * box.height >= 0.65
    width, height = made.figure.get_size_inches() * made.figure.dpi
    assert labels.width * labels.height >= 0.9 * width * height
    assert 0 <= labels.x0 < labels.x1 <= width
    assert axes.get_legend() is not None
    assert made.short == "lcp: 12 problems, tolerance 1e-06, start cold"


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("options", [("--width", "5in"), ("--height", "5.4in")])
def test_a_figure_of_a_problem_keeps_its_shape(tmp_path: Path, options: tuple[str, ...]) -> None:
    """The figure of contacts is 3.5 by 3.45 inches."""
    path, problem = tmp_path / "contact.svg", "builtin/fc/contact-planted-3d.h5::full-rank-30"
    done = CliRunner().invoke(plot, ["contact", problem, "-o", str(path), "--bare", *options], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    root = ElementTree.parse(path).getroot()
    width, height = (float(root.attrib[name].removesuffix("pt")) / 72 for name in ("width", "height"))
    assert width / height == pytest.approx(3.5 / 3.45)
    assert (width if "--width" in options else height) == pytest.approx(float(options[1].removesuffix("in")))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("profile", "--width", "1.2in"), "at least 1.3 in are needed here"),
        (("profile", "--height", "0.5in"), "at least 1.3 in are needed here"),
        (("profile", "--width", "5in", "--height", "1.5in"), "at least 1.9 in are needed here"),
    ],
)
def test_impossible_options_are_refused(results: Path, tmp_path: Path, options: tuple[str, ...], said: str) -> None:
    kind, *more = options
    path = tmp_path / "f.svg"
    with pytest.raises(CpbenchError, match=said):
        CliRunner().invoke(plot, [kind, str(results), "-o", str(path), *more], catch_exceptions=False)
    assert not path.exists()


@pytest.mark.parametrize("text", ["3", "in", "-2in", "0mm", "nanin", "3ft"])
def test_a_length_has_a_unit(text: str) -> None:
    with pytest.raises(Exception, match="is not a length"):
        LENGTH.convert(text, None, None)
