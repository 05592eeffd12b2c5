"""Docstrings of functions begin with a verb, those of classes with a noun (ruff's D401 lets the words below pass), a
public class has its name for itself, and few modules list formulations by hand."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator

import pytest
from sources import module_name, modules, parsed

from cpbench.errors import DuplicateName
from cpbench.formulations import formulations
from cpbench.registry import NodeTable
from cpbench.verification.rows import ROWS

OTHER_WORDS = """
    A All An And As At By Each Every For From How If In Into It Its Likewise No None Not Of On One Only Raises Returns
    Some That The Their Them There These They This Those To Under What Whatever When Where Whether Which Who Whose Why
    With Without Yields
"""
ACTIONS = "Build Check Compute Count Draw Find Make Read Return Set Solve Write Yield"
NO_VERBS = set(OTHER_WORDS.split())
NO_NOUNS = NO_VERBS - {"A", "All", "An", "Each", "Every", "One", "The", "Those"} | set(ACTIONS.split())
Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def _is_property(node: Definition) -> bool:
    names = [ast.unparse(decorator).rpartition(".")[2] for decorator in node.decorator_list]
    return bool({"property", "cached_property"} & set(names))


def _refused(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and first word of every docstring that begins with a word that it must not begin with."""
    for node in ast.walk(tree):
        if not isinstance(node, Definition) or _is_property(node) or not (text := ast.get_docstring(node)):
            continue
        word = text.split()[0].rstrip(".,:;")
        refused = NO_NOUNS if isinstance(node, ast.ClassDef) else NO_VERBS
        # Letters only: a symbol (`K*`, `A⁻¹B`) is no verb; a class may begin with its equation.
        if word in refused or not (isinstance(node, ast.ClassDef) or (word.isascii() and word.isalpha())):
            yield node.lineno, word


def test_docstrings_begin_with_a_verb_or_a_noun() -> None:
    """Properties are read like attributes: theirs may be either."""
    files = modules()
    assert len(files) > 400
    found = [f"{module_name(path)}:{line}: {word}" for path in files for line, word in _refused(parsed(path))]
    assert not found, "\n".join(found)


def test_forbidden_words_are_detected() -> None:
    source = 'def f():\n    """The sum."""\ndef g():\n    """A⁻¹b."""\nclass C:\n    """What is read."""\n'
    assert list(_refused(ast.parse(source))) == [(1, "The"), (3, "A⁻¹b"), (5, "What")]
    fine = '@property\ndef f():\n    """The sum."""\ndef g():\n    """Return it."""\nclass C:\n    """The sums."""\n'
    assert not list(_refused(ast.parse(fine)))


def test_no_public_class_name_is_defined_twice() -> None:
    nodes = [node for path in modules() for node in parsed(path).body]
    names = Counter(node.name for node in nodes if isinstance(node, ast.ClassDef) and not node.name.startswith("_"))
    assert len(names) > 500
    assert [name for name, count in names.items() if count > 1] == []


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
