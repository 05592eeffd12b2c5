r"""Text of a results file as TeX: every character stands for itself, whatever TeX would make of it.

What comes out is ASCII, so that it means the same in `report.tex`, in `refs.bib` and in any encoding of a paper.
"""

from __future__ import annotations

import re
import unicodedata
from typing import Any

from cpbench.report import tex
from cpbench.report.text import one_line

_ASCII = {
    "\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "<": r"\textless{}",
    ">": r"\textgreater{}", "|": r"\textbar{}", '"': "{''}", "`": r"\textasciigrave{}",
    "'": r"{'}", "-": "{-}", ",": "{,}", "?": "{?}", "!": "{!}", "_": r"\_", "{": r"\{", "}": r"\}", "%": r"\%",
    "#": r"\#", "&": r"\&", "$": r"\$",
}  # fmt: skip
"""Braces around a character keep it from becoming a ligature with the next one."""
_OTHERS = {
    "–": "--", "—": "---", "‘": "`", "’": "'", "“": "``", "”": "''", "…": r"\ldots{}", "\u00a0": "~", "ß": r"{\ss}",
    "ø": r"{\o}", "Ø": r"{\O}", "å": r"{\aa}", "Å": r"{\AA}", "æ": r"{\ae}", "ł": r"{\l}", "Ł": r"{\L}", "ı": r"{\i}",
    "§": r"\S{}", "°": r"\ensuremath{^\circ}", "×": r"\ensuremath{\times}", "µ": r"\ensuremath{\mu}",
    "‖": r"\ensuremath{\|}", "≈": r"\ensuremath{\approx}", "⊇": r"\ensuremath{\supseteq}", "⁻": r"\ensuremath{^{-}}",
    "†": r"\ensuremath{^\dagger}", "‡": r"\ensuremath{^\ddagger}",
}  # fmt: skip
_ACCENTS = {
    "\u0300": "`", "\u0301": "'", "\u0302": "^", "\u0303": "~", "\u0304": "=", "\u0306": "u", "\u0307": ".",
    "\u0308": '"', "\u030a": "r", "\u030b": "H", "\u030c": "v", "\u0327": "c",
}  # fmt: skip
_MARKED = re.compile(r"\*\*(.+?)\*\*|\*(.+?)\*|`(.+?)`", re.DOTALL)


def text(value: Any) -> str:
    r"""Write `value` as running text on one line.

    >>> text("\\input{x} 50 % a--b")
    '\\textbackslash{}input\\{x\\} 50 \\% a{-}{-}b'
    >>> text("Júdice"), text("ρ ≤ ½")
    ("J{\\'u}dice", '\\ensuremath{\\rho} \\ensuremath{\\leq} \\ensuremath{\\frac{1}{2}}')
    """
    return "".join(map(_character, unicodedata.normalize("NFC", one_line(value))))


def label(value: Any) -> str:
    r"""Write `value` in typewriter type, which may be broken behind its punctuation.

    >>> label("lemke@inner8")
    '\\texttt{lemke@\\allowbreak{}inner8}'
    """
    return rf"\texttt{{{breakable(value)}}}"


def breakable(value: Any) -> str:
    r"""Write text that may be broken behind its punctuation."""
    return re.sub(r"(\{-\}|\\_|@|=|\{,\}|\[|/)", r"\1\\allowbreak{}", text(value))


def markdown(source: str) -> str:
    r"""Write paragraphs with bold, italics and code, as the methods of the Markdown report have.

    >>> markdown("**Time.** A *median*\nof `t`")
    '\\textbf{Time.} A \\emph{median} of \\texttt{t}'
    """
    return "\n\n".join(_inline(" ".join(part.split())) for part in source.strip().split("\n\n"))


def _inline(source: str) -> str:
    pieces: list[str] = []
    end = 0
    for found in _MARKED.finditer(source):
        pieces.append(_spaced(source[end : found.start()]))
        bold, italic, code = found.groups()
        if bold is not None:
            pieces.append(rf"\textbf{{{_spaced(bold)}}}")
        else:
            pieces.append(label(code) if code is not None else rf"\emph{{{_spaced(italic)}}}")
        end = found.end()
    return "".join([*pieces, _spaced(source[end:])])


def _spaced(part: str) -> str:
    """Write text with a blank at either end where there was one."""
    return (" " if part[:1] == " " else "") + text(part) + (" " if part[-1:] == " " and part.strip() else "")


def _character(character: str) -> str:
    if character in _ASCII:
        return _ASCII[character]
    if character.isascii():
        return character
    if character in _OTHERS:
        return _OTHERS[character]
    parts = unicodedata.normalize("NFD", character)
    if len(parts) == 2 and parts[0].isascii() and parts[1] in _ACCENTS:
        return (
            f"{{\\{_ACCENTS[parts[1]]}{{{parts[0]}}}}}"
            if parts[0].isalpha() and _ACCENTS[parts[1]].isalpha()
            else (f"{{\\{_ACCENTS[parts[1]]}{parts[0]}}}")
        )
    return tex.prose(character)
