"""The examples in the docstrings of the tutorial hold."""

from __future__ import annotations

import doctest
import importlib
import re
from pathlib import Path

import lecture
import pytest

FOLDER = Path(lecture.__file__).parent
MODULES = sorted(
    ".".join(("lecture", *path.relative_to(FOLDER).with_suffix("").parts)).removesuffix(".__init__")
    for path in FOLDER.rglob("*.py")
    if re.search(r"^ *>>> ", path.read_text("utf-8"), re.MULTILINE)
)


@pytest.mark.parametrize("module", MODULES)
def test_the_examples_hold(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    failed, tried = doctest.testmod(importlib.import_module(module))
    assert tried
    assert not failed, capsys.readouterr().out
