"""A timeline as text: columns for a terminal, Markdown, CSV, JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

import pandas as pd

from cpbench.advice.timeline import COLUMNS
from cpbench.report.text import number, one_line, plain
from cpbench.report.text import table as markdown_table

HEAD = (
    *("date", "file", "version", "cpbench", "pairs", "solved", "wrong", "crash"),
    *("time", "of", "machine's own", "machine"),
)
RIGHT = (4, 5, 6, 7, 8, 9, 10)
GUIDE = (
    "time: geometric mean of time over that of the label's first run on the same machine, over the pairs solved in "
    "both (of); machine's own: the same for the reference solve of the two runs, which tells how much the machine "
    "drifted. A run on another machine begins anew (first)."
)


def columns(points: pd.DataFrame) -> list[str]:
    """Return a block of aligned lines a label."""
    lines: list[str] = []
    for label, rows in points.groupby("label", sort=True):
        cells = [list(HEAD), *_cells(rows)]
        widths = [max(len(row[k]) for row in cells) for k in range(len(HEAD))]
        lines += ["", str(label)]
        for row in cells:
            padded = [
                c.rjust(w) if k in RIGHT else c.ljust(w) for k, (c, w) in enumerate(zip(row, widths, strict=True))
            ]
            lines.append("  " + "  ".join(padded).rstrip())
    return [*lines[1:], "", GUIDE]


def markdown(points: pd.DataFrame, title: str) -> str:
    """Write a table a label."""
    parts = [f"# {plain(title)}", GUIDE]
    for label, rows in points.groupby("label", sort=True):
        parts += [f"## {plain(label)}", markdown_table(HEAD, [[plain(c) for c in row] for row in _cells(rows)], RIGHT)]
    return "\n\n".join(parts) + "\n"


def as_csv(points: pd.DataFrame) -> str:
    """Write all columns; unknown values are empty."""
    return points.to_csv(index=False, lineterminator="\n")


def as_json(points: pd.DataFrame) -> str:
    """Write a list of objects; unknown values are null."""
    clean = points.astype(object).where(points.notna(), None)
    return json.dumps(clean[list(COLUMNS)].to_dict("records"), indent=1, ensure_ascii=False) + "\n"


def _cells(rows: pd.DataFrame) -> Sequence[list[str]]:
    found: list[list[str]] = []
    for row in rows.to_dict("records"):
        begins = row["base"] == row["file"]
        found.append(
            [
                str(row["date"])[:16].replace("T", " "),
                one_line(row["file"]),
                one_line(row["version"]) or "—",
                one_line(row["cpbench"]) or "—",
                *(str(row[name]) for name in ("pairs", "solved", "wrong", "crash")),
                "first" if begins else _factor(row["ratio"]),
                "" if begins else str(row["common"]),
                "" if begins else _factor(row["reference"]),
                one_line(row["machine"]),
            ]
        )
    return found


def _factor(value: float) -> str:
    return number(value) if math.isnan(value) else f"× {value:.2f}"
