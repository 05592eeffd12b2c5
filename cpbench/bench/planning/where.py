"""Conditions on problems: `3*nc/ndof > 1 and node != 'fc'`, and words as `murty or (chain and not 3d)`.

Expressions are read by recursive descent and evaluated here; nothing of them is ever executed as Python. What a
problem does not have is unknown, and so is a division by zero; unknown spreads through arithmetic and comparisons,
and through `and`, `or`, `not` as in Kleene's logic: `nc > 3 or node == 'lcp'` selects an LCP, which has no nc.
Only what is known to hold is selected.
"""

from __future__ import annotations

import difflib
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

from cpbench.errors import CpbenchError

Value: TypeAlias = float | str | bool | None
"""A number, a text, a truth value, or None: unknown."""
Facts: TypeAlias = Mapping[str, float | str]
Operation: TypeAlias = Callable[[float, float], float]

LONGEST, DEEPEST = 2000, 50
"""Characters of an expression, and expressions inside one another."""

NUMBER, TEXT, TRUTH = "number", "text", "condition"
_KEYWORDS = ("and", "or", "not")
_COMPARE: Mapping[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_SUMS: Mapping[str, Operation] = {"+": operator.add, "-": operator.sub}
_PRODUCTS: Mapping[str, Operation] = {
    "*": operator.mul, "/": operator.truediv, "//": operator.floordiv, "%": operator.mod,
}  # fmt: skip
_TOKEN = re.compile(
    r"""\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\w.])
    |(?P<name>[A-Za-z_]\w*)
    |(?P<text>'[^']*'|"[^"]*")
    |(?P<sign>\*\*|//|[<>=!]=|[-+*/%()<>]))""",
    re.VERBOSE,
)
_WORD = re.compile(r"\s*(?:(?P<sign>[()])|(?P<name>[^\s()]+))")


class ExpressionError(CpbenchError):
    """A condition cannot be read; the message shows the place."""


@dataclass(frozen=True)
class Expression:
    """What was read: its kind (number, text or condition), and how to find its value."""

    kind: str
    value: Callable[[Facts], Value]

    def holds(self, facts: Facts) -> bool:
        """Whether the condition is known to hold."""
        return self.value(facts) is True


Atom: TypeAlias = "Callable[[_Tokens], Expression]"
"""Reads what stands between `and`, `or` and `not`."""


def condition(text: str, known: Mapping[str, type]) -> Expression:
    """The condition `text` on facts of the names and types `known` (float or str); raises ExpressionError.

    >>> condition("1 < nc/2 <= 3", {"nc": float}).holds({"nc": 6})
    True
    >>> condition("not nc > 100", {"nc": float}).holds({})
    False
    """
    return _read(_Tokens(text, _TOKEN), partial(_comparison, known))


def words(text: str) -> Expression:
    """The condition that words occur in the texts of a problem, whatever their case; with and, or, not, ().

    >>> words("chain and not 3d").holds({"name": "Chain-2D", "family": "chains"})
    True
    """
    return _read(_Tokens(text, _WORD), _word)


def _read(tokens: _Tokens, atom: Atom) -> Expression:
    found = _either(tokens, atom)
    if tokens.kind:
        raise tokens.error("expected the end, 'and' or 'or'")
    if found.kind != TRUTH:
        raise ExpressionError(f"'{tokens.text}': is a {found.kind}, not a condition: compare it with something")
    return found


class _Tokens:
    """The tokens of one text; `kind` and `token` of the present one are '' at the end."""

    def __init__(self, text: str, pattern: re.Pattern[str]) -> None:
        if len(text) > LONGEST:
            raise ExpressionError(f"'{text[:40]}...': has {len(text)} characters, at most {LONGEST} are read")
        self.text, self._pattern = text, pattern
        self._at = self._end = self._depth = 0
        self.kind = self.token = ""
        self.advance()

    def advance(self) -> str:
        """Go to the next token; gives back the one before."""
        passed = self.token
        found = self._pattern.match(self.text, self._end)
        if found is not None:
            self.kind = str(found.lastgroup)
            self.token, self._at, self._end = found[self.kind], found.start(self.kind), found.end()
        else:
            self.kind = self.token = ""
            self._at = self._end
            if self.text[self._end :].strip():
                raise self.error("cannot be read")
        return passed

    def among(self, *tokens: str) -> bool:
        """Whether the present token is one of these signs and keywords."""
        return self.kind in ("sign", "name") and self.token in tokens

    def error(self, what: str) -> ExpressionError:
        rest = self.text[self._at :].strip()
        place = f"'{rest}'" if rest else "the end"
        return ExpressionError(f"'{self.text}': at {place}: {what}")

    def want(self, found: Expression, kind: str) -> Expression:
        """`found`, if it is of this kind."""
        if found.kind != kind:
            raise self.error(f"expected a {kind} before this, found a {found.kind}")
        return found

    def inside(self, read: Callable[[], Expression]) -> Expression:
        """`read`, one level deeper."""
        self._depth += 1
        if self._depth > DEEPEST:
            raise self.error(f"is nested more than {DEEPEST} deep")
        found = read()
        self._depth -= 1
        return found


# ---------------------------------------------------------------------------------------------- and, or, not


def _either(tokens: _Tokens, atom: Atom) -> Expression:
    return _chain(tokens, "or", lambda: _chain(tokens, "and", lambda: _negated(tokens, atom)))


def _chain(tokens: _Tokens, word: str, part: Callable[[], Expression]) -> Expression:
    """Conditions joined by `and` or by `or`."""
    left = part()
    while tokens.among(word):
        tokens.want(left, TRUTH)
        tokens.advance()
        left = _joined(left, tokens.want(part(), TRUTH), word == "or")
    return left


def _negated(tokens: _Tokens, atom: Atom) -> Expression:
    if not tokens.among("not"):
        return atom(tokens)
    tokens.advance()
    inner = tokens.want(tokens.inside(lambda: _negated(tokens, atom)), TRUTH)
    return Expression(TRUTH, lambda facts: None if (v := inner.value(facts)) is None else not v)


def _parenthesis(tokens: _Tokens, atom: Atom) -> Expression:
    tokens.advance()
    found = tokens.inside(lambda: _either(tokens, atom))
    if not tokens.among(")"):
        raise tokens.error("expected ')'")
    tokens.advance()
    return found


def _joined(a: Expression, b: Expression, decisive: bool) -> Expression:
    """`a or b` (decided by a True), `a and b` (by a False); unknown when only an unknown could decide."""

    def value(facts: Facts) -> Value:
        both = (a.value(facts), b.value(facts))
        return decisive if decisive in both else None if None in both else not decisive

    return Expression(TRUTH, value)


def _word(tokens: _Tokens) -> Expression:
    if tokens.among("("):
        return _parenthesis(tokens, _word)
    if tokens.kind != "name" or tokens.among(*_KEYWORDS):
        raise tokens.error("expected a word")
    word = tokens.advance().lower()
    return Expression(TRUTH, lambda facts: any(word in str(v).lower() for v in facts.values()))


# ------------------------------------------------------------------------------- comparisons and arithmetic


def _comparison(known: Mapping[str, type], tokens: _Tokens) -> Expression:
    """`a < b <= c`, or what may be compared."""
    terms, signs = [_sum(known, tokens)], list[str]()
    while tokens.among(*_COMPARE):
        signs.append(tokens.advance())
        terms.append(_sum(known, tokens))
        left, right = terms[-2].kind, terms[-1].kind
        if left != right or left == TRUTH:
            raise tokens.error(f"a {left} cannot be compared with the {right} before this")
    if not signs:
        return terms[0]

    def value(facts: Facts) -> Value:
        values = [term.value(facts) for term in terms]
        links = [
            None if a is None or b is None else _COMPARE[sign](a, b)
            for sign, a, b in zip(signs, values[:-1], values[1:], strict=True)
        ]
        return False if False in links else None if None in links else True

    return Expression(TRUTH, value)


def _sum(known: Mapping[str, type], tokens: _Tokens) -> Expression:
    return _operations(tokens, _SUMS, lambda: _operations(tokens, _PRODUCTS, lambda: _power(known, tokens)))


def _operations(tokens: _Tokens, signs: Mapping[str, Operation], part: Callable[[], Expression]) -> Expression:
    """Operations of one rank, from left to right."""
    left = part()
    while tokens.among(*signs):
        tokens.want(left, NUMBER)
        left = _calculated(signs[tokens.advance()], left, tokens.want(part(), NUMBER))
    return left


def _power(known: Mapping[str, type], tokens: _Tokens) -> Expression:
    """`-a**-b`: a sign binds less than the power after it, more than the one before it, as in Python."""
    if tokens.among("+", "-"):
        sign = _constant(NUMBER, 1.0 if tokens.advance() == "+" else -1.0)
        return _calculated(operator.mul, sign, tokens.want(tokens.inside(lambda: _power(known, tokens)), NUMBER))
    base = _operand(known, tokens)
    if not tokens.among("**"):
        return base
    tokens.want(base, NUMBER)
    tokens.advance()
    return _calculated(math.pow, base, tokens.want(tokens.inside(lambda: _power(known, tokens)), NUMBER))


def _operand(known: Mapping[str, type], tokens: _Tokens) -> Expression:
    if tokens.among("("):
        return _parenthesis(tokens, partial(_comparison, known))
    if tokens.kind == "number":
        return _constant(NUMBER, float(tokens.advance()))
    if tokens.kind == "text":
        return _constant(TEXT, tokens.advance()[1:-1])
    if tokens.kind != "name" or tokens.among(*_KEYWORDS):
        raise tokens.error("expected a number, a name, a 'text' or '('")
    name = tokens.token
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise tokens.error(f"unknown fact {name}: {hint}Known are {', '.join(sorted(known))}")
    tokens.advance()
    return Expression(TEXT if known[name] is str else NUMBER, lambda facts: facts.get(name))


def _constant(kind: str, value: Value) -> Expression:
    return Expression(kind, lambda _: value)


def _calculated(operation: Operation, a: Expression, b: Expression) -> Expression:
    """In floating point, so that no power takes long; unknown where there is no finite result."""

    def value(facts: Facts) -> Value:
        x, y = a.value(facts), b.value(facts)
        if x is None or y is None:
            return None
        try:
            found = operation(float(x), float(y))
        except (ArithmeticError, ValueError):
            return None
        return found if math.isfinite(found) else None

    return Expression(NUMBER, value)
