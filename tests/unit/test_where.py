"""Conditions on problems against Python's own evaluation, and what may not be said in them."""

from __future__ import annotations

import contextlib
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpbench.bench.planning.where import DEEPEST, LONGEST, ExpressionError, condition, words

FACTS = {"n": 7.0, "nc": 120.0, "ndof": 300.0, "density": 0.25, "node": "gfc", "family": "chains"}
KNOWN = {name: type(value) for name, value in FACTS.items()} | {"absent": float, "zero": float}


@pytest.mark.parametrize(
    "text",
    [
        "nc>100 and 3*nc/ndof>1",
        "nc > 100 and not node == 'gfc' or n == 7",
        'node != "fc" and (family == "chains" or n < 3)',
        "1 < n <= 7 < nc",
        "-2**2 == -4 and 2**-1 == 0.5 and 2**3**2 == 512",
        "7 // 2 == 3 and -7 % 3 == 2 and 1 - 2 - 3 == -4 and 8 / 2 / 2 == 2",
        "not not n == 7",
        "node < 'h' and (n + (nc - 1)) * 2 >= 1e2",
        ".5 < density + 0.5 < 1.",
        "n == 7 == 7.0 != 8",
        " n > 0x6 and\n nc < 1_000 ",
    ],
)
def test_reads_as_python_does(text: str) -> None:
    for facts in (FACTS, FACTS | {"n": 8.0, "nc": 3.0, "node": "fc"}):
        assert condition(text, KNOWN).holds(facts) is eval(" ".join(text.split()), {}, dict(facts))


_NUMBERS = st.sampled_from(["1", "2.5", "3e1", "n", "nc", "density"])
_SUMS = st.recursive(
    _NUMBERS,
    lambda inner: st.one_of(
        st.builds("({}){}({})".format, inner, st.sampled_from(["+", "-", "*", "/", "//", "%"]), inner),
        st.builds("{} {} {}".format, inner, st.sampled_from(["+", "-", "*"]), inner),
        st.builds("-{}".format, inner),
    ),
    max_leaves=6,
)
_CONDITIONS = st.recursive(
    st.builds("{} {} {}".format, _SUMS, st.sampled_from(["<", "<=", "==", "!=", ">", ">="]), _SUMS),
    lambda inner: st.one_of(
        st.builds("{} {} {}".format, inner, st.sampled_from(["and", "or"]), inner),
        st.builds("not ({})".format, inner),
    ),
    max_leaves=4,
)


@settings(max_examples=300, deadline=None)
@given(_CONDITIONS)
def test_any_condition_reads_as_python_does(text: str) -> None:
    if len(text) > LONGEST:
        return
    try:
        expected = eval(text, {}, dict(FACTS))
    except ZeroDivisionError:
        condition(text, KNOWN).holds(FACTS)  # unknown there, an error here
        return
    assert condition(text, KNOWN).holds(FACTS) is expected


@pytest.mark.nightly
@settings(max_examples=300, deadline=None)
@given(st.text(max_size=60) | st.text("()<>=! *+-/%'\"n1.eandor", max_size=40))
def test_no_text_does_anything_but_be_read_or_refused(text: str) -> None:
    for read in (lambda: condition(text, KNOWN), lambda: words(text)):
        with contextlib.suppress(ExpressionError):
            assert read().holds(FACTS) in (True, False)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("absent > 1", False),
        ("not absent > 1", False),
        ("absent > 1 or n == 7", True),
        ("n == 7 or absent > 1", True),
        ("absent > 1 and n == 8", False),
        ("not (absent > 1 and n == 8)", True),
        ("not (absent > 1 and n == 7)", False),
        ("n / zero > 1", False),
        ("not n / zero > 1", False),
        ("n % zero == n // zero", False),
        ("8 < n < absent", False),
        ("not 8 < n < absent", True),
        ("9**9**9 > 1", False),
        ("(-8)**0.5 == 1", False),
        ("1e308 * 10 > 1", False),
    ],
)
def test_what_is_unknown_selects_nothing_and_hides_nothing(text: str, expected: bool) -> None:
    """Kleene's three values: the order of the parts does not matter."""
    assert condition(text, KNOWN).holds(FACTS | {"zero": 0.0}) is expected


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "the end"),
        ("nc >", "the end"),
        ("nc > 100)", "')'"),
        ("(nc > 100", "'(' was never closed"),
        ("nc", "is a number, not a condition"),
        ("'fc'", "is a text, not a condition"),
        ("ncc > 1", "did you mean nc? Known are absent, density, family, n, nc, ndof, node, zero"),
        ("node > 3", "a text cannot be compared"),
        ("(n > 1) == (nc > 1)", "a condition cannot be compared"),
        ("node + 1 > 2", "at 'node': is a text, not a number"),
        ("not n", "at 'n': is a number, not a condition"),
        ("n > 1 and nc", "at 'nc': is a number, not a condition"),
        ("n and nc > 1", "at 'n': is a number, not a condition"),
        ("-node == 1", "at 'node': is a text, not a number"),
        ("n = 7", "at '= 7'"),
        ("n.real > 1", "cannot be read"),
        ("n >> 1", "write numbers, 'texts', facts, + - * / // % **, <"),
        ("n > 1j", "cannot be read"),
        ("n == True", "cannot be read"),
        ("f'{n}' == node", "cannot be read"),
        ("n > 1 if", "at the end"),
        ("1if n else n > 1", "invalid decimal"),
        ("n > \0", "null"),
        ("__import__('os').system('true') == 0", "cannot be read"),
        ("(lambda: 1)() > 0", "cannot be read"),
        ("n if n else n > 1", "at 'n if n else n > 1': cannot be read"),
        ("[n] == [7]", "cannot be read"),
        ("n > 1 and and", "at 'and': invalid syntax; write numbers"),
        ("n" + "+n" * LONGEST + " > 1", f"at most {LONGEST}"),
        ("(" * 900 + "n > 1" + ")" * 900, "too many nested parentheses"),
        ("n" + "+n" * (DEEPEST + 1) + " > 1", f"more than {DEEPEST} deep"),
        ("not " * (DEEPEST + 1) + "n > 1", f"more than {DEEPEST} deep"),
        ("-" * (DEEPEST + 1) + "n > 1", f"more than {DEEPEST} deep"),
        ("2**" * (DEEPEST + 1) + "2 > 1", f"more than {DEEPEST} deep"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(text: str, word: str) -> None:
    with pytest.raises(ExpressionError) as refusal:
        condition(text, KNOWN)
    assert word in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("murty", True),
        ("MURTY-8", True),
        ("lcp/", True),
        ("chain", False),
        ("murty and not chain", True),
        ("chain or (classics and not 16)", True),
        ("not (murty or chain)", False),
        ("murty-*", False),
    ],
)
def test_words(text: str, expected: bool) -> None:
    problem = {"address": "problems/lcp/lcp-classics.h5::murty-8", "name": "murty-8", "family": "lcp-classics"}
    assert words(text).holds(problem) is expected


@pytest.mark.parametrize("text", ["", "and", "murty chain", "(murty", "murty or", "not"])
def test_words_that_cannot_be_read(text: str) -> None:
    with pytest.raises(ExpressionError):
        words(text)


def test_every_number_stays_finite_or_unknown() -> None:
    assert condition("n * 0 == 0", KNOWN).holds({"n": math.inf}) is False
