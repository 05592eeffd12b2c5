"""NCP functions over the plane of w and z, with the sets where they vanish.

Shade and contours show ψ, the heavy line its zeros: the two nonnegative half axes of an NCP function. The dashed
line is (38) as the lecture prints it, which vanishes elsewhere too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cpbench.errors import CpbenchError
from cpbench.formulations.base import Point, Problem
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench_lab.figures import ncp_functions as ncp

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REACH = 2.0
SAMPLES = 401
"""Odd, so that the axes w = 0 and z = 0 are among the samples."""
LEVELS = (-4.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0)


@figure_kind("ncp-functions", problem=Need.NONE, weight="λ of the penalized function (37), between 0 and 1.")
def draw(problem: Problem | None = None, point: Point | None = None, *, weight: float = 0.5) -> Drawing:
    """Draw four panels with one colour scale."""
    if not 0.0 < weight < 1.0:
        raise CpbenchError(f"--weight {weight:g}: λ of (37) lies between 0 and 1, without the ends")
    figure = canvas.page(canvas.COLUMN, 3.75)
    side = np.linspace(-REACH, REACH, SAMPLES)
    w, z = np.meshgrid(side, side)
    for k, function in enumerate(ncp.functions(weight)):
        axes = figure.add_axes((0.115 + 0.455 * (k % 2), 0.565 - 0.475 * (k // 2), 0.4, 0.3733))
        _panel(axes, function, w, z)
        if function.equation == "(38)":
            axes.contour(
                w, z, ncp.smooth_as_printed(w, z), [0.0], colors=canvas.RED, linewidths=1.2, linestyles=[(0, (3, 2))]
            )
            axes.text(-1.9, -1.85, "(38) as printed", color="#A34700", fontsize=6.8, va="bottom", bbox=canvas.PLATE)
        axes.set_xlabel("$w$", labelpad=1) if k >= 2 else axes.tick_params(labelbottom=False)
        axes.set_ylabel("$z$", labelpad=-3) if k % 2 == 0 else axes.tick_params(labelleft=False)
    guide = (
        r"Shade and thin lines: $\psi(w, z)$, dashed where negative, at ±½, ±1, ±2, ±4. Heavy line: $\psi = 0$, which "
        r"is $0 \leq w \perp z \geq 0$ for an NCP function. (38) as the lecture prints it also vanishes where "
        r"$w z < 0$; its sign is mended here."
    )
    return Drawing(figure, "NCP functions of the lecture", guide)


def _panel(axes: Axes, function: ncp.NCPFunction, w: np.ndarray, z: np.ndarray) -> None:
    value = function.psi(w, z)
    shade = np.sign(value) * np.sqrt(np.abs(value))  # small values near the zeros are distinguished
    axes.pcolormesh(w, z, shade, cmap="RdBu", vmin=-3.5, vmax=3.5, shading="gouraud", rasterized=True, alpha=0.75)
    axes.contour(w, z, value, LEVELS, colors="#555555", linewidths=0.5)
    axes.contour(w, z, value, [0.0], colors=canvas.INK, linewidths=2.2)
    axes.set_aspect("equal")
    axes.set_xticks([-2, -1, 0, 1, 2])
    axes.set_yticks([-2, -1, 0, 1, 2])
    axes.set_title(f"{function.equation} {function.name}", fontsize=7.5, pad=3, loc="left")
