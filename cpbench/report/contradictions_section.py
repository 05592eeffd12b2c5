"""The section of a report about contradictions, which comes before everything that rests on the rows."""

from __future__ import annotations

from collections.abc import Iterator

from cpbench.analysis.contradictions import Contradiction
from cpbench.report.run import Run
from cpbench.report.text import counted, plain, table

EXPLAINED = (
    "Rows on one problem that cannot all be right: a solver is wrong, or the verdict. *Existence*: a row claims "
    "that there is no solution, beside a verified answer. *Objective*: verified answers of a convex program with "
    "different objectives. *Solution*: different verified answers where the solution is unique. *Verdict*: answers "
    "that are the same to rounding with different verdicts, or rejected although different methods have the same."
)
HEAD = ("problem", "kind", "what contradicts what", "certificates")


def contradictions(run: Run, most: int | None = None) -> Iterator[str]:
    """Yield the contradictions, at most so many of them; nothing where there is none."""
    conflicts = run.contradictions
    if not conflicts:
        return
    yield f"## {counted(len(conflicts), 'contradiction').capitalize()}"
    yield EXPLAINED
    yield table(HEAD, ([plain(cell) or "—" for cell in cells(one)] for one in conflicts[:most]))
    if most is not None and len(conflicts) > most:
        yield f"{len(conflicts) - most} more are in the details."


def cells(one: Contradiction) -> tuple[str, str, str, str]:
    """Return a contradiction in the columns of HEAD."""
    return one.problem, one.kind, one.words, one.arbitration
