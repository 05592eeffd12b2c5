"""Blocks to HTML."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from html import escape
from typing import Any

from lecture import numbers
from lecture.blocks import (
    Aside,
    Block,
    Data,
    Figure,
    Fold,
    Formula,
    Heading,
    Html,
    Section,
    Table,
    Text,
    Try,
)
from lecture.mathml import mathml
from lecture.references import REFERENCES

_PIECES = re.compile(
    r"\$(?P<math>[^$]+)\$|`(?P<code>[^`]+)`|\*(?P<term>[^*]+)\*|«(?P<name>[^»]+)»|\[\^(?P<cite>[^\]]+)\]"
)


def inline(template: str, values: Mapping[str, Any]) -> str:
    """HTML of a template; every character outside the marks stands for itself.

    >>> inline("a < b at «x» by `f`", {"x": 0.5})
    'a &lt; b at <data>0.5</data> by <code>f</code>'
    """

    def piece(found: re.Match[str]) -> str:
        kind = found.lastgroup or ""
        inside = found[kind]
        match kind:
            case "math":
                return mathml(inside)
            case "code":
                return f"<code>{_computed(values[inside[1:-1]]) if inside[0] == '«' else escape(inside)}</code>"
            case "term":
                return f"<em>{escape(inside)}</em>"
            case "name":
                return _computed(values[inside])
            case _:
                number = list(REFERENCES).index(inside) + 1
                return f'<a class="cite" href="#ref-{inside}" aria-label="reference {number}">[{number}]</a>'

    parts: list[str] = []
    at = 0
    for found in _PIECES.finditer(template):
        parts += [_plain(template[at : found.start()], at > 0), piece(found)]
        at = found.end()
    return "".join([*parts, _plain(template[at:], at > 0)])


def _plain(words: str, after: bool) -> str:
    """Escaped words; no line may end between a formula and the mark that follows it."""
    joiner = "&NoBreak;" if after and words[:1] in (".", ",", ";", ":", ")") else ""
    return joiner + escape(words, quote=False)


def _computed(value: Any) -> str:
    """A value that was computed, marked as such."""
    return f"<data>{value.markup if isinstance(value, Html) else numbers.value(value)}</data>"


def section(one: Section) -> str:
    """A section with its heading and blocks."""
    body = "\n".join(block(part) for part in one.blocks)
    return (
        f'<section id="{one.slug}" aria-labelledby="{one.slug}-title">\n'
        f'<h2 id="{one.slug}-title">{escape(one.title)}</h2>\n'
        f'<p class="lead">{inline(one.lead.template, one.lead.values)}</p>\n{body}\n</section>'
    )


def block(part: Block) -> str:
    """HTML of any block."""
    return _MAKERS[type(part)](part)


def _text(part: Text) -> str:
    return f"<p>{inline(part.template, part.values)}</p>"


def _heading(part: Heading) -> str:
    return f"<h3>{inline(part.title, {})}</h3>"


def _formula(part: Formula) -> str:
    """A display; every number of the lecture is a target of links."""
    tags = "".join(
        f'<a class="tag" id="eq-{k}" href="#eq-{k}" aria-label="equation {k}">({k})</a>' for k in part.equations
    )
    tags += f'<span class="tag">{inline(part.label, {})}</span>' if part.label else ""
    said = f' aria-label="Formula {", ".join(map(str, part.equations))}"' if part.equations else ' aria-label="Formula"'
    return (
        f'<div class="formula"><div class="scroll" role="group" tabindex="0"{said}>'
        f"{mathml(part.latex, block=True)}</div>"
        f'<div class="tags">{tags}</div></div>'
    )


def _data(part: Data) -> str:
    return f'<div class="data">{"".join(mathml(latex, block=True) for latex in part.parts)}</div>'


def _cell(cell: str | Html, values: Mapping[str, Any]) -> str:
    return cell.markup if isinstance(cell, Html) else inline(cell, values)


def _table(part: Table) -> str:
    head = "".join(f'<th scope="col">{inline(cell, {})}</th>' for cell in part.head)
    rows = "\n".join(
        f'<tr><th scope="row">{_cell(row[0], part.values)}</th>'
        + "".join(f"<td>{_cell(cell, part.values)}</td>" for cell in row[1:])
        + "</tr>"
        for row in part.rows
    )
    caption = inline(part.caption, part.values)
    return (
        f'<figure class="table"><div class="scroll" role="group" tabindex="0" aria-label="Table">'
        f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody></table></div>"
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _figure(part: Figure) -> str:
    caption = inline(part.caption.template, part.caption.values)
    return (
        f'<figure class="picture"><div class="plate" role="group" tabindex="0" aria-label="Figure">{part.svg}</div>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _try(part: Try) -> str:
    lines = "\n".join(escape(line) for line in part.lines)
    return f'<div class="try"><p>Try it</p><pre tabindex="0" aria-label="Commands"><code>{lines}</code></pre></div>'


def _aside(part: Aside) -> str:
    body = "\n".join(block(inner) for inner in part.blocks)
    return f'<aside aria-label="{escape(part.title)}"><h4>{escape(part.title)}</h4>\n{body}\n</aside>'


def _fold(part: Fold) -> str:
    lines = "\n".join(escape(line) for line in part.lines)
    return (
        f"<details><summary>{inline(part.title, {})}</summary>"
        f'<pre tabindex="0" aria-label="Mathematics">{lines}</pre></details>'
    )


_MAKERS: dict[type[Block], Callable[[Any], str]] = {
    Text: _text,
    Heading: _heading,
    Formula: _formula,
    Data: _data,
    Table: _table,
    Figure: _figure,
    Try: _try,
    Aside: _aside,
    Fold: _fold,
}
