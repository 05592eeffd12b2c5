"""Plain text: foreign text (messages of solvers, names in files) made safe for a terminal or a table."""

from __future__ import annotations

import re

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
