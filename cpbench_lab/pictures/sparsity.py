"""The block structure of a problem's matrices: where entries are, and how large.

Matrices stand as they do in the equations; contact problems have a line between contacts while these are few.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench.errors import NotApplicable
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Matrix
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing, figure_kind
from cpbench.report.show import shape as symbols_of
from cpbench.report.show import sized

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CELLS = 220
"""Cells a side, at most."""
LINES = 24
"""Contacts that are separated by lines, at most."""
LEAST = 0.16
"""The least share of the picture that a matrix gets, however few its rows or columns."""
PLACES: dict[str, tuple[tuple[str, ...], ...]] = {
    "mlcp": (("A", "C"), ("D", "B")),
    "fcm": (("W", "V"), ("", "R")),
    "qp": (("Q",), ("A",), ("C",)),
}
"""Where matrices stand; else they stand in a row."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """`largest` : max|M_ij| in every cell of `step` rows and columns, 0 of an empty one. `step` : entries a side."""

    largest: Dense
    step: int


def coarsened(M: Matrix, cells: int, block: int = 1) -> Coarse:
    """Coarsen M to at most `cells` (rounded up) cells a side; a cell holds whole blocks of `block` rows and columns.

    >>> coarsened(np.diag([1.0, -2.0, 3.0, 0.0]), 2).largest.tolist()
    [[2.0, 0.0], [0.0, 3.0]]
    """
    rows, cols = M.shape
    blocks = -(-max(rows, cols, 1) // block)
    step = block * (-(-blocks // cells)) if blocks * block > cells else 1
    coo = matrices.sparse(M).tocoo()
    largest = np.zeros((-(-rows // step), -(-cols // step)))
    np.maximum.at(largest, (coo.row // step, coo.col // step), np.abs(coo.data))
    return Coarse(largest, step)


def arranged(problem: Problem) -> list[list[str]]:
    """Arrange names of the matrices that have rows and columns, in rows as they stand in the equations; '' for a
    gap.

    >>> from cpbench.formulations.linear import LCP
    >>> arranged(LCP(M=np.eye(2), q=np.ones(2)))
    [['M']]
    """
    there = [
        name
        for name, value in problem.data().items()
        if value.ndim == 2 and min(value.shape) > 0 and name not in ("mu", "mu_r")
    ]
    places = [[name if name in there else "" for name in row] for row in PLACES.get(problem.node, (tuple(there),))]
    rows = [row for row in places if any(row)]
    columns = [column for column in zip(*rows, strict=True) if any(column)]
    return [list(row) for row in zip(*columns, strict=True)]


@figure_kind("sparsity")
def draw(problem: Problem, point: Point | None = None) -> Drawing:
    """Draw a panel a matrix that has entries, in common scale of shades."""
    places, data = arranged(problem), problem.data()
    if not places:
        raise NotApplicable("sparsity", f"this {problem.node} has no matrix with entries")
    blocks: dict[str, Matrix] = {name: data[name] for row in places for name in row if name}  # type: ignore[misc]
    wide = [max(blocks[row[k]].shape[1] for row in places if row[k]) for k in range(len(places[0]))]
    high = [max(blocks[name].shape[0] for name in row if name) for row in places]
    figure = _grid(problem, blocks, places, _shares(wide, high), _shares(high, wide))
    entries = sum(matrices.nnz(M) for M in blocks.values())
    whole = sum(M.shape[0] * M.shape[1] for M in blocks.values())
    titles = [sized(symbols_of(problem, name), M) for name, M in blocks.items()]
    guide = (
        f"{canvas.joined([f'{n}: {t}' for n, t in zip(blocks, titles, strict=True)])}; {entries} nonzeros, "
        f"{100 * entries / whole:.3g} % of the entries. A cell is an entry or a square of entries, darker the larger "
        "its largest, over six decades; small ones are light grey, zeros white."
    )
    return Drawing(figure, f"Structure: {canvas.literal(problem.name or problem.node)} ({problem.node})", guide)


def _shares(sizes: list[int], others: list[int]) -> list[float]:
    """Return sizes over the largest of all, none too small to see."""
    largest = max(*sizes, *others)
    return [max(size / largest, LEAST) for size in sizes]


def _grid(
    problem: Problem, blocks: dict[str, Matrix], places: list[list[str]], wide: list[float], high: list[float]
) -> Figure:
    width = canvas.COLUMN if sum(wide) < 1.8 else canvas.PAGE
    gap, left, top = 0.42, 0.12, 0.3
    scale = min((width - left - 0.1 - gap * (len(wide) - 1)) / sum(wide), 5.0 / sum(high))
    height = scale * sum(high) + (gap * (len(high) - 1)) + top + 0.12
    figure = canvas.page(width, height)
    largest = max(matrices.max_abs(M) for M in blocks.values()) or 1.0
    y = height - top
    for row, tall in zip(places, high, strict=True):
        x = left
        for name, broad in zip(row, wide, strict=True):
            if name:
                box = (x / width, (y - scale * tall) / height, scale * broad / width, scale * tall / height)
                _panel(figure.add_axes(box), problem, name, blocks[name], largest)
            x += scale * broad + gap
        y -= scale * tall + gap
    return figure


def _panel(axes: Axes, problem: Problem, name: str, M: Matrix, largest: float) -> None:
    """Draw shades by the logarithm of the largest entry of a cell."""
    block = getattr(problem, "dimension", 1) if isinstance(problem, ContactProblem) else 1
    coarse = coarsened(M, CELLS, block)
    with np.errstate(divide="ignore"):
        depth = np.clip(1.0 + np.log10(coarse.largest / largest) / 6.0, 0.0, 1.0)
    shade = np.where(coarse.largest > 0, 0.82 - 0.75 * depth, 1.0)
    rows, cols = M.shape
    extent = (0.0, coarse.step * shade.shape[1], coarse.step * shade.shape[0], 0.0)
    look: dict[str, Any] = {"cmap": "gray", "vmin": 0.0, "vmax": 1.0, "interpolation": "nearest"}
    axes.imshow(shade, extent=extent, aspect="auto", **look)
    axes.set_xlim(0, cols)
    axes.set_ylim(rows, 0)
    if isinstance(problem, ContactProblem) and problem.nc <= LINES:
        of_contacts = problem.dimension * problem.nc
        for line in range(problem.dimension, of_contacts, problem.dimension):
            if rows == of_contacts:
                axes.axhline(line, color=canvas.BLUE, linewidth=0.4, alpha=0.6)
            if cols == of_contacts:
                axes.axvline(line, color=canvas.BLUE, linewidth=0.4, alpha=0.6)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(True)
        spine.set_linewidth(0.6)
    axes.set_title(rf"${name}$  {rows} × {cols}", fontsize=8, pad=3, loc="left")
