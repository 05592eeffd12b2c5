"""`cpbench sweep` and `cpbench plot sweep`: values of a parameter of a problem, and of an option of a solver."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from command_line import cpbench as command
from synthetic_results import meta, results_file, row, suite, table

import cpbench
from cpbench.analysis import table as rows_of
from cpbench.analysis.run_table import RunTable
from cpbench.cli import cli
from cpbench.cli.plot_command import OF_RUNS, packages
from cpbench.errors import CpbenchError, ProblemError, UnknownName
from cpbench.formulations import LCP, NCP, FrictionContact
from cpbench.report import legend, run_canvas
from cpbench.report.chosen import Choice
from cpbench.report.figure_kinds import Drawing, find
from cpbench.report.run import assembled
from cpbench_lab.run_figures import sweep as options
from cpbench_lab.sweeping import over, sweep, with_value

PUSHED = FrictionContact(W=np.eye(2), q=[-1.0, 0.45], mu=[0.2], dimension=2, name="pushed")
"""u = r + q: sticks from μ = 0.45 on, and slips with 0.45 − μ below."""


@pytest.mark.needs("cpbench_solvers")
def test_a_push_is_held_from_the_coefficient_on_that_holds_it(tmp_path: Path) -> None:
    cpbench.save(PUSHED, tmp_path / "pushed.h5")
    done = command(tmp_path, "sweep", "pushed.h5", "--over", "mu=0.1:0.8:0.1", "--json")
    rows = json.loads(done.stdout)
    assert [row["mu"] for row in rows] == ["0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7", "0.8"]
    assert [int(row["stick"]) for row in rows] == [0, 0, 0, 0, 1, 1, 1, 1]
    speeds = [float(row["largest sliding speed"]) for row in rows]
    np.testing.assert_allclose(speeds[:4], [0.35, 0.25, 0.15, 0.05], atol=1e-5)
    shown = command(tmp_path, "sweep", "pushed.h5", "--over", "mu=0.1|0.8").stdout.splitlines()
    assert len(shown) == 3
    assert shown[0].split()[:3] == ["mu", "status", "error"]


@pytest.mark.needs("cpbench_solvers")
def test_a_parameter_of_expressions_is_swept() -> None:
    """z ≥ 0 ⟂ z² − a ≥ 0 with z > 0: z = √a."""
    z, a = ca.SX.sym("z"), ca.SX.sym("a")
    problem = NCP.from_casadi(z, z**2 - a, {"a": 1.0}, start=[1.0])
    answers = list(sweep(problem, "a", [1.0, 4.0, 9.0], tolerance=1e-9))
    assert [answer.value for answer in answers] == [1.0, 4.0, 9.0]
    np.testing.assert_allclose([answer.solution.x[0] for answer in answers], [1.0, 2.0, 3.0], atol=1e-6)


@pytest.mark.parametrize("text", ["mu", "mu=", "=1", "mu=a", "mu=1:2", "mu=inf"])
def test_what_is_no_range_is_refused(text: str) -> None:
    with pytest.raises(CpbenchError):
        over(text)


def test_what_a_problem_has_not_is_refused() -> None:
    with pytest.raises(UnknownName, match="mu"):
        with_value(PUSHED, "mo", 1.0)
    with pytest.raises(ProblemError, match="no parameter mu"):
        with_value(LCP(M=[[1.0]], q=[1.0]), "mu", 1.0)


def draw(rows: pd.DataFrame) -> Drawing:
    with run_canvas.drawing():
        run = assembled(RunTable.of(rows, meta()), Path())
        return find("cpbench_lab.run_figures", "sweep").draw(run, Choice())


def curve(drawn: Drawing, axes: int) -> Any:
    """The data of the first curve of a panel."""
    look = legend.look(0)
    (found,) = [line for line in drawn.figure.axes[axes].lines if line.get_color() == look["color"]]
    return np.asarray(found.get_xdata(), dtype=float), np.asarray(found.get_ydata(), dtype=float)


def swept() -> pd.DataFrame:
    rows = []
    for omega, solved in ((0.5, 1), (1.0, 3), (1.5, 2)):
        for k in range(3):
            status = "solved" if k < solved else "timeout"
            label = f"nsgs[omega={omega}]"
            rows.append(row(f"p-{k}", label, status, omega, options=json.dumps({"omega": omega}), solver="nsgs"))
    return table(*rows)


def test_sweep_draws_the_share_and_the_mean_over_the_values() -> None:
    drawn = draw(swept())
    option, found = options.swept(rows_of.normalised(swept()))
    assert option == "omega"
    assert np.array_equal(curve(drawn, 0), (found["value"], [1 / 3, 1.0, 2 / 3]))
    assert np.array_equal(curve(drawn, 1), (found["value"], found["mean"]))


def test_sweep_of_facets_reads_the_route() -> None:
    rows = [row("p", f"lemke@inner{v}", "solved", 1.0, request=f"inner{v}", solver="lemke") for v in (4, 8, 16)]
    rows += [row("p", f"lemke@fc-lcp-outer[facets={v}]", "solved", 1.0, solver="lemke") for v in (4, 8)]
    option, found = options.swept(rows_of.normalised(table(*rows)))
    assert option == "facets"
    assert found["series"].unique().tolist() == ["lemke@fc-lcp-outer[facets=ν]", "lemke@innerν"]
    assert found["value"].tolist() == [4.0, 8.0, 4.0, 8.0, 16.0]


@pytest.mark.parametrize(
    ("rows", "option", "match"),
    [
        (suite(20, 12), "omega", "unknown option of the solvers 'omega'"),
        (swept()[swept()["label"] == "nsgs[omega=1.0]"], "", "no option changes"),
        (swept().replace({"options": {'{"omega": 0.5}': '{"omega": "auto"}'}}), "", "omega=auto: no number"),
    ],
)
def test_sweeps_that_cannot_be(rows: pd.DataFrame, option: str, match: str) -> None:
    with pytest.raises(CpbenchError, match=match):
        options.swept(rows_of.normalised(rows), option)


def test_the_figure_is_among_those_of_runs(tmp_path: Path) -> None:
    assert packages()["cpbench_lab.run_figures"] == OF_RUNS
    file = results_file(tmp_path / "r.sqlite", swept())
    done = CliRunner().invoke(cli, ["plot", "sweep", str(file), "-o", str(tmp_path / "x.svg")])
    assert done.exit_code == 0, done.output
    assert "Sweep of omega" in (tmp_path / "x.svg").read_text()
