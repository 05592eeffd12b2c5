"""Solvers as they are asked for: globs and grids."""

from __future__ import annotations

import re

import pytest

from cpbench.bench.planning import grids, plan, quantities
from cpbench.errors import CpbenchError
from cpbench.solvers.base import solvers


def labels(*texts: str) -> list[str]:
    return [entry.label for entry in grids.entries(texts)]


@pytest.mark.needs("cpbench_solvers")
def test_a_grid_has_every_combination() -> None:
    found = grids.grid("nsgs[omega=0.8:1.4:0.2, shuffle=true|false]")
    assert [e.options["omega"] for e in found] == [0.8, 0.8, 1.0, 1.0, 1.2, 1.2, 1.4, 1.4], "decimal, end included"
    assert [e.options["shuffle"] for e in found] == [True, False] * 4
    assert len({e.label for e in found}) == 8


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("0.1:0.7:0.1", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]),  # 0.1 + 6 * 0.1 > 0.7 in binary
        ("1:2:0.3", [1.0, 1.3, 1.6, 1.9]),
        ("0:1:0.333333333333", [0.0, 0.333333333333, 0.666666666666, 0.999999999999]),
        ("0:1:0.3333333334", [0.0, 0.3333333334, 0.6666666668, 1.0000000002]),  # within rounding of its end
        ("1.5:1:-0.25", [1.5, 1.25, 1.0]),
        ("1:1:1", [1.0]),
        ("1.9|1:1.2:0.1", [1.9, 1.0, 1.1, 1.2]),
    ],
)
def test_ranges_include_their_end(text: str, values: list[float]) -> None:
    assert [e.options["omega"] for e in grids.grid(f"psor[omega={text}]")] == values


@pytest.mark.needs("cpbench_solvers")
def test_values_have_the_type_of_the_option() -> None:
    assert [e.options["max_iterations"] for e in grids.grid("nsgs[max_iterations=1e2:3e2:100]")] == [100, 200, 300]
    assert all(type(e.options["max_iterations"]) is int for e in grids.grid("nsgs[max_iterations=1:3:1]"))


@pytest.mark.needs("cpbench_solvers")
def test_globs_choose_among_the_names() -> None:
    assert labels("newton-m*") == ["newton-min", "newton-min-micp", "newton-min-mlcp"]
    asked = [f"{name}[max_iterations=9]" for name in ("nsgs", "nsgs-gfc", "nsgs-rfc")]
    assert labels("nsgs*[max_iterations=9]") == asked
    assert labels("lemke", "l?mke", "lemke") == ["lemke"], "each once"


def test_a_run_that_names_none_takes_those_that_run_by_default() -> None:
    chosen = [solver.spec.name for solver in solvers if solver.spec.by_default]
    assert [entry.label for entry in grids.by_default()] == chosen
    assert labels("all") == labels("*") == solvers.names()


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("nsga", "did you mean nsgs"),
        ("neuton-*", "unknown solver 'neuton-*'"),
        ("nsgs[omga=1|2]", "omega"),
        ("nsgs*[omega=1", "not closed"),
        ("nsgs[omega]", "'omega' is not an option"),
        ("nsgs[omega=]", "is not an option"),
        ("nsgs[omega=1,omega=2]", "twice"),
        ("nsgs[omega=fast|slow]", "float"),
        ("nsgs[shuffle=true|perhaps]", "bool"),
        ("nsgs[omega=1:2]", "no range"),
        ("nsgs[omega=1:2:0]", "no range"),
        ("nsgs[omega=1:x:1]", "no range"),
        ("nsgs[omega=1:2:-1]", "has no end"),
        ("nsgs[omega=1:inf:1]", "has no end"),
        ("nsgs[omega=0:1:1e-9]", "1e+9 numbers"),
        ("nsgs[omega=0:1e999999:1e-999999]", "no range"),
        ("nsgs[omega=0:1:0.001,stall_window=1:100:1]", "100100 entries"),
        ("nsgs[max_iterations=1:2:0.5]", "int"),
    ],
)
def test_an_unknown_solver_is_refused_in_one_line(text: str, word: str) -> None:
    with pytest.raises(CpbenchError) as refusal:
        grids.grid(text)
    assert word in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("text", ["soon", "-1s", "0", "10 days", ""])
def test_what_is_no_duration(text: str) -> None:
    with pytest.raises(CpbenchError, match="10s, 5m, 2h or none"):
        quantities.seconds(text)


def test_conversions_of_a_route_take_knobs() -> None:
    assert plan.pinned(["compliant[compliance=1e-2]"]).name == "fc-coneqp-compliant[compliance=0.01]"
    assert plan.pinned(["inner[facets=16]"], 8).via[0][1] == {"facets": 16}
    for text, told in (
        ("inner[sides=3]", "unknown parameter of fc-lcp-inner 'sides'"),
        ("inner[facets=many]", "facets is 'many', expected int"),
        ("inner[facets=3", "bracket is not closed"),
    ):
        with pytest.raises(CpbenchError, match=re.escape(told)):
            plan.pinned([text])
