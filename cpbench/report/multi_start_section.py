"""The section about problems that were started from several points: which solver finds which solution from where."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpbench.analysis.multi_start import SAME, ReachedSolutions, solutions
from cpbench.foundation.matrices import Vector
from cpbench.report.run import Run
from cpbench.report.text import code, counted, listed, plain, table

NUMBERS = 6
"""The most numbers of a solution that are printed."""
SOLVERS = 12
"""The most solvers that are named in a cell."""

GUIDE = (
    f"Answers that differ by at most {SAME:g} of their size are one solution; the one found most often is number 1. "
    "Every answer was verified."
)


def multi_start(run: Run, most: int | None = None, *, by_solver: bool = False) -> Iterator[str]:
    """Yield a table a problem, start by solution or solver by start; nothing where no problem was started from several
    points of its file.
    """
    reached = list(solutions(run.read, run.answers))
    if not reached:
        return
    yield f"## Several starts ({counted(len(reached), 'problem')})"
    yield GUIDE
    for one in reached[:most]:
        yield f"**{plain(one.problem)}**: {summary(one)}."
        named = [f"solution {k}: {rounded(x)}" for k, x in enumerate(one.solutions, start=1)]
        if by_solver:
            yield "\n".join(f"- {line}" for line in named)
            rows = ([code(label), *(_status(one, start, label) for start in one.starts)] for label in _most_first(one))
            yield table(["solver", *map(plain, one.starts)], rows)
        else:
            yield table(["start", *named, "not solved"], (_line(one, start) for start in one.starts))
    if most is not None and len(reached) > most:
        yield f"{len(reached) - most} more problems are in the details and on the page."


def _most_first(one: ReachedSolutions) -> list[str]:
    """Sort the labels, those that solve from most starts first."""
    count = {label: sum(1 for (_, of) in one.place if of == label) for label in one.labels}
    return sorted(one.labels, key=lambda label: (-count[label], label))


def _status(one: ReachedSolutions, start: str, label: str) -> str:
    """Return the number of the solution that a solver reached from a start, or the status without one."""
    number = one.place.get((start, label))
    return f"solution {number}" if number else plain(one.status.get((start, label), "—").replace("_", " "))


def summary(one: ReachedSolutions) -> str:
    """Count the solutions reached, and name the solvers that reached all of them.

    A solver that finds each from some start shows them all if all starts are tried.
    """
    sentence = f"{counted(len(one.solutions), 'solution')} found from {counted(len(one.starts), 'start')}"
    if len(one.solutions) < 2:
        return sentence
    reached = {label: {n for (_, of), n in one.place.items() if of == label} for label in one.labels}
    all_of_them = [label for label in one.labels if len(reached[label]) == len(one.solutions)]
    return f"{sentence}; all of them by {listed(all_of_them, 4)}" if all_of_them else f"{sentence}; no solver finds all"


def rounded(x: Vector) -> str:
    """Format a solution in a few numbers.

    >>> rounded(np.array([1.0, 0.0, 1.2247448]))
    '(1, 0, 1.22)'
    """
    shown = ", ".join(f"{value:.3g}" for value in np.round(x[:NUMBERS], 9) + 0.0)
    return f"({shown}{', …' if x.size > NUMBERS else ''})"


def _line(one: ReachedSolutions, start: str) -> list[str]:
    """Return the solvers that reached each solution from a start, and those that reached none."""
    reached = one.reached(start)
    idle = [label for label in one.labels if (start, label) in one.status and not one.place.get((start, label))]
    cells = [_solvers_cell(reached.get(k, [])) for k in range(1, len(one.solutions) + 1)]
    return [code(start), *cells, _solvers_cell(idle)]


def _solvers_cell(labels: list[str]) -> str:
    return f"{len(labels)}: {listed(labels, SOLVERS)}" if labels else "—"
