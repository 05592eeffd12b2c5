"""The notebook `docs/quickstart.ipynb`, whose cells are plain Python and run as such."""

from __future__ import annotations

import ast
import json
import time
from pathlib import Path
from typing import Any

import pytest

import cpbench
from cpbench.generators.collection import builtin_folder

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "quickstart.ipynb"
CELLS = ["".join(c["source"]) for c in json.loads(NOTEBOOK.read_text("utf-8"))["cells"] if c["cell_type"] == "code"]


def test_it_is_short_and_names_what_there_is() -> None:
    lines = [line for cell in CELLS for line in cell.splitlines() if line.strip()]
    assert len(lines) <= 15
    called = {
        node.attr
        for node in ast.walk(ast.parse("\n".join(CELLS)))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "cp"
    }
    assert {"load", "solve", "convert", "run"} <= called <= set(cpbench.__all__)


@pytest.mark.needs("cpbench_solvers")
def test_its_problems_and_solvers_are_there() -> None:
    """The texts in it that are to name a file or a solver do."""
    texts = {n.value for n in ast.walk(ast.parse("\n".join(CELLS))) if isinstance(n, ast.Constant)}
    files = {text for text in texts if str(text).startswith("builtin/") and "::" not in str(text)}
    assert len(files) == 2
    assert all((builtin_folder() / file.removeprefix("builtin/")).is_file() for file in files)
    names = {spec.name for spec in cpbench.list_solvers("lcp")}
    assert len(texts & names) == 3


@pytest.mark.nightly
def test_its_cells_run_and_end_with_a_figure() -> None:
    space: dict[str, Any] = {}
    begun, shown = time.process_time(), []
    for cell in CELLS:
        *body, last = ast.parse(cell).body
        exec(compile(ast.Module(body, []), str(NOTEBOOK), "exec"), space)
        if isinstance(last, ast.Expr):
            shown.append(eval(compile(ast.Expression(last.value), str(NOTEBOOK), "eval"), space))
    problem, solution, (route, error), results, figure = shown
    assert "0 ≤ z ⟂" in problem._repr_html_()
    assert solution
    assert route
    assert error <= 1e-6
    solved = results.frame[results.frame["status"] == "solved"]
    assert set(solved["solver"]) == {"lemke", "psor", "bpp"}
    assert figure.axes[0].lines
    assert time.process_time() - begun < 20
