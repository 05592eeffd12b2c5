"""The examples in the docstrings of the packages and of the tutorial hold."""

from __future__ import annotations

import doctest
import importlib
import re
from typing import Any

import pytest
from sources import ROOT, module_name, modules

MODULES = sorted(
    module_name(path).removeprefix("docs.")
    for path in (*modules(), *(ROOT / "docs" / "lecture").rglob("*.py"))
    if re.search(r"^ *>>> ", path.read_text("utf-8"), re.MULTILINE)
)
"""Modules with examples. They are found in the text: importing all of them only to look takes minutes."""
BY_NATIVE_SOLVERS = {
    "cpbench", "cpbench.api.problems", "cpbench.api.runs", "cpbench_problems.programs",
    "cpbench_problems.simulators",
    "cpbench.api.solution", "cpbench.api.solver_list", "cpbench.api.solving", "cpbench.api.solving_many",
    "cpbench.bench.planning.grids",
}  # fmt: skip
"""Those whose examples call solvers."""


def _marked(name: str) -> Any:
    """Those whose examples call solvers need them, and so does the tutorial."""
    calls = name in BY_NATIVE_SOLVERS or name.startswith("lecture")
    return pytest.param(name, marks=[pytest.mark.needs("cpbench_solvers")] if calls else [])


@pytest.mark.parametrize("module", [_marked(name) for name in MODULES])
def test_the_examples_hold(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    failed, tried = doctest.testmod(importlib.import_module(module))
    assert tried
    assert not failed, capsys.readouterr().out
