r"""A macro for every number, so that a paper says `\cpbenchLcpLemkeSolved` and not 44.

Names are \cpbench and the words of what is named, letters only: digits are spelled, all else separates words.
Where two names would be the same the later one ends in B, C, ...
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping

PREFIX = "cpbench"
_SPELLED = ("Zero", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")
_DIGITS = dict(zip("0123456789", _SPELLED, strict=True))


class Macros:
    """The macros of a document, in the order of their definition."""

    def __init__(self) -> None:
        self._values: dict[str, str] = {}
        self._names: dict[tuple[str, ...], str] = {}

    def define(self, words: tuple[str, ...], value: str) -> str:
        r"""Define the macro of these words as `value`, which is TeX already; gives the call, ending in {}.

        >>> macros = Macros()
        >>> macros.define(("lemke@inner8", "solved"), "44"), macros.define(("lemke-inner8", "solved"), "4")
        ('\\cpbenchLemkeInnerEightSolved{}', '\\cpbenchLemkeInnerEightSolvedB{}')
        """
        name = self._names.get(words) or self._free(PREFIX + "".join(map(letters, words)))
        self._names[words] = name
        self._values[name] = value
        return f"\\{name}{{}}"

    @property
    def values(self) -> Mapping[str, str]:
        """Names without the backslash, and what they stand for."""
        return self._values

    def text(self) -> str:
        """Write the definitions, one a line."""
        return "".join(f"\\newcommand{{\\{name}}}{{{value}}}\n" for name, value in self._values.items())

    def _free(self, name: str) -> str:
        taken = {*self._values}
        if name not in taken:
            return name
        place = 1
        while name + _suffix(place) in taken:
            place += 1
        return name + _suffix(place)


def letters(words: str) -> str:
    """Spell words as letters, each with a capital.

    >>> letters("nsgs[omega=0.8]"), letters("fc-lcp_inner16"), letters("ν ∂x")
    ('NsgsOmegaZeroPointEight', 'FcLcpInnerOneSix', 'NuX')
    """
    pointed = re.sub(r"(?<=\d)\.(?=\d)", " point ", words)
    found: list[str] = []
    for word in re.findall(r"[^\W\d_]+|\d|[^\w\s]", pointed):
        if word in _DIGITS:
            found.append(_DIGITS[word])
        elif word[0].isalpha():
            plain = "".join(map(_latin, word))
            found.append(plain[:1].upper() + plain[1:])
    return "".join(found)


def _latin(character: str) -> str:
    """Return ASCII letters of a letter: without its accent, or the name of a Greek one; '' of any other."""
    base = unicodedata.normalize("NFD", character)[0]
    if base.isascii():
        return base
    matched = re.fullmatch(r"GREEK \w+ LETTER ([A-Z]+)", unicodedata.name(base, ""))
    return matched[1].lower() if matched else ""


def _suffix(place: int) -> str:
    """Return B, C, ..., Z, AB, AC, ...: 1 is the second of its name."""
    high, low = divmod(place, 26)
    return (_suffix(high - 1) if high > 1 else "A" if high else "") + chr(ord("A") + low)
