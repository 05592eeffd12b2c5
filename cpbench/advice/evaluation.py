"""How good advice is for origins that were left out, and the table of measurements that is shipped."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cpbench import __version__
from cpbench.advice import evidence, validation
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.training_cases import TrainingCases, to_text
from cpbench.errors import CpbenchError
from cpbench.plain_text import columns
from cpbench.plurals import counted


def rates(known: TrainingCases, source: str) -> list[dict[Any, Any]]:
    """Return how often the advice is good for origins that were left out, a row a formulation and one for all.

    Raises CpbenchError where all problems are of one origin.
    """
    if len(set(known.origins)) < 2:
        raise CpbenchError(f"{source}: all problems are of one origin; there is nothing to leave out")
    return validation.rates(known, validation.evaluate(known)).to_dict("records")


def lines(
    rows: Sequence[Mapping[Any, Any]], known: TrainingCases, source: str, remarks: Sequence[str]
) -> Iterator[str]:
    """Yield the rates as a table, with what its columns mean and what the advice is worth."""
    yield (
        f"Each origin left out in turn, by {source}: solved, and within twice the time of the virtual best (from "
        f"{FLOOR:g} s). The estimate's own numbers are chosen each time from other origins."
    )
    head = ("", "", "", "advice", "", "plain", "", "auto", "", "", "single", "", "")
    names = ("node", "problems", "origins", *("solved", "within") * 2, *("label", "solved", "within") * 2)
    table: list[tuple[str, ...]] = [head, names]
    for row in rows:
        numbers = [str(row[name]) for name in ("problems", "origins", "solved", "within", "plain_solved")]
        numbers.append(str(row["plain_within"]))
        for name in ("auto", "single"):
            numbers += [row[name], str(row[f"{name}_solved"]), str(row[f"{name}_within"])]
        table.append((row["node"], *numbers))
    yield from columns(table)
    yield "plain: the label best on the other origins of the node. auto: the automatic solver, 0 where none was run."
    yield "single: the label best on the node's own problems, which is known only afterwards."
    yield from _worth(rows[-1])
    if known.unsolved:
        yield f"without {counted(known.unsolved, 'problem')} that nobody solved: there is no virtual best"
    yield from (f"remark: {remark}" for remark in remarks)


def _worth(every: Mapping[Any, Any]) -> list[str]:
    """Return what the advice is worth beside simpler choices."""
    others = {
        "the label best on other origins": "plain_within",
        "always the automatic solver": "auto_within",
        "the best single label of each node, chosen in hindsight": "single_within",
    }
    found = [
        f"The advice is within twice the virtual best on {every['within']} of {counted(every['problems'], 'problem')}."
    ]
    for better, words in ((True, "That is better than"), (False, "That is not better than")):
        listed = [
            f"{what} ({every[name]})" for what, name in others.items() if (every["within"] > every[name]) == better
        ]
        if listed:
            found.append(f"{words} {' and '.join(listed)}.")
    return found


def write_table(table: Path, results: Sequence[Path]) -> Iterator[str]:
    """Write the table of what results came to, for `recommend` to go by; yields lines on what is in it.

    Raises CpbenchError where no problem was solved in them.
    """
    known, _ = evidence.read(results, False, False)
    if not known.cases:
        raise CpbenchError(f"{', '.join(map(str, results))}: nothing to make a table of: nobody solved anything")
    hidden = evidence.restricted(known.labels, results)
    text = to_text(known, hidden, f"cpbench {__version__}, {time.strftime('%Y-%m-%d')}")
    table.write_text(text, encoding="utf-8")
    sizes = counted(len(known.cases), "problem"), counted(len(known.labels) - len(hidden), "label")
    yield f"table: {table} ({', '.join(sizes)}, {len(text)} bytes)"
    if hidden:
        yield f"left out, for their figures may not be published: {', '.join(sorted(hidden))}"
    if known.unfinished:
        yield f"left out, for not all of their pairs were run: {counted(known.unfinished, 'problem')}"
