"""The text of `cpbench --help`, made without click, whose import takes twice as long as everything else."""

from __future__ import annotations

import os

from cpbench.foundation.extensions import commands as added
from cpbench.foundation.extensions import summary

INTRODUCTION = (
    "Benchmark solvers of complementarity and frictional-contact problems, and convert the problems.",
    "`cpbench run` without arguments compares solvers on small built-in problems, within a minute.",
)
OPTIONS = {
    "--version": "Show the version and exit.",
    "--plugin FILE": "Plugin to load: a Python file, or a TOML file that declares solvers. Repeatable.",
    "-h, --help": "Show this message and exit.",
}
COMMANDS = {
    "run": "Run every reachable solver on every problem, judge the answers, write the report.",
    "solve": "Solve one problem, and print the answer and what it is worth; or all solutions of a small one.",
    "sweep": "Solve a problem for several values of a parameter, such as the coefficient of friction.",
    "convert": "Convert a problem to another formulation; the file can lift answers back.",
    "lift": "Carry an answer to a converted problem back to its source.",
    "verify": "Measure an answer on a problem, or judge the stored answers of a results file again.",
    "info": "Show the contents of a problem file, and measured facts about its matrices.",
    "show": "Show a problem in numbers or as block structure, with its equations; also as LaTeX.",
    "plot": "Draw a figure of a run (profile, pairs, scaling, ...) or of a problem (friction cone, contacts, ...).",
    "graph": "Show the conversions between formulations, as text or as a drawing, or check them all.",
    "route": "Show how a problem reaches a formulation, or why it cannot.",
    "list": "List formulations, conversions, solvers, formats or problems.",
    "pack": "Make a problem file from matrices and vectors.",
    "report": "Write the report of a results file: HTML, Markdown and figures, or LaTeX.",
    "compare": "Compare two results files, or two builds: report regressions, and differences too small to call.",
    "results": "Merge, import or export results, or keep outcomes as text for version control (baseline).",
    "collection": "Add the problem files that others publish, and check them.",
    "generate": "Write the built-in problems again from their formulas, or check them; or simulate a scene.",
    "new": "Write a plugin that works: a solver in some language, a conversion or problems.",
    "check": "Run the conformance checks on a plugin.",
    "doctor": "Say what works on this machine, and how to install what does not.",
}
RESULT_COMMANDS = {
    "baseline": "Keep the outcomes of a run as text for version control, and show the changes in a later run.",
    "import": "Judge answers that were computed elsewhere, and put them into a results file.",
    "merge": "Put the rows of several results files into one.",
    "export": "Write the rows or the answers of a results file to other formats.",
}
"""Commands of `cpbench results`, which packages may add to; each is also found by its name alone, as it was before."""
RESULTS = "results"


def help_text() -> str:
    """Return it for the width of the terminal, at most 78 columns and at least 50, as click does for the commands."""
    try:
        columns = int(os.environ.get("COLUMNS") or os.get_terminal_size().columns)
    except (OSError, ValueError):  # no terminal
        columns = 80
    width = max(min(columns, 80) - 2, 50)
    listed = COMMANDS | {name: summary(entry) for name, entry in added().items() if name not in COMMANDS}
    blocks = ["Usage: cpbench [OPTIONS] COMMAND [ARGS]..."]
    blocks += ["\n".join(f"  {line}" for line in _wrapped(paragraph, width - 2)) for paragraph in INTRODUCTION]
    return "\n\n".join([*blocks, _table("Options", OPTIONS, width), _table("Commands", listed, width)])


def _table(title: str, rows: dict[str, str], width: int) -> str:
    """Return names and their descriptions in two columns."""
    first = max(map(len, rows)) + 4
    lines = [f"{title}:"]
    for name, description in rows.items():
        head, *others = _wrapped(description, width - first)
        lines += [f"  {name}".ljust(first) + head, *(" " * first + line for line in others)]
    return "\n".join(lines)


def _wrapped(text: str, width: int) -> list[str]:
    """Return the lines of a text; `textwrap` would import `re`."""
    lines: list[str] = []
    for word in text.split():
        if lines and len(lines[-1]) + 1 + len(word) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines
