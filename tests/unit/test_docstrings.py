"""Docstrings of functions begin with a verb, those of classes with a noun (ruff's D401 lets the words below pass), and
a public class has its name for itself."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator

from sources import module_name, modules, parsed

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
