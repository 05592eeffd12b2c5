"""Origins of problems: families of one collection belong together, and are left out together.

Problems of one origin resemble each other, whatever family they are filed under: the tests of Hock and Schittkowski
are three families by their rows, and TORSION1 and TORSIONA are one file with other parameters. A rule on names finds
what belongs together, and rather too much than too little: what is left out can give nothing away.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import takewhile

from cpbench.formulations.base import formulations

LEAST = 4
"""Letters that two different words have in common, at least, to be one."""
SHARE = 0.75
"""Part of the shorter word that these letters are, at least."""


def family_of(family: str, problem: str) -> str:
    """Return the family of a problem; where its file names none, the first word of letters in the problem's name.

    A word that names a formulation says how a problem is written, and not where it is from.

    >>> family_of("", "Capsules-i100-889.dat"), family_of("torsion", "x"), family_of("", "42")
    ('Capsules', 'torsion', '42')
    >>> family_of("", "GRFC3D_Chute-nc-4"), family_of("", "lcp_7")
    ('Chute', 'lcp')
    """
    if family:
        return family
    parts = re.findall(r"[^\W_]+", problem.partition(".")[0])
    telling = [part for part in parts if re.sub(r"[23]D$", "", part, flags=re.IGNORECASE).lower() not in formulations]
    return next((word for part in (*telling, *parts) if (word := _word(part))), problem)


def origins(families: Sequence[str], fingerprints: Sequence[str]) -> tuple[str, ...]:
    """Return the origin of each problem: the first word of its family, in lower case.

    Words of one origin begin alike (LEAST letters, SHARE of the shorter word), and so does a chain of such words; the
    origin is called by the first in the alphabet. A problem that stands in two families (one fingerprint) joins them.

    >>> origins(["hock-bounds", "hock-rows", "TORSION", "TORSIONA", "lcp", "cone"], ["1", "2", "3", "4", "5", "5"])
    ('hock', 'hock', 'torsion', 'torsion', 'cone', 'cone')
    """
    words = [(_word(family, anywhere=True) or family).lower() for family in families]
    parent = {word: word for word in words}

    def root(word: str) -> str:
        while parent[word] != word:
            word = parent[word]
        return word

    def join(one: str, other: str) -> None:
        low, high = sorted((root(one), root(other)))
        parent[high] = low

    beginnings: dict[str, list[str]] = {}
    for word in parent:
        beginnings.setdefault(word[:LEAST], []).append(word)
    for alike in beginnings.values():
        for at, one in enumerate(alike):
            for other in alike[:at]:
                if _common(one, other) >= max(LEAST, SHARE * min(len(one), len(other))):
                    join(one, other)
    first: dict[str, str] = {}
    for word, fingerprint in zip(words, fingerprints, strict=True):
        join(word, first.setdefault(fingerprint, word))
    return tuple(root(word) for word in words)


def _common(one: str, other: str) -> int:
    """Count the letters with which both words begin."""
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(one, other, strict=False)))


def _word(text: str, *, anywhere: bool = False) -> str:
    """Return the letters with which a text begins, or the first ones in it; '' without any."""
    found = (re.search if anywhere else re.match)(r"[^\W\d_]+", text)
    return found.group() if found else ""
