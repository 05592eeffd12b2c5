"""LaTeX of the laws of the formulations, derived from their plain text, so that each law is written once.

>>> law("K*_μ ∋ û ⟂ r ∈ K_μ")
'K^{*}_{\\\\mu} \\\\ni \\\\hat{u} \\\\perp r \\\\in K_{\\\\mu}'
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable

SYMBOLS = {
    "≤": r"\leq",
    "≥": r"\geq",
    "≠": r"\ne",
    "⟂": r"\perp",
    "⊥": r"\perp",
    "∈": r"\in",
    "∋": r"\ni",
    "⊂": r"\subset",
    "∀": r"\forall",
    "∃": r"\exists",
    "∞": r"\infty",
    "→": r"\to",
    "↔": r"\leftrightarrow",
    "⇒": r"\Rightarrow",
    "⇔": r"\Leftrightarrow",
    "×": r"\times",
    "·": r"\cdot",
    "…": r"\ldots",
    "∇": r"\nabla",
    "∂": r"\partial",
    "∠": r"\angle",
    "Σ": r"\sum",
    "Π": r"\prod",
    "∏": r"\prod",
    "√": r"\surd",
    "±": r"\pm",
    "‖": r"\|",
    "{": r"\{",
    "}": r"\}",
    "½": r"\frac{1}{2}",
    "−": "-",
    "′": "'",
    "ℝ": r"\mathbf{R}",
    "%": r"\%",
    "#": r"\#",
    "&": r"\&",
    "$": r"\$",
    "∘": r"\circ",
    "°": r"{}^{\circ}",
    "∩": r"\cap",
    "∪": r"\cup",
    "⊕": r"\oplus",
    "⊗": r"\otimes",
    "∑": r"\sum",
    "~": r"\sim",
    "\\": r"\setminus",
    "^": r"\wedge",
    "_": r"\_",
}
OPERATORS = frozenset({"min", "max", "det", "exp", "log", "sup", "inf", "arg", "dim", "ker"})
WORDS = frozenset({"is", "of", "at", "or", "if", "in", "on", "to", "by", "no"})
_CAPITALS = frozenset(["gamma", "delta", "theta", "lambda", "xi", "pi", "sigma", "upsilon", "phi", "psi", "omega"])
"""The others look like Latin letters, and LaTeX has no command for them."""
_TEXT = {"\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}"}
_ACCENTS = {"\u0302": r"\hat", "\u0303": r"\tilde", "\u0304": r"\bar", "\u0307": r"\dot", "\u0308": r"\ddot"}
_RAISED = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁼⁽⁾ⁿⁱᵀ", "0123456789+-=()niT", strict=True))
_LOWERED = dict(zip("₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓ", "0123456789+-=()aeijklmnoprstuvx", strict=True))
_TOKEN = re.compile(
    r"(?P<word>[A-Za-z]{2,})|"
    rf"(?P<raised>[{''.join(map(re.escape, _RAISED))}]+)|(?P<lowered>[{''.join(map(re.escape, _LOWERED))}]+)|"
    r"(?P<index>_(?:\[[^\]]*\]|\{[^}]*\}|[a-z]{2,}|[A-Za-z][0-9]*|[0-9]+|[^\sA-Za-z0-9]))|"
    r"(?P<star>(?<=[^\s(\[{,])\*)|(?P<blank>\s+)|(?P<other>.)",
    re.DOTALL,
)


def law(relation: str, names: Iterable[str] = ()) -> str:
    """Write a relation in plain Unicode as LaTeX for math mode; `names` of more than one letter stay whole (lb, ub)."""
    whole = sorted((n for n in names if len(n) > 1), key=len, reverse=True)
    text = unicodedata.normalize("NFC", relation)
    if not whole:
        return _convert(text)
    parts = re.split(rf"(?<![A-Za-z_])({'|'.join(map(re.escape, whole))})(?![A-Za-z_])", text)
    return " ".join(filter(None, (name(p) if k % 2 else _convert(p) for k, p in enumerate(parts))))


def name(text: str) -> str:
    """Write the name of a field in math mode: `mu_r` is μ_r, `lb` a word, `M` itself.

    >>> name("mu_r"), name("lb"), name("M"), name("cone_kind")
    ('\\\\mu_{r}', '\\\\mathit{lb}', 'M', '\\\\mathit{cone\\\\_kind}')
    """
    if len(text) == 1:
        return _convert(text)
    head, _, index = text.partition("_")
    spelled = "lambda" if head == "lam" else head
    try:
        unicodedata.lookup(f"GREEK SMALL LETTER {_unicode_name(spelled)}")
    except KeyError:
        if len(head) == 1 and index:
            return f"{head}_{{{index}}}"
        escaped = text.replace("_", r"\_")
        return rf"\mathit{{{escaped}}}"
    return rf"\{spelled}_{{{index}}}" if index else rf"\{spelled}"


def prose(text: str) -> str:
    """Write text outside of math mode, every character standing for itself.

    >>> prose("P_L → 50 %")
    'P\\\\_L \\\\ensuremath{\\\\to} 50 \\\\%'
    """
    pieces: list[str] = []
    for character in unicodedata.normalize("NFC", text):
        if character in _TEXT:
            pieces.append(_TEXT[character])
        elif character in "_{}%#&$":
            pieces.append(f"\\{character}")
        elif character.isascii():
            pieces.append(character)
        else:
            pieces.append(rf"\ensuremath{{{_raised_or(character)}}}")
    return "".join(pieces)


def number(value: float) -> str:
    """Write a number in math mode; 0 is a dot, as in the printed form.

    >>> number(0.0), number(-1.5), number(1e-8), number(float("inf"))
    ('\\\\cdot', '-1.5', '10^{-8}', '\\\\infty')
    """
    if value == 0:
        return r"\cdot"
    if value in (float("inf"), float("-inf")):
        return r"\infty" if value > 0 else r"-\infty"
    mantissa, _, exponent = f"{value:.4g}".partition("e")
    if not exponent:
        return mantissa
    factor = {"1": "", "-1": "-"}.get(mantissa, rf"{mantissa}\cdot ")
    return f"{factor}10^{{{int(exponent)}}}"


def _convert(text: str) -> str:
    pieces: list[str] = []
    for found in _TOKEN.finditer(text):
        kind, token = str(found.lastgroup), found[0]
        if kind == "word":
            pieces.append(_word(token))
        elif kind == "raised":
            pieces.append("^{" + "".join(r"\top" if c == "ᵀ" else _RAISED[c] for c in token) + "}")
        elif kind == "lowered":
            pieces.append("_{" + "".join(_LOWERED[c] for c in token) + "}")
        elif kind == "index":
            inside = token[1:].removeprefix("{").removesuffix("}") if token[1:2] == "{" else token[1:]
            pieces.append("_{" + _convert(inside) + "}")
        elif kind == "star":
            pieces.append("^{*}")
        elif kind == "blank":
            pieces.append(" ")
        else:
            pieces.append(_symbol(token))
    joined = ""
    for piece in pieces:  # a command must not swallow the letter behind it
        glued = re.search(r"\\[A-Za-z]+$", joined) and piece[:1].isalpha()
        joined += (" " if glued else "") + piece
    return " ".join(joined.split())


def _word(token: str) -> str:
    """Write `min` as an operator, `for` as a word, `Wr` and `Au` as products."""
    if token in OPERATORS:
        return rf"\{token} "
    if token.islower() and (len(token) > 2 or token in WORDS):
        return rf"\text{{ {token} }}"
    return token


def _symbol(character: str) -> str:
    if character in SYMBOLS:
        return SYMBOLS[character]
    parts = unicodedata.normalize("NFD", character)
    if len(parts) == 2 and parts[1] in _ACCENTS:
        return f"{_ACCENTS[parts[1]]}{{{_symbol(parts[0])}}}"
    title = unicodedata.name(character, "")
    match = re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER (\w+)", title)
    if match:
        spelled = {"LAMDA": "lambda", "OMICRON": "o"}.get(match[2], match[2].lower())
        if match[1] == "SMALL":
            return rf"\{spelled}"
        return rf"\{spelled.capitalize()}" if spelled in _CAPITALS else rf"\mathrm{{{spelled[0].upper()}}}"
    return character if character.isascii() else rf"\text{{[U+{ord(character):04X}]}}"  # always compiles


def _raised_or(character: str) -> str:
    if character in _RAISED:
        return "{}^{" + (r"\top" if character == "ᵀ" else _RAISED[character]) + "}"
    return "{}_{" + _LOWERED[character] + "}" if character in _LOWERED else _symbol(character)


def _unicode_name(spelled: str) -> str:
    return "LAMDA" if spelled == "lambda" else spelled.upper()
