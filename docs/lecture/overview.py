"""The map: formulations and the conversions between them."""

from __future__ import annotations

from cpbench.formulations.base import formulations
from cpbench.graph import edges
from cpbench.report import canvas
from lecture import svg
from lecture.blocks import Figure, Section, text
from lecture.graph_map import GUIDE, graph_map


def section() -> Section:
    """How the sections hang together."""
    shown = [edge for edge in edges() if edge.source != edge.target]
    return Section(
        "map",
        "The map",
        text(
            "Formulations are places, conversions are roads. Each road is two-way: a problem goes there, its answer "
            "comes back.",
        ),
        (
            _map(),
            text(
                "There are «places» formulations and «roads» conversions between them; the sections below take every "
                "one. A promise comes with each: *equivalent* keeps the solutions, *necessary* keeps them among "
                "others, *approximate* errs by a knob, a *relaxation* drops a term.",
                places=len(formulations),
                roads=len(shown),
            ),
        ),
    )  # fmt: skip


def _map() -> Figure:
    """Boxes and arrows."""
    alt = "A map of formulations from global frictional contact to quadratic programs, with arrows for conversions"
    with canvas.drawing():
        drawn = svg.inline(graph_map(), "fig-map", alt)
    return Figure(drawn, text(GUIDE), alt)
