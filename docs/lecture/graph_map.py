"""The map: formulations as boxes, the conversions between them as arrows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from cpbench.formulations.base import formulations
from cpbench.graph import best_kind, edges
from cpbench.report import canvas

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 6.0
UNIT = (65.0, 62.0)
"""Points of a unit of the places."""
PLACES = {
    "afc": (1.0, 0.0),
    "avi": (6.45, 2.2),
    "coneqp": (2.0, 5.0),
    "cp": (3.1, 3.5),
    "equation": (5.9, 0.4),
    "fc": (2.0, 1.55),
    "fcm": (1.0, 2.6),
    "ge": (5.2, 3.3),
    "gfc": (0.0, 1.6),
    "grfc": (0.0, 5.0),
    "lcp": (4.72, 1.95),
    "micp": (3.9, 1.05),
    "mlcp": (3.15, 0.0),
    "ncp": (3.25, 2.3),
    "nfc": (0.0, 3.2),
    "nlp": (5.5, 5.0),
    "qp": (4.6, 5.0),
    "qvi": (1.6, 3.3),
    "relay": (6.6, 1.0),
    "rfc": (1.0, 4.5),
    "soclcp": (3.2, 4.5),
    "vi": (3.95, 4.0),
}
"""Where the formulations stand, so that few arrows cross."""
GUIDE = "Blue: exact for every problem, or for some. Dashed: approximations and relaxations only."
"""How to read the map."""


def graph_map() -> Figure:
    """Draw the formulations as boxes and the conversions as arrows.

    To be called within `canvas.drawing`.
    """
    pairs: dict[tuple[str, str], bool] = {}
    roads = [edge for edge in edges() if edge.source != edge.target]
    for edge in roads:
        pair = (edge.source, edge.target)
        pairs[pair] = pairs.get(pair, False) or best_kind(edge).exact
    places = _places()
    figure = canvas.page(6.8, 4.9)
    axes = figure.add_axes((0.01, 0.01, 0.98, 0.98))
    for (source, target), exact in pairs.items():
        both = (target, source) in pairs
        axes.annotate(
            "", places[target], places[source],
            arrowprops={
                "arrowstyle": "-|>", "color": canvas.BLUE if exact else canvas.RED, "linewidth": 1.1,
                "linestyle": "-" if exact else (0, (3, 2)),
                "shrinkA": _border(source, places[source], places[target]),
                "shrinkB": _border(target, places[target], places[source]),
                "connectionstyle": f"arc3,rad={0.14 if both else 0.0}",
            },
        )  # fmt: skip
    for name, (x, y) in places.items():
        axes.text(
            x, y, name, ha="center", va="center", fontsize=9, zorder=5,
            bbox={"boxstyle": "round,pad=0.42", "facecolor": "#ffffff", "edgecolor": canvas.GREY, "linewidth": 0.8},
        )  # fmt: skip
    axes.set_xlim(-0.4, 6.95)
    axes.set_ylim(min(y for _, y in places.values()) - 0.3, 5.3)
    axes.set_axis_off()
    return figure


def _places() -> dict[str, tuple[float, float]]:
    """Return where every formulation stands: one without a place is in the row below."""
    others = [node for node in formulations.names() if node not in PLACES]
    below = {node: (WIDTH * (k + 1) / (len(others) + 1), -0.9) for k, node in enumerate(others)}
    return below | PLACES


def _border(name: str, place: tuple[float, float], other: tuple[float, float]) -> float:
    """Return points from the middle of a box to a little beyond its border, towards another place."""
    across, up = (b - a for a, b in zip(place, other, strict=True))
    length = math.hypot(across * UNIT[0], up * UNIT[1])
    half = (6.0 + 2.9 * len(name), 11.0)
    return 2.0 + min(
        half[k] * length / abs(part * UNIT[k]) if part else math.inf for k, part in enumerate((across, up))
    )
