"""The page of motions with a closed form, made from the table that `benchmarks/motion.py` measured."""

from __future__ import annotations

import csv
import inspect
from collections.abc import Sequence
from pathlib import Path

from page_parts import table

from cpbench_problems.scenes.motions import DT, MOTIONS

FOLDER = Path(__file__).resolve().parents[2] / "reports/motion"
INTRODUCTION = f"""# Does the motion come out right?

{{answer}}

![Error of the motion over the largest error of a step](../assets/motion.svg)

Five scenes whose motion has a closed form, moved by Moreau and Jean's time stepping with steps of {DT:g} s. Each solver
solves the contact problem of each step, at three tolerances. The time stepping follows the closed forms to rounding
where all steps are solved exactly, so that the error at the end is the solver's alone. It is the largest distance of a
body from its closed form, over the longest way that a body goes. Beside it, in brackets, stands the largest error of a
step, as [the verdict](verdict.md) measures it, with a star where a step misses the tolerance. A dash: a step had no
answer, and the bodies could not move on."""
OUTLOOK = """## How to repeat it

`python benchmarks/motion.py FOLDER` measures the table and draws the figure; `--solver NAME` takes others.
`cpbench collection scene NAME -o FILE` writes scenes that move in the same way (towers, arches, chains, heaps, ...) as
sequences of contact problems."""
ROUNDING = 1e-10
"""Errors of motions above this are no rounding of the time stepping."""
FACTOR = 10.0
"""A motion whose error is above this times the tolerance is named in the first lines."""


def page() -> str:
    """Return the page: the answer, the figure, a table a scene with its formula, and how to repeat it."""
    with (FOLDER / "table.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    parts = [INTRODUCTION.format(answer=_answer(rows))]
    for make in MOTIONS:
        motion = make()
        found = [row for row in rows if row["scene"] == motion.scene.name]
        text = (inspect.getdoc(make) or "").removeprefix("Build ")
        parts += [f"## {motion.scene.name.capitalize()}", text[:1].upper() + text[1:], _table(found)]
    return "\n\n".join([*parts, OUTLOOK])


def _answer(rows: Sequence[dict[str, str]]) -> str:
    """Say how far the motions are right where all steps meet the tolerance, and name those that are not."""
    solved = [row for row in rows if row["missed"] == "0" and row["message"] == ""]
    right = [row for row in solved if float(row["motion"]) <= FACTOR * float(row["tolerance"])]
    far = [row for row in solved if row not in right]
    others = [row for row in rows if row not in solved]
    lines = [
        f"Yes, where each step is solved to the tolerance: {len(right)} of {len(solved)} such motions are right to "
        f"{FACTOR:g} times the tolerance."
    ]
    seen = [row for row in solved if float(row["motion"]) > ROUNDING]
    if seen:
        most = max(seen, key=lambda row: float(row["motion"]) / float(row["residual"]))
        times = float(most["motion"]) / float(most["residual"])
        lines.append(
            f"But the error of a motion may be {times:.0f} times the largest error of a step, as for "
            f"`{most['solver']}` in the scene {most['scene']}: a step is measured against all that acts in it."
        )
    if far:
        worst = max(far, key=lambda row: float(row["motion"]) / float(row["tolerance"]))
        lines.append(
            f"The farthest of the other {len(far)} is that of `{worst['solver']}` in the scene {worst['scene']}: "
            f"{float(worst['motion']):.1e} at a tolerance of {float(worst['tolerance']):g}."
        )
    names = sorted({row["solver"] for row in others})
    if others:
        listed = ", ".join(f"`{name}`" for name in names)
        lines.append(f"In {len(others)} of {len(rows)} runs a step misses the tolerance ({listed}).")
    return " ".join(lines)


def _table(rows: Sequence[dict[str, str]]) -> str:
    tolerances = list(dict.fromkeys(row["tolerance"] for row in rows))
    solvers = dict.fromkeys(row["solver"] for row in rows)
    cells = {(row["solver"], row["tolerance"]): _cell(row) for row in rows}
    body = ([f"`{name}`", *(cells.get((name, tolerance), "not run") for tolerance in tolerances)] for name in solvers)
    return table(["solver", *(f"{float(tolerance):g}" for tolerance in tolerances)], body)


def _cell(row: dict[str, str]) -> str:
    if row["message"]:
        return "—"
    star = "" if row["missed"] == "0" else "\\*"
    return f"{float(row['motion']):.1e} ({float(row['residual']):.1e}{star})"
