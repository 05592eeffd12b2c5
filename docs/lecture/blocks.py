"""What a section of the page is made of: frozen values without any layout.

Text is a template: `$...$` is LaTeX, backquotes hold code, *stars* mark a term, [^key] cites a reference, and «name»
is replaced by a computed value. A template has no computed number of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Html:
    """What is markup already: made by us, with nothing in it that came from outside unescaped."""

    markup: str


@dataclass(frozen=True)
class Text:
    """One paragraph, with the values of its «names»."""

    template: str
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Formula:
    """A display; `equations` are the lecture's numbers that it covers, `label`, a template, is one of ours."""

    latex: str
    equations: tuple[int, ...] = ()
    label: str = ""


@dataclass(frozen=True)
class Data:
    """Small formulas side by side, which flow over lines."""

    parts: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """Cells are templates or Html."""

    head: tuple[str, ...]
    rows: tuple[tuple[str | Html, ...], ...]
    caption: str
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Figure:
    """Inline SVG; `caption` is the reading guide, `alt` what a screen reader says of the picture."""

    svg: str
    caption: Text
    alt: str


@dataclass(frozen=True)
class Try:
    """Command lines on the files that go with the page."""

    lines: tuple[str, ...]


@dataclass(frozen=True)
class Aside:
    """A remark beside the text: a misprint that was mended, a trap."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Fold:
    """Lines behind a title that opens."""

    title: str
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Heading:
    """A part of a section."""

    title: str


Block = Text | Formula | Data | Table | Figure | Try | Aside | Fold | Heading


@dataclass(frozen=True)
class Section:
    """A section of the page: name in addresses, title, one sentence about it, its blocks."""

    slug: str
    title: str
    lead: Text
    blocks: tuple[Block, ...]


def text(template: str, **values: Any) -> Text:
    """A paragraph."""
    return Text(template, values)


def formula(latex: str, *equations: int, label: str = "") -> Formula:
    """A display with the lecture's numbers."""
    return Formula(latex, equations, label)


def table(head: Sequence[str], rows: Sequence[Sequence[str | Html]], caption: str, **values: Any) -> Table:
    """A table."""
    return Table(tuple(head), tuple(tuple(row) for row in rows), caption, values)


def aside(title: str, *blocks: Block) -> Aside:
    """A remark."""
    return Aside(title, blocks)
