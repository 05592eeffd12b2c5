"""Paper for single figures of runs: plain text everywhere, a legend beside the curves, numbers with their units."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from cpbench.analysis.metrics import Metric
from cpbench.report import canvas, legend
from cpbench.report.chosen import SelectedRows
from cpbench.report.figure_kinds import Drawing
from cpbench.report.text import number, one_line, seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINES = 20
"""The most lines of a legend beside curves."""


@contextmanager
def drawing() -> Generator[None]:
    """Draw in the style of these figures: as `canvas.drawing`, but a label is text whatever dollar signs it has."""
    import matplotlib

    with matplotlib.rc_context({**canvas.STYLE, "text.parse_math": False}):
        yield


def with_legend(curves: int, least: float = 2.9, notes: int = 3) -> tuple[Figure, Axes]:
    """Create a figure two columns wide with axes and room for the legend of so many curves beside them."""
    figure = canvas.page(canvas.PAGE, max(least, legend.height(curves, notes, LINES) + 0.3), constrained=True)
    return figure, figure.subplots()


def drawn(figure: Figure, title: str, guide: str, chosen: SelectedRows) -> Drawing:
    """Return the figure with its words and its scope; no character of them starts a formula."""
    words = (title, f"{guide} {chosen.conditions()}", chosen.scope())
    return Drawing(figure, *(one_line(text).replace("$", r"\$") for text in words))


def amount(value: float, metric: Metric) -> str:
    """Format a cost with its unit.

    >>> from cpbench.analysis.metrics import METRICS
    >>> amount(0.02, METRICS["time"]), amount(3e6, METRICS["memory"]), amount(40.0, METRICS["iterations"])
    ('20 ms', '3 MB', '40')
    """
    if metric.unit == "s":
        return seconds(value)
    if metric.unit == "byte":
        return f"{value / 1e6:.3g} MB" if value < 1e9 else f"{value / 1e9:.3g} GB"
    return f"{value:g}" if value < 1e5 else number(value)


def word(metric: Metric) -> str:
    """Return the name of a metric in a sentence.

    >>> from cpbench.analysis.metrics import METRICS, metric
    >>> word(METRICS["solve"]), word(metric("counter:pivots")), word(METRICS["time"])
    ('time of the solve alone', 'number of pivots', 'time')
    """
    known = {
        "time": "time",
        "solve": "time of the solve alone",
        "cpu": "processor time",
        "reported": "time by its own account",
        "memory": "memory",
    }
    return known.get(metric.name, f"number of {metric.name.removeprefix('counter:')}")
