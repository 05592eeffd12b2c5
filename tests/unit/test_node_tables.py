"""Tables by formulation, and that few modules list formulations by hand."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest
from sources import module_name, modules, parsed

from cpbench.errors import DuplicateName
from cpbench.formulations import formulations
from cpbench.registry import NodeTable
from cpbench.verification.rows import ROWS

MOST = 6
"""Modules that may list formulations: two of the checker of certificates, which shares nothing, three of testing, and
the published measures, each of which names the formulations of its authors."""
MANY = 4
"""Names of formulations in one literal that make it a list."""


def lists(tree: ast.Module, nodes: frozenset[str]) -> Iterator[int]:
    """Lines of the literals of a module that name many formulations."""
    for item in ast.walk(tree):
        parts = item.keys if isinstance(item, ast.Dict) else getattr(item, "elts", ())
        named = {part.value for part in parts if isinstance(part, ast.Constant) and isinstance(part.value, str)}
        if len(named & nodes) >= MANY:
            yield item.lineno


def test_few_modules_list_formulations() -> None:
    nodes = frozenset(formulations.names())
    found = {module_name(path): line for path in modules() for line in lists(parsed(path), nodes)}
    assert len(found) <= MOST, f"enter what they say in a NodeTable or on the classes: {found}"


def test_a_list_of_formulations_is_detected() -> None:
    tree = ast.parse('A = ("lcp", "qp", "fc")\nB = {"lcp": 1, "qp": 2, "fc": 3, "vi": 4}\n')
    assert list(lists(tree, frozenset(formulations.names()))) == [2]


def test_every_formulation_has_rows_for_the_judge() -> None:
    assert set(ROWS) == set(formulations.names())


def test_an_entry_is_not_replaced() -> None:
    table: NodeTable[int] = NodeTable("entry")
    assert table.enter(1, "lcp", "qp") == 1
    with pytest.raises(DuplicateName, match="entry of 'qp' is defined twice"):
        table.enter(2, "qp")
    assert dict(table) == {"lcp": 1, "qp": 1}
