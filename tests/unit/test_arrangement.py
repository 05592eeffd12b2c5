"""The size of a figure of a run and the place of its legend, as the command line asks for them."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner
from synthetic_results import results_file, suite

from cpbench.cli.graph_command import command as graph
from cpbench.cli.plot_command import command as plot
from cpbench.cli.types import LENGTH
from cpbench.errors import CpbenchError


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_file(tmp_path_factory.mktemp("results") / "r.sqlite", suite(12, 9))


def drawn(results: Path, folder: Path, *options: str) -> tuple[float, float, str]:
    """Width and height [in] of a profile, and its words."""
    path = folder / "f.svg"
    found = CliRunner().invoke(plot, ["profile", str(results), "-o", str(path), *options], catch_exceptions=False)
    assert found.exit_code == 0, found.output
    root = ElementTree.parse(path).getroot()
    width, height = (float(root.attrib[name].removesuffix("pt")) / 72 for name in ("width", "height"))
    return width, height, path.read_text()


def test_a_figure_is_as_wide_and_as_high_as_asked(results: Path, tmp_path: Path) -> None:
    assert drawn(results, tmp_path, "--bare")[0] == pytest.approx(7.0)
    asked = ("--bare", "--width", "89mm", "--height", "2.2in", "--legend", "none")
    assert drawn(results, tmp_path, *asked)[:2] == pytest.approx((89 / 25.4, 2.2))


@pytest.mark.nightly
def test_a_legend_stands_where_it_is_environment(results: Path, tmp_path: Path) -> None:
    beside, below, none = (
        drawn(results, tmp_path, "--bare", "--width", "5in", "--legend", place) for place in ("beside", "below", "none")
    )
    assert below[1] > beside[1] == pytest.approx(none[1])
    assert "sorted by problems solved" in beside[2]
    assert "sorted by problems solved" in below[2]
    assert "sorted by problems solved" not in none[2]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("profile", "--width", "2in"), "--legend below or none needs less"),
        (("profile", "--height", "0.5in"), "at least"),
        (("scaling", "--legend", "none"), "this figure has no legend"),
    ],
)
def test_what_cannot_be_is_said(results: Path, tmp_path: Path, options: tuple[str, ...], said: str) -> None:
    kind, *more = options
    path = tmp_path / "f.svg"
    with pytest.raises(CpbenchError, match=said):
        CliRunner().invoke(plot, [kind, str(results), "-o", str(path), *more], catch_exceptions=False)
    assert not path.exists()


@pytest.mark.parametrize("text", ["3", "in", "-2in", "0mm", "nanin", "3ft"])
def test_a_length_has_a_unit(text: str) -> None:
    with pytest.raises(Exception, match="is no length"):
        LENGTH.convert(text, None, None)


def test_the_graph_is_drawn_to_a_file(tmp_path: Path) -> None:
    path = tmp_path / "graph.svg"
    found = CliRunner().invoke(graph, ["-o", str(path)], catch_exceptions=False)
    assert found.output == f"graph: {path}\n"
    assert "formulations and" in path.read_text()
    assert CliRunner().invoke(graph, ["-o", str(path), "--format", "dot"]).exit_code == 2
