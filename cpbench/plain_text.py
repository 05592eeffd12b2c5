"""Text of others (messages of solvers, names in files) as it may go to a terminal, a log or a table."""

from __future__ import annotations

import re

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters but tab and line feed, what turns the direction of writing, and halves of surrogate pairs."""
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a cell begins with that a spreadsheet takes for a formula."""


def printable(text: str) -> str:
    r"""The text with everything spelled out that a terminal would obey or no encoding has.

    >>> printable("red \x1b[31m, half a pair \ud800")
    'red \\x1b[31m, half a pair \\ud800'
    """
    return _CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


def cell(text: str) -> str:
    """Make a text safe for a cell of a table: no spreadsheet computes it and no terminal obeys it.

    >>> cell("=1+1"), cell("a-b")
    ("'=1+1", 'a-b')
    """
    return f"'{printable(text)}" if text.startswith(_FORMULA) else printable(text)
