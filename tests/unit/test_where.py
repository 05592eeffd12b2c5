"""Conditions on problems against Python's own evaluation, and what may not be said in them."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpbench.bench.planning.where import holds, require_condition
from cpbench.errors import CpbenchError

FACTS = {"n": 7.0, "nc": 120.0, "ndof": 300.0, "density": 0.25, "node": "gfc", "family": "chains"}
KNOWN = {name: type(value) for name, value in FACTS.items()} | {"absent": float, "zero": float}


def known_to_hold(text: str, facts: dict[str, float | str] = FACTS) -> bool:
    return holds(text, [facts], KNOWN)[0]


@pytest.mark.parametrize(
    "text",
    [
        "nc>100 and 3*nc/ndof>1",
        "nc > 100 and not node == 'gfc' or n == 7",
        'node != "fc" and (family == "chains" or n < 3)',
        "1 < n <= 7 < nc",
        "-n**2 == -49 and 2**-1 == 0.5 and 2**3**2 == 512",
        "7 // 2 == 3 and -n % 3 == 2 and 1 - 2 - 3 == -4 and 8 / 2 / 2 == 2",
        "not not n == 7",
        "node < 'h' and (n + (nc - 1)) * 2 >= 1e2",
        ".5 < density + 0.5 < 1.",
        "n == 7 == 7.0 != 8",
        "node in ['gfc', 'lcp'] and n not in [1, 2]",
        " n > 0x6 and\n nc < 1_000 ",
    ],
)
def test_reads_as_python_does(text: str) -> None:
    for facts in (FACTS, FACTS | {"n": 8.0, "nc": 3.0, "node": "fc"}):
        assert known_to_hold(text, facts) is eval(" ".join(text.split()), {}, dict(facts))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("absent > 1", False),
        ("not absent > 1", False),
        ("absent != 1", False),
        ("absent > 1 or n == 7", True),
        ("n == 7 or absent > 1", True),
        ("absent > 1 and n == 8", False),
        ("not (absent > 1 and n == 8)", True),
        ("not (absent > 1 and n == 7)", False),
        ("8 < n < absent", False),
        ("not 8 < n < absent", True),
        ("zero / zero == 1", False),
        ("not zero / zero == 1", False),
    ],
)
def test_what_is_unknown_selects_nothing_and_hides_nothing(text: str, expected: bool) -> None:
    """Kleene's three values: the order of the parts does not matter."""
    assert known_to_hold(text, FACTS | {"zero": 0.0}) is expected


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "the end"),
        ("nc >", "the end"),
        ("nc > 100)", "')'"),
        ("(nc > 100", "'(' was never closed"),
        ("nc", "is no condition on facts"),
        ("'fc'", "is no condition on facts"),
        ("1 > 0", "is no condition on facts"),
        ("ncc > 1", "unknown fact 'ncc': did you mean nc"),
        ("node > 3", "cannot be evaluated (node is a text)"),
        ("node + 1 > 2", "cannot be evaluated (node is a text)"),
        ("not n", "cannot be evaluated (n is a number)"),
        ("n and nc > 1", "n is a number, nc is a number"),
        ("-node == 1", "cannot be evaluated (node is a text)"),
        ("9**9**9 > n", "out of range"),
        ("n = 7", "at '= 7'"),
        ("n > 1j", "at '1j': cannot be read"),
        ("n == True", "at 'True': cannot be read"),
        ("n >> 1", "at 'n >> 1': cannot be read; write numbers, 'texts', facts, + - * / // % **, <"),
        ("f'{n}' == node", "cannot be read"),
        ("n > \0", "null"),
        ("n if n else n > 1", "cannot be read"),
        ("[n][0] > 1", "cannot be read"),
        ("n > 1 and and", "at 'and': invalid syntax; write numbers"),
        ("n" + "+n" * 5000 + " > 1", "cannot be"),
        ("(" * 900 + "n > 1" + ")" * 900, "too many nested parentheses"),
        ("-" * 5000 + "n > 1", "cannot be read"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(text: str, word: str) -> None:
    with pytest.raises(CpbenchError) as refusal:
        require_condition(text, KNOWN)
    assert word in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "text",
    [
        "@KNOWN == 1",
        "n == @KNOWN",
        "`n` > 1",
        "n.real > 1",
        "node.str.len() > 1",
        "sqrt(n) > 1",
        "__import__('os').system('true') == 0",
        "(lambda: 1)() > 0",
        "(n := 1) > 0",
        "[x for x in [n]] == [7]",
        "n > 1; n = 2",
    ],
)
def test_nothing_is_executed_as_python(text: str) -> None:
    with pytest.raises(CpbenchError, match="write numbers, 'texts', facts"):
        require_condition(text, KNOWN)


@pytest.mark.nightly
@settings(max_examples=300, deadline=None)
@given(st.text(max_size=60) | st.text("()<>=! *+-/%'\"n1.eandor@`", max_size=40))
def test_no_text_does_anything_but_be_read_or_refused(text: str) -> None:
    with contextlib.suppress(CpbenchError):
        assert known_to_hold(text) in (True, False)


def test_each_problem_is_told_apart() -> None:
    facts = [{"n": 1.0}, {"node": "lcp"}, {"n": 9.0, "node": "fc"}]
    assert holds("n > 3 or node == 'lcp'", facts, KNOWN) == [False, True, True]
    assert holds("n > 3", [], KNOWN) == []
