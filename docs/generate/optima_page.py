"""The page of proved optima, from the table that `cpbench certify --all` wrote (`reports/optima/table.csv`)."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from page_parts import table

FOLDER = Path(__file__).resolve().parents[2] / "reports/optima"
KNOWN = ("proved", "enclosed", "infeasible", "unbounded")
HEAD = ("problem", "formulation", "unknowns", "level", "optimal value", "solution", "seconds")
INTRODUCTION = """# Proved optima

{answer}

Solutions are read off an answer and proved in rational arithmetic, of the numbers in the files as they are: the value
of a quadratic program lies between two neighbouring doubles (twelve digits are shown). *Proved*: an exact solution is
known; *enclosed*: a box provably holds one; *stationary*: only the conditions of first order are proved, of a program
that is not convex; *open*: none of these, and the table says why. A program is convex *exactly* where its matrix is
shown to be positive semidefinite in rational arithmetic, else to rounding. "only": the solution is the only one, by
the fact in brackets."""
REPEAT = """## How to repeat it

`cpbench certify --all FOLDER -o OPTIMA --published published.csv` makes the table of the problems in a folder, with a
certificate each, and goes on where it was interrupted. `python cpbench_lab/certificates/checker FILE...` proves
certificates again, and imports nothing of cpbench. The files of the problems belong to others and are not here: the
sets of Maros and Mészáros, of MPC, CUTEst, Siconos and FCLIB."""


def page() -> str:
    """Return the page: how many are proved, published values that differ, and all rows by set."""
    with (FOLDER / "table.csv").open(newline="", encoding="utf-8") as file:
        rows = [{name: value.removeprefix("'") for name, value in row.items()} for row in csv.DictReader(file)]
    rows = [row for row in rows if row["level"] != "unreadable"]
    parts = [INTRODUCTION.format(answer=_answer(rows)), _published(rows)]
    for name in sorted({_set(row) for row in rows}):
        own = sorted((row for row in rows if _set(row) == name), key=lambda row: row["problem"].lower())
        parts += [f"## {name}", table(HEAD, (_cells(row) for row in own))]
    return "\n\n".join([*parts, REPEAT])


def _set(row: dict[str, str]) -> str:
    return str(Path(row["problem"]).parent)


def _answer(rows: Sequence[dict[str, str]]) -> str:
    known = Counter(_set(row) for row in rows if row["level"] in KNOWN)
    every = Counter(map(_set, rows))
    shares = ", ".join(f"{known[name]} of {every[name]} in {name}" for name in sorted(every))
    return f"Of {len(rows)} problems of others {sum(known.values())} are settled by a proof: {shares}."


def _published(rows: Sequence[dict[str, str]]) -> str:
    """Return the published values that are off, the farthest first, and how many are right."""
    compared = [row for row in rows if row["off"]]
    off = sorted((row for row in compared if float(row["off"]) > 1), key=lambda row: -float(row["off"]))
    told = (
        f"## Published values that differ\n\nOf {len(compared)} optimal values in the table of Maros and Mészáros (by "
        f"BPMPD) {len(compared) - len(off)} are right to their last digit or one unit of it; these are not:"
    )
    cells = (
        (
            f"`{Path(row['problem']).stem}`",
            row["published"],
            f"{float(row['low']):.12g}",
            f"{float(row['off']):.3g}",
            _convex(row),
        )
        for row in off
    )
    return f"{told}\n\n" + table(("problem", "published", "proved", "units of the last digit", "convex"), cells)


def _convex(row: dict[str, str]) -> str:
    return f"exactly ({row['convex']})" if row["convex"] else "to rounding"


def _cells(row: dict[str, str]) -> tuple[str, ...]:
    value = "" if not row["low"] or math.isnan(float(row["low"])) else f"{float(row['low']):.12g}"
    only = f"only ({row['unique']})" if row["unique"] else ""
    said = row["text"] if row["level"] == "open" or "solutions" in row["text"] else ""
    solution = "; ".join(filter(None, (only, said)))
    seconds = f"{float(row['seconds']):.3g}"
    return f"`{Path(row['problem']).name}`", row["formulation"], row["unknowns"], row["level"], value, solution, seconds
