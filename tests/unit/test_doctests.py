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


@pytest.mark.parametrize("module", MODULES)
def test_the_examples_hold(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    failed, tried = doctest.testmod(importlib.import_module(module))
    assert tried
    assert not failed, capsys.readouterr().out
