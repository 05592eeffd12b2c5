"""The size of a figure, as the command line asks for it."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner
from synthetic_results import results_file, suite

from cpbench.analysis.run_table import RunTable
from cpbench.bench.results.store import Store
from cpbench.cli.plot_command import command as plot
from cpbench.cli.types import LENGTH
from cpbench.errors import CpbenchError
from cpbench.report import canvas
from cpbench.report.chosen import Choice
from cpbench.report.figure_kinds import find
from cpbench.report.run import assembled


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
    """The contact's own figure is 3.5 by 2.7 inches."""
    path = tmp_path / "cone.svg"
    done = CliRunner().invoke(plot, ["cone", "-o", str(path), "--bare", *options], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    root = ElementTree.parse(path).getroot()
    width, height = (float(root.attrib[name].removesuffix("pt")) / 72 for name in ("width", "height"))
    assert width / height == pytest.approx(3.5 / 2.7)
    assert (width if "--width" in options else height) == pytest.approx(float(options[1].removesuffix("in")))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("profile", "--width", "1.2in"), "at least 1.3 in are needed here"),
        (("profile", "--height", "0.5in"), "at least 1.3 in are needed here"),
        (("profile", "--width", "5in", "--height", "1.5in"), "at least 1.9 in are needed here"),
        (("scaling", "--width", "1.4in"), "leaves no room"),
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
