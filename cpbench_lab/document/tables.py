"""Tables of the document (booktabs): every number is a call of its macro, so that text, table and paper agree."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from cpbench.analysis.cautions import Footnote, marks
from cpbench.report.figures import MARKS
from cpbench.report.tex import number
from cpbench.report.text import seconds
from cpbench_lab.document.escape import label, text
from cpbench_lab.document.macros import Macros

LINES = 42
"""Rows of a table that fit on a page."""


def table(head: Sequence[str], rows: Iterable[Sequence[str]], spec: str, caption: str) -> str:
    """Write a floating table of cells that are TeX already, or several where it is longer than a page."""
    return "\n\n".join(_tables(head, list(rows), spec, caption))


def _tables(head: Sequence[str], rows: Sequence[Sequence[str]], spec: str, caption: str) -> Iterator[str]:
    for start in range(0, max(1, len(rows)), LINES):
        body = "".join(f"  {' & '.join(row)} \\\\\n" for row in rows[start : start + LINES])
        heading = caption if not start else "Continued."
        yield (
            f"\\begin{{table}}[!htbp]\n\\caption{{{heading}}}\n\\centering\\scriptsize\\setlength{{\\tabcolsep}}{{3pt}}\n"
            f"\\begin{{tabular}}{{@{{}}{spec}@{{}}}}\n\\toprule\n  {' & '.join(head)} \\\\\n\\midrule\n{body}"
            f"\\bottomrule\n\\end{{tabular}}\n\\end{{table}}"
        )


def solved_table(
    macros: Macros, words: tuple[str, ...], counts: Any, caption: str, notes: Sequence[Footnote] = ()
) -> str:
    """Write what each label solved and how fast, of `analysis.summary.solve_counts`; define a macro for each number."""
    rows: list[list[str]] = []
    for r in counts.itertuples(index=False):
        named = (*words, r.label)
        cells = {
            "solved": str(r.solved),
            "stationary": str(r.stationary),
            "false": str(r.false),
            "fastest": str(r.fastest) if r.ranked else "---",
            "median": duration(r.median),
            "mean": duration(r.mean) if r.solved else "---",
        }
        macros.define((*named, "planned"), str(r.planned))
        sign = f" {text(MARKS[r.kind])}" if r.kind in MARKS else ""
        row = [
            label(r.label) + sign + text(marks(r.label, notes)),
            *(macros.define((*named, word), value) for word, value in cells.items()),
        ]
        rows += [row] if r.solved or r.stationary or r.false else []
    rest = len(counts) - len(rows)
    caption += f" Not shown: {rest} that solved none." if rest else ""
    caption += "".join(f" {text(f'{note.mark} {note.sentence}')}" for note in notes)
    head = ["solver", "solved", "stationary", "false", "fastest", "median", "mean"]
    return table(head, rows, r">{\raggedright\arraybackslash}p{0.3\columnwidth}rrrrrr", caption)


def duration(value: float) -> str:
    r"""Write a time with its unit, which is never on another line.

    >>> duration(0.00123), duration(4.5e-5), duration(math.inf), duration(math.nan)
    ('1.23~ms', '45~\\ensuremath{\\mu}s', '\\ensuremath{\\infty}', '---')
    """
    return text(seconds(value)).replace(" ", "~") if not math.isnan(value) else "---"


def small(value: float) -> str:
    r"""Write a tolerance or a limit in math mode.

    >>> small(1e-6), small(10.0)
    ('$10^{-6}$', '$10$')
    """
    return f"${number(value)}$"
