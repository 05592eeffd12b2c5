"""Tables and long lines that fit the terminal they are shown in.

Into a file or a pipe nothing is folded: what is one row is one line there, for grep and for programs.
"""

from __future__ import annotations

import io
import os
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import click

from cpbench.foundation.text import on_one_line

NARROWEST, WIDEST = 40, 110


def width() -> int | None:
    """Return the characters of a line of the terminal (COLUMNS where set), None where the output goes elsewhere."""
    if not (sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdecimal()):
        return None
    return max(shutil.get_terminal_size().columns, NARROWEST)


def reading_width() -> int:
    """Return the width of lines of prose: the terminal's, at most WIDEST."""
    return min(width() or WIDEST, WIDEST)


def print_lines(lines: Iterable[str], err: bool = False) -> None:
    """Print lines one by one, to stderr where asked; a line feed or a control character in one of them is spelled out,
    since names of files and texts in them may have any."""
    for line in lines:
        click.echo(on_one_line(line), err=err)


def columns_of(rows: Sequence[Sequence[str]], right: Sequence[bool] = (), gap: int = 2) -> Iterator[str]:
    """Yield rows as lines, every column as wide as its widest cell, those that are `right` with blanks before it."""
    widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
    sides = [str.rjust if side else str.ljust for side in right or [False] * len(widths)]
    for row in rows:
        yield (" " * gap).join(side(cell, w) for side, cell, w in zip(sides, row, widths, strict=True)).rstrip()


def table(rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Yield rows as lines, every column as wide as its widest cell; in a terminal cells are folded so that all fit.

    >>> list(table([("lemke", "lcp", "pivots"), ("pgs", "lcp", "sweeps")]))
    ['lemke  lcp  pivots', 'pgs    lcp  sweeps']
    """
    rows = [tuple(map(on_one_line, row)) for row in rows]
    room = width()
    longest = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
    lines = list(columns_of(rows))
    if room is None or max(map(len, lines), default=0) <= room:
        yield from lines
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=None, show_header=False, padding=(0, 2, 0, 0), pad_edge=False)
    for column, long in enumerate(longest):
        grid.add_column(overflow="fold", no_wrap=column == 0 and long <= room // 2)  # names are to be copied
    for row in rows:
        grid.add_row(*map(Text, row))
    console = Console(file=io.StringIO(), width=room, color_system=None, highlight=False)
    with console.capture() as shown:
        console.print(grid)
    yield from (line.rstrip() for line in shown.get().splitlines())


def folded(line: str, hanging: int = 4) -> list[str]:
    """Return a line as several where the terminal is narrower, the later ones indented by `hanging` more blanks.

    >>> folded("solvers: lemke, psor")
    ['solvers: lemke, psor']
    """
    room = width()
    if room is None or len(line) <= room:
        return [line]
    indent = len(line) - len(line.lstrip())
    return textwrap.wrap(
        line.lstrip(),
        room,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent + hanging),
        break_on_hyphens=False,
    )


def fitted(lines: Iterable[str]) -> Iterator[str]:
    """Yield the lines, each folded where the terminal is narrower."""
    for line in lines:
        yield from folded(line) if len(line) >= NARROWEST else [line]


def replaced(path: Path, before: Iterable[Path]) -> str:
    """Return the path as text, with a word where it was there before."""
    return f"{path} (replaced)" if path in before else str(path)
