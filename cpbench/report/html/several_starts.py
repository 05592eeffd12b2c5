"""Problems that were started from several points, on the page: which solver finds which solution from where."""

from __future__ import annotations

from collections.abc import Iterator

from cpbench.analysis.multi_start import ReachedSolutions, solutions
from cpbench.report.html.markup import Markup, element, prose, table
from cpbench.report.multi_start_section import GUIDE, rounded, summary
from cpbench.report.run import Run


def several_starts(run: Run) -> Iterator[Markup]:
    """Yield a table a problem, solver by start, with the number of the solution; nothing where no problem has
    several.
    """
    found = list(solutions(run.read, run.answers))
    if not found:
        return
    yield element("p", GUIDE)
    for one in found:
        yield element("h3", one.problem)
        yield prose(f"{summary(one)}.")
        lines = [element("li", f"{k}: {rounded(x)}") for k, x in enumerate(one.solutions, start=1)]
        yield element("ul", *lines, class_="scope")
        rows = ([label, *(_cell(one, start, label) for start in one.starts)] for label in _most_first(one))
        yield table(f"{one.problem}: solutions by start", ["solver", *one.starts], rows)


def _most_first(one: ReachedSolutions) -> list[str]:
    """Sort the labels, those that solve from most starts first."""
    count = {label: sum(1 for (_, of) in one.place if of == label) for label in one.labels}
    return sorted(one.labels, key=lambda label: (-count[label], label))


def _cell(one: ReachedSolutions, start: str, label: str) -> str:
    """Format the number of the solution, or the status without one."""
    place = one.place.get((start, label))
    return f"solution {place}" if place else one.status.get((start, label), "—").replace("_", " ")
