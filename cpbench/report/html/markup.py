"""Pieces of HTML. Whatever comes from a table is text in it: no name can become markup or an attribute."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape, unescape
from typing import Any


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def text(value: Any) -> Markup:
    """Return `value` as HTML, unless it is.

    >>> text("<script>alert(1)</script>"), text(Markup("<b>bold</b>"))
    ('&lt;script&gt;alert(1)&lt;/script&gt;', '<b>bold</b>')
    """
    if isinstance(value, Markup):
        return value
    return Markup(escape("".join(c if c.isprintable() else " " for c in str(value))))


def element(name: str, *children: Any, **attributes: str) -> Markup:
    """Return an element; an attribute's trailing `_` is dropped, an inner one is a hyphen.

    >>> element("p", "a < b", class_="note", data_x='"')
    '<p class="note" data-x="&quot;">a &lt; b</p>'
    """
    attribute_text = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(value)}"' for key, value in attributes.items()
    )
    return Markup(f"<{name}{attribute_text}>{''.join(text(child) for child in children)}</{name}>")


def code(value: Any) -> Markup:
    return element("code", value)


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[Any]], right: Iterable[int] = ()) -> Markup:
    """Return a table in a box that scrolls; the first column names its row, the columns `right` are numbers."""
    numbers = set(right)

    def cell(name: str, k: int, value: Any, **given: str) -> Markup:
        return element(name, value, **given, **({"class_": "right"} if k in numbers else {}))

    top = element("tr", *(cell("th", k, value, scope="col") for k, value in enumerate(head)))
    body = [
        element("tr", *(cell("td", k, v) if k else cell("th", k, v, scope="row") for k, v in enumerate(row)))
        for row in rows
    ]
    whole = element(
        "table",
        element("caption", caption, class_="visually-hidden"),
        element("thead", top),
        element("tbody", *body),
    )
    return element("div", whole, class_="scroll", tabindex="0", role="region", aria_label=caption)


def prose(markdown: str, caption: str = "") -> Markup:
    """Return the HTML of Markdown as sections write it: headings, tables, lists, and paragraphs with bold, emphasis and
    code. `caption` names a table that stands under no heading.

    >>> prose("**A.** *b* `c|d`\\n<e> &lt;f&gt; \\\\*g\\\\*")
    '<p><strong>A.</strong> <em>b</em> <code>c|d</code> &lt;e&gt; &lt;f&gt; *g*</p>'
    >>> prose("- a\\n- b")
    '<ul><li>a</li><li>b</li></ul>'
    """
    made: list[Markup] = []
    for block in re.split(r"\n\s*\n", markdown.strip()):
        lines = block.split("\n")
        if block.startswith("#"):
            marks, _, caption = block.partition(" ")
            made.append(element(f"h{len(marks)}", _inline(caption)))
        elif block.startswith("|"):
            head, rule, *rows = (_cells(line) for line in lines)
            right = [k for k, mark in enumerate(rule) if mark.endswith(":")]
            made.append(table(caption, [*map(_inline, head)], [[*map(_inline, row)] for row in rows], right))
        elif block.startswith("- "):
            made.append(element("ul", *(element("li", _inline(item)) for item in block[2:].split("\n- "))))
        else:
            made.append(element("p", _inline(" ".join(lines))))
    return Markup("\n".join(made))


_CODE = r"(?P<ticks>`+)(?P<code>.+?)(?P=ticks)"
_INSIDE = r"(?:\\.|`[^`]*`|[^*\\])+?"
_PIECE = re.compile(rf"{_CODE}|\\(?P<escaped>.)|\*\*(?P<strong>{_INSIDE})\*\*|\*(?P<em>{_INSIDE})\*")


def _inline(text: str) -> Markup:
    """Return running text. Outside of code an entity is the character that it stands for; each is escaped here."""
    made: list[str] = []
    at = 0
    for piece in _PIECE.finditer(text):
        made.append(escape(unescape(text[at : piece.start()]), quote=False))
        at = piece.end()
        if piece["code"]:
            made.append(code(piece["code"].strip() if len(piece["ticks"]) > 1 else piece["code"]))
        elif piece["escaped"]:
            made.append(escape(piece["escaped"], quote=False))
        else:
            name = "strong" if piece["strong"] else "em"
            made.append(element(name, _inline(piece[name])))
    return Markup("".join([*made, escape(unescape(text[at:]), quote=False)]))


def _cells(line: str) -> list[str]:
    return [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
