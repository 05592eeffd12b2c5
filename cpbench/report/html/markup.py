"""Pieces of HTML. Whatever comes from a table is text in it: no name can become markup or an attribute."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from cpbench.report.text import one_line


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


def prose(markdown: str) -> Markup:
    """Return paragraphs of our own running Markdown: bold, emphasis, code.

    >>> prose("**A.** *b* `c`\\n<d>")
    '<p><strong>A.</strong> <em>b</em> <code>c</code> &lt;d&gt;</p>'
    """
    found: list[str] = []
    for paragraph in re.split(r"\n\s*\n", markdown.strip()):
        line = escape(one_line(paragraph), quote=False)
        line = re.sub(r"`([^`]+)`", r"<code>\1</code>", line)
        line = re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", line)
        line = re.sub(r"\*([^*]+)\*", r"<em>\1</em>", line)
        found.append(f"<p>{line}</p>")
    return Markup("\n".join(found))
