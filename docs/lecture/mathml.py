"""LaTeX to MathML by `latex2mathml`, with what browsers that follow MathML Core leave out put right."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from typing import Any

from cpbench.errors import Unavailable

_SYMBOLS = {
    # operators that the converter takes for identifiers, which get no room around them
    "<mi>&#x027C2;</mi>": '<mo lspace="0.28em" rspace="0.28em">&#x027C2;</mo>',
    "<mi>&#x022A4;</mi>": '<mo lspace="0" rspace="0">&#x022A4;</mo>',
    # mathvariant knows `normal` only in MathML Core: letters of their own instead
    '<mi mathvariant="script">L</mi>': "<mi>&#x2112;</mi>",
    '<mi mathvariant="script">P</mi>': "<mi>&#x1D4AB;</mi>",
    '<mi mathvariant="bold">F</mi>': "<mi>&#x1D405;</mi>",
    '<mo stretchy="true">&#x000AF;</mo>': "<mo>&#x000AF;</mo>",
}


@cache
def mathml(latex: str, *, block: bool = False) -> str:
    r"""A `math` element; the LaTeX stays with it as its annotation.

    >>> mathml(r"z \ge 0").startswith('<math display="inline"><semantics><mrow>')
    True
    """
    made = _converter()(latex, display="block" if block else "inline")
    made = made.replace(' xmlns="http://www.w3.org/1998/Math/MathML"', "")
    for wrong, right in _SYMBOLS.items():
        made = made.replace(wrong, right)
    # a rule under min and max belongs below in displays only
    made = re.sub(r"<mo>(min|max)</mo>", r'<mo movablelimits="true" lspace="0" rspace="0.17em">\1</mo>', made)
    if block:
        made = re.sub(
            r'<msub>(<mo movablelimits="true"[^>]*>(?:min|max)</mo>)(.*?)</msub>(?!</mrow></msub>)', _below, made
        )
    # MathML Core has no columnalign
    made = re.sub(r' columnalign="(left|right)"', r' style="text-align: \1"', made)
    head, body = made.split(">", 1)
    body = body.removesuffix("</math>")
    note = latex.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return f'{head}><semantics>{body}<annotation encoding="application/x-tex">{note}</annotation></semantics></math>'


def _below(found: re.Match[str]) -> str:
    return f"<munder>{found[1]}{found[2]}</munder>"


def _converter() -> Callable[..., Any]:
    """Raise Unavailable where the library is not installed."""
    try:
        from latex2mathml.converter import convert
    except ImportError as cause:
        raise Unavailable("missing", "latex2mathml, which writes the formulas: pip install cpbench[docs]") from cause
    return convert
