"""The examples in the docstrings of the packages hold."""

from __future__ import annotations

import doctest
import importlib
import re

import pytest
from sources import module_name, modules

MODULES = sorted(
    module_name(path) for path in modules() if re.search(r"^ *>>> ", path.read_text("utf-8"), re.MULTILINE)
)
"""Modules with examples. They are found in the text: importing all of them only to look takes minutes."""
BY_NATIVE_SOLVERS = {
    "cpbench", "cpbench.api.problems", "cpbench.api.runs", "cpbench_problems.programs",
    "cpbench_problems.simulators",
    "cpbench.api.solution", "cpbench.api.solver_list", "cpbench.api.solving", "cpbench.api.solving_many",
    "cpbench.bench.planning.grids",
}  # fmt: skip
"""Those whose examples call solvers."""


@pytest.mark.parametrize(
    "module",
    [
        pytest.param(name, marks=[pytest.mark.needs("cpbench_solvers")] if name in BY_NATIVE_SOLVERS else [])
        for name in MODULES
    ],
)
def test_the_examples_hold(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    failed, tried = doctest.testmod(importlib.import_module(module))
    assert tried
    assert not failed, capsys.readouterr().out
