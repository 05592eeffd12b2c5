"""Lines and words of text files. Python takes more characters for ends of lines and for blanks, among them some that
stand in names and in numbers (the blank that does not break), and would cut these."""

from __future__ import annotations

import re

_WORD = re.compile(r"[^ \t\r\n\f]+")


def lines(text: str) -> list[str]:
    r"""Return the lines of a text, which end with \n, \r\n or \r.

    >>> lines("a\r\nb\x0bc\n")
    ['a', 'b\x0bc']
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return lines if lines[-1] else lines[:-1]


def words(line: str) -> list[str]:
    r"""Return the words between blanks and tabs.

    >>> words(" à\xa0b\t1.5 ")
    ['à\xa0b', '1.5']
    """
    return _WORD.findall(line)
