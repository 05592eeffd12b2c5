"""The examples in the docstrings of the package hold."""

from __future__ import annotations

import doctest
import importlib
import re
from pathlib import Path

import pytest

import cpbench

PACKAGE = Path(cpbench.__file__).parent
MODULES = sorted(
    ".".join(("cpbench", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")
    for path in PACKAGE.rglob("*.py")
    if re.search(r"^ *>>> ", path.read_text("utf-8"), re.MULTILINE)
)
"""Modules with examples. They are found in the text: importing all of the package only to look takes minutes."""


@pytest.mark.parametrize("module", MODULES)
def test_the_examples_hold(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    failed, tried = doctest.testmod(importlib.import_module(module))
    assert tried
    assert not failed, capsys.readouterr().out
