"""Text: numbers with their nouns, names with what is set of them in brackets, and foreign text made safe for a terminal
or a table."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from cpbench.errors import CpbenchError


def counted(value: int, noun: str, nouns: str = "") -> str:
    """Return a number and its noun.

    >>> counted(1, "problem"), counted(2, "problem"), counted(2, "family", "families")
    ('1 problem', '2 problems', '2 families')
    """
    return f"{value} {noun}" if value == 1 else f"{value} {nouns or noun + 's'}"


def some_of(names: Sequence[str], most: int) -> str:
    """Join the first names, and count the others.

    >>> some_of("abc", 6), some_of("abc", 2)
    ('a, b, c', 'a, b and 1 more')
    """
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def summary(counts: Mapping[str, int]) -> str:
    """Return counts by status, the most frequent first.

    >>> summary({"failed": 1, "solved": 8})
    '8 solved, 1 failed'
    """
    return ", ".join(f"{counts[status]} {status}" for status in sorted(counts, key=lambda s: -counts[s]))


def read_brackets(kind: str, text: str) -> tuple[str, dict[str, str]]:
    """Read a name and what is set of it; raises CpbenchError on an item that is none, or is there twice.

    >>> read_brackets("solver", "nsgs[omega=1.2,shuffle=true]")
    ('nsgs', {'omega': '1.2', 'shuffle': 'true'})
    """
    name, bracket, rest = text.partition("[")
    if bracket and not rest.rstrip().endswith("]"):
        raise CpbenchError(f"{kind} '{text}': the bracket is not closed; write NAME[option=value,...]")
    given: dict[str, str] = {}
    for item in filter(None, (part.strip() for part in rest.strip().removesuffix("]").split(","))):
        key, equals, value = (part.strip() for part in item.partition("="))
        if not equals or not value:
            raise CpbenchError(f"{kind} '{text}': '{item}' is not an option; write NAME[option=value,...]")
        if key in given:
            raise CpbenchError(f"{kind} '{text}': {key} is given twice, as {given[key]} and {value}")
        given[key] = value
    return name.strip(), given


def split_brackets(text: str, separator: str) -> list[str]:
    """Split a list of names at separators that are not within brackets.

    >>> split_brackets("fc-lcp-inner[facets=1e+1]+lcp-qp", "+"), split_brackets("nsgs[omega=1,shuffle=true], psor", ",")
    (['fc-lcp-inner[facets=1e+1]', 'lcp-qp'], ['nsgs[omega=1,shuffle=true]', 'psor'])
    """
    parts, begin, depth = list[str](), 0, 0
    for k, letter in enumerate(text):
        if letter == "[":
            depth += 1
        elif letter == "]":
            depth -= 1
        elif letter == separator and depth <= 0:
            parts.append(text[begin:k])
            begin = k + 1
    return [part.strip() for part in (*parts, text[begin:])]


_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters but tab and line feed, what turns the direction of writing, and halves of surrogate pairs."""
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Beginnings of a cell that a spreadsheet takes for a formula."""

_TAG = re.compile(r"<(?=[A-Za-z/!?])")
"""Beginning of a tag of HTML, of a comment or of an instruction."""


def printable(text: str) -> str:
    r"""Return the text with everything spelled out that a terminal would obey or no encoding has.

    >>> printable("red \x1b[31m, half a pair \ud800")
    'red \\x1b[31m, half a pair \\ud800'
    """
    return _CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


def on_one_line(text: str) -> str:
    r"""Return the text as `printable` does, with line feeds spelled out too, as names of files may have them.

    >>> on_one_line("a\nb.h5")
    'a\\nb.h5'
    """
    return printable(text).replace("\n", "\\n")


def cell(text: str) -> str:
    """Make a text safe for a cell of a table: no formula to a spreadsheet, no control sequence to a terminal, no tag to
    a page that shows cells as they are.

    >>> cell("=1+1"), cell("a-b"), cell("n < 3"), cell("<b>")
    ("'=1+1", 'a-b', 'n < 3', '&lt;b>')
    """
    line = _TAG.sub("&lt;", on_one_line(text))
    return f"'{line}" if text.startswith(_FORMULA) else line
