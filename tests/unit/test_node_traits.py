"""What a formulation lacks is said by `cpbench doctor --node`, and few modules list formulations by hand."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from command_line import cpbench
from sliding import SLIDING
from sources import module_name, modules

from cpbench.errors import DuplicateName
from cpbench.formulations import formulations
from cpbench.registry import NodeTable
from cpbench.testing.node_traits import DERIVED, MISSING, PRESENT, node_traits, tables

MOST = 6
"""Modules that may list formulations: two of the checker of certificates, which shares nothing, three of testing, and
the published measures, each of which names the formulations of its authors."""
MANY = 4
"""Names of formulations in one literal that make it a list."""
ENTERED = """
from cpbench.verification.rows import ROWS
from cpbench.verification.systems import relay

ROWS.enter(relay, "sliding")
"""


def lists(path: Path, nodes: frozenset[str]) -> Iterator[int]:
    """Lines of the literals of a module that name many formulations."""
    for item in ast.walk(ast.parse(path.read_text("utf-8"))):
        parts = item.keys if isinstance(item, ast.Dict) else getattr(item, "elts", ())
        named = {part.value for part in parts if isinstance(part, ast.Constant) and isinstance(part.value, str)}
        if len(named & nodes) >= MANY:
            yield item.lineno


def test_few_modules_list_formulations() -> None:
    nodes = frozenset(formulations.names())
    found = {module_name(path): line for path in modules() for line in lists(path, nodes)}
    assert len(found) <= MOST, f"enter what they say in a NodeTable or on the classes: {found}"


def test_a_list_of_formulations_is_detected(tmp_path: Path) -> None:
    file = tmp_path / "module.py"
    file.write_text('A = ("lcp", "qp", "fc")\nB = {"lcp": 1, "qp": 2, "fc": 3, "vi": 4}\n')
    assert list(lists(file, frozenset(formulations.names()))) == [2]


@pytest.mark.parametrize("node", formulations.names())
def test_every_formulation_has_what_the_judge_and_the_checks_need(node: str) -> None:
    states = {trait.name: trait.state for trait in node_traits(node)}
    for trait in ("relations", "data", "rows for the judge", "generator", "planted cases"):
        assert states[trait] == PRESENT, trait
    assert states["file"] == DERIVED


def test_entries_are_of_formulations() -> None:
    for table in tables():
        assert set(table) <= set(formulations.names()), table.trait


def test_an_entry_is_not_replaced() -> None:
    table: NodeTable[int] = NodeTable("trait", "nothing works")
    assert table.enter(1, "lcp", "qp") == 1
    with pytest.raises(DuplicateName, match="trait of 'qp' is defined twice"):
        table.enter(2, "qp")
    assert dict(table) == {"lcp": 1, "qp": 1}


def test_the_doctor_says_what_a_new_formulation_lacks(tmp_path: Path) -> None:
    before, after = _doctor(tmp_path, SLIDING), _doctor(tmp_path, SLIDING + ENTERED)
    assert before["rows for the judge"] == MISSING
    assert before["planted cases"] == DERIVED
    assert before["terms"] == before["data"] == before["generator"] == PRESENT
    assert after == before | {"rows for the judge": PRESENT}


def _doctor(folder: Path, text: str) -> dict[str, str]:
    """State by trait, in a process of its own: what a plugin enters stays."""
    (folder / "sliding.py").write_text(text)
    command = [sys.executable, "-m", "cpbench", "--plugin", "sliding.py", "doctor", "--node", "sliding"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return dict(re.findall(r"^(\S.*?) +(present|derived|missing) ", done.stdout, re.MULTILINE))


def test_an_unknown_formulation_is_refused(tmp_path: Path) -> None:
    done = cpbench(tmp_path, "doctor", "--node", "lpc")
    assert (done.returncode, done.stdout) == (2, "")
    assert "did you mean" in done.stderr


def test_a_formulation_is_not_compiled(tmp_path: Path) -> None:
    done = cpbench(tmp_path, "doctor", "--node", "lcp", "--warm")
    assert done.returncode == 2
    assert "--warm" in done.stderr
