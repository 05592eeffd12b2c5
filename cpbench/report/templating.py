"""Tables and templates: how the numbers and texts of a document are written as Markdown."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import jinja2
import pandas as pd

from cpbench.report.text import code, counted, cut, listed, number, one_line, plain, seconds

FORMS: Mapping[str, Callable[[Any], str]] = {
    "text": lambda value: plain(value) or "—",
    "blank": plain,
    "code": code,
    "codes": lambda labels: listed(labels, 4) or "—",
    "cell": plain,
    "count": str,
    "some": lambda value: str(value or "·"),
    "number": number,
    "seconds": seconds,
    "share": lambda value: "—" if math.isnan(value) else f"{value:.0%}",
    "power": lambda value: f"{value:.1e}" if math.isfinite(value) else "—",
}
"""How a value is written as Markdown, by the name of its form."""
AS_TEXT: Mapping[str, Callable[[Any], str]] = {**FORMS, **dict.fromkeys(("text", "blank", "code", "cell"), one_line)}
"""The same as plain text."""
WORDS = ("text", "blank", "code", "codes")
"""Forms of text; columns of all others are aligned to the right."""
_BAR = re.compile(r"(?<!\\)\|")


@dataclass(frozen=True)
class Table:
    """A table: its values, the form of each column by its heading, in their order, and what is said below it."""

    frame: pd.DataFrame
    forms: Mapping[str, str]
    note: str = ""

    @classmethod
    def of(cls, forms: Mapping[str, str], rows: Iterable[Sequence[Any]]) -> Table:
        """Return a table of rows of values."""
        return cls(pd.DataFrame(list(rows), columns=list(forms), dtype=object), forms)

    def __len__(self) -> int:
        return len(self.frame)

    def head(self, most: int) -> Table:
        """Return the first rows."""
        return Table(self.frame.head(most), self.forms, self.note)

    def cells(self, forms: Mapping[str, Callable[[Any], str]] = FORMS) -> list[list[str]]:
        """Return the cells as Markdown, or `AS_TEXT`."""
        columns = [[forms[form](value) for value in self.frame[name]] for name, form in self.forms.items()]
        return [list(row) for row in zip(*columns, strict=True)]

    @property
    def markdown(self) -> str:
        """The table as Markdown; its headings are Markdown already."""
        rule = "|".join("---" if form in WORDS else "---:" for form in self.forms.values())
        # in a table a bar ends the cell even inside a code span, unless a backslash stands before it
        lines = [" | ".join(_BAR.sub(r"\\|", cell) for cell in row) for row in self.cells()]
        return "\n".join([f"| {' | '.join(self.forms)} |", f"|{rule}|", *(f"| {line} |" for line in lines)])


def rendered(template: str, given: Mapping[str, Any], block: str = "") -> str:
    """Return a document made by a template of `report/templates`, or one block of it."""
    document = environment().get_template(template)
    parts = document.blocks[block](document.new_context(dict(given))) if block else [document.render(given)]
    return re.sub(r"\n{3,}", "\n\n", "".join(parts)).strip() + "\n"


@lru_cache(maxsize=1)
def environment() -> jinja2.Environment:
    """Return the templates of documents, with what writes names of a results file as text in them."""
    templates = jinja2.Environment(
        loader=jinja2.PackageLoader("cpbench.report"), trim_blocks=True, lstrip_blocks=True, autoescape=False,
        undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    templates.filters.update({"plain": plain, "code": code, "counted": counted, "cut": cut, "listed": listed})
    return templates
