"""Names of unknowns in .nl (by its .col), GAMS' text and MathOptFormat are kept, and answers are shown by them."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import pytest
from command_line import cpbench as command

import cpbench
from cpbench.api.solution import objective_of
from cpbench.cli.answered import unknown_lines


def shown(problem: Any, answer: list[float]) -> list[str]:
    return [line.split(" ")[2] for line in unknown_lines(problem, problem.point_from_vector(answer), None)]


def pyomo_program(folder: Path) -> Any:
    """max 7 − (a − 1)² − (b − 2)² with a + b ≤ 2: a = 1/2, b = 3/2, 13/2."""
    pe = pytest.importorskip("pyomo.environ", reason="needs Pyomo: pip install pyomo")
    model = pe.ConcreteModel()
    model.left, model.right = pe.Var(bounds=(0, 4)), pe.Var(initialize=1.0)
    model.gain = pe.Objective(expr=7 - (model.left - 1) ** 2 - (model.right - 2) ** 2, sense=pe.maximize)
    model.row = pe.Constraint(expr=model.left + model.right <= 2)
    model.write(str(folder / "max.nl"), io_options={"symbolic_solver_labels": True})
    return cpbench.load(folder / "max.nl")


def test_names_of_an_nl_file_and_the_value_of_its_maximum(tmp_path: Path) -> None:
    problem = pyomo_program(tmp_path)
    assert sorted(problem.info.properties["unknowns"]) == ["left", "right"]
    solution = cpbench.solve(problem, tolerance=1e-9)
    values = dict(zip(problem.info.properties["unknowns"], solution.point.z.tolist(), strict=True))
    assert values == pytest.approx({"left": 0.5, "right": 1.5}, abs=1e-6)
    assert objective_of(problem, solution.point) == pytest.approx(6.5, abs=1e-6)
    text = command(tmp_path, "solve", "max.nl").stdout
    assert "objective 6.5" in text
    assert "left  = 0.5" in text


def test_names_of_another_number_are_ignored_with_a_note(tmp_path: Path, caplog: Any) -> None:
    pyomo_program(tmp_path)
    (tmp_path / "max.col").write_text("left\n")
    with caplog.at_level(logging.WARNING, logger="cpbench.storage"):
        problem = cpbench.load(tmp_path / "max.nl")
    assert "unknowns" not in problem.info.properties
    assert "has 1 names" in caplog.text


def test_without_names_there_are_none(tmp_path: Path) -> None:
    pyomo_program(tmp_path)
    (tmp_path / "max.col").unlink()
    assert "unknowns" not in cpbench.load(tmp_path / "max.nl").info.properties


GAMS = """Variables price, wage, gap; Positive Variables price, gap; Equations e1, e2, e3;
e1.. 2*price + gap - 5 =G= 0; e2.. wage - 3 =E= 0; e3.. price + 2*gap - 6 =G= 0;
Model m / e1.price, e2.wage, e3.gap /; Solve m using MCP;
"""


@pytest.mark.needs("cpbench_solvers")
def test_names_of_gams_follow_their_numbers(tmp_path: Path) -> None:
    """A mixed problem has its free unknowns first: wage = 3, price = 4/3, gap = 7/3 by hand."""
    (tmp_path / "market.gms").write_text(GAMS)
    problem = cpbench.load(tmp_path / "market.gms")
    assert problem.node == "mlcp"
    assert shown(problem, [3.0, 4 / 3, 7 / 3]) == ["wage", "price", "gap"]
    lines = command(tmp_path, "solve", "market.gms").stdout.splitlines()[1:]
    values = {line.split()[0]: float(line.split()[2]) for line in lines}
    assert values == pytest.approx({"wage": 3.0, "price": 4 / 3, "gap": 7 / 3}, rel=1e-6)


def mof(description: str) -> str:
    affine = {"type": "ScalarAffineFunction", "terms": [{"coefficient": 1.0, "variable": "steel"}], "constant": 0.0}
    constraint = {"function": {"type": "Variable", "name": "steel"}, "set": {"type": "GreaterThan", "lower": 2.0}}
    return json.dumps(
        {
            "version": {"major": 1, "minor": 7},
            "description": description,
            "variables": [{"name": "steel"}],
            "objective": {"sense": "min", "function": affine},
            "constraints": [constraint],
        }
    )


@pytest.mark.parametrize(("description", "name"), [("", "steel"), ("cpbench qp: min", "z[0]")])
def test_names_of_mathoptformat_but_for_those_of_cpbench(tmp_path: Path, description: str, name: str) -> None:
    (tmp_path / "plan.mof.json").write_text(mof(description))
    problem = cpbench.load(tmp_path / "plan.mof.json")
    assert shown(problem, [2.0, 1.0])[0] == name


def test_slacks_stand_beside_names(tmp_path: Path) -> None:
    text = GAMS.replace(" e2.wage,", "").replace("e2.. wage - 3 =E= 0; ", "").replace("wage, ", "").replace("e2, ", "")
    (tmp_path / "pair.gms").write_text(text)
    problem = cpbench.load(tmp_path / "pair.gms")
    assert problem.node == "lcp"
    lines = list(unknown_lines(problem, problem.point_from_vector([5.0, 1.0]), None))
    assert lines == ["  price = 5    w = 6", "  gap   = 1    w = 1"]
