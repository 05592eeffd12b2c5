"""The friction cone of a contact in 3D that slides, with inner and outer facets, r and the velocities u and û."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench import FrictionContact
from cpbench.conversions.base import make
from cpbench.foundation.cones import de_saxce
from cpbench.foundation.matrices import Dense, Vector, norm
from cpbench.report import canvas

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.axes3d import Axes3D

TOP = 1.25
"""Height at which the cone is cut, over r_N."""
NARROW = 0.6
"""Least half width of the picture, in the same unit."""
BELOW = 0.25
"""How far a velocity into the obstacle may point below the tip."""
FACETS = 8
"""Facets of the polygons."""


def draw(problem: FrictionContact, r: Vector) -> Figure:
    """Draw K_μ of a contact that slides with both pyramids, r on it, and u and û from its tip."""
    mu, u = float(problem.mu[0]), problem.W @ r + problem.q
    figure = canvas.page(canvas.COLUMN, 2.7)
    axes: Any = figure.add_axes((-0.15, -0.23, 1.3, 1.45), projection="3d", computed_zorder=False)
    _cone(axes, mu, FACETS)
    _vectors(axes, r, u, de_saxce(u[None, :], np.array([mu]))[0], mu)
    _view(axes, r[1:], mu / np.cos(np.pi / FACETS))
    return figure


def _cone(axes: Axes3D, mu: float, facets: int) -> None:
    """Draw the cone up to TOP, and the edges of the two pyramids."""
    turn = np.linspace(0.0, 2.0 * np.pi, 121)
    rim = np.array([np.cos(turn), np.sin(turn)]) * mu * TOP
    height = np.array([[0.0], [1.0]])
    axes.plot_surface(
        height * rim[0], height * rim[1], height * TOP * np.ones_like(turn),
        color="#BFBFBF", alpha=0.33, linewidth=0, antialiased=True, shade=False, zorder=1,
    )  # fmt: skip
    axes.plot(*rim, TOP, color=canvas.GREY, linewidth=0.9, zorder=2)
    for side, look in (("inner", "-"), ("outer", (0, (3, 2)))):
        corners: Dense = make(f"fc-lcp-{side}", {"facets": facets}).vertices * mu * TOP  # type: ignore[attr-defined]
        closed = np.hstack([corners, corners[:, :1]])
        axes.plot(*closed, TOP, color=canvas.INK, linewidth=0.7, linestyle=look, zorder=3)
        for x, y in corners.T:
            axes.plot([0, x], [0, y], [0, TOP], color=canvas.INK, linewidth=0.35, linestyle=look, alpha=0.6, zorder=3)


def _vectors(axes: Axes3D, r: Vector, u: Vector, hat: Vector, mu: float) -> None:
    """Draw r over r_N, u and û in a scale of their own, and the right angle between r and û."""
    _arrow(axes, r / r[0], canvas.BLUE, r"$r$")
    far = max(max(norm(u), norm(hat)) / (0.95 * max(TOP * mu, NARROW)), -u[0] / BELOW)
    u, hat = u / far, hat / far
    _arrow(axes, u, canvas.RED, r"$u$")
    _arrow(axes, hat, canvas.GREEN, r"$\hat{u}$")
    lift = np.array([u, hat])
    axes.plot(lift[:, 1], lift[:, 2], lift[:, 0], color=canvas.GREEN, linewidth=1, linestyle=":", zorder=9)
    x, y, z = 0.5 * (u + hat)[[1, 2, 0]]
    words = r"$\mu|u_\mathrm{T}|e_\mathrm{N}$  "
    axes.text(x, y, z, words, color=canvas.GREEN, fontsize=7, ha="right", va="center", zorder=12)
    one, other = 0.12 * r / norm(r), 0.12 * hat / norm(hat)
    corner = np.array([one, one + other, other])
    axes.plot(corner[:, 1], corner[:, 2], corner[:, 0], color=canvas.INK, linewidth=0.8, zorder=11)


def _arrow(axes: Axes3D, end: Vector, colour: str, label: str) -> None:
    """Draw an arrow from the tip of the cone; (N, T1, T2) are drawn as (T1, T2, N)."""
    a, b, c = end[[1, 2, 0]]
    axes.quiver(0, 0, 0, a, b, c, color=colour, linewidth=2.0, arrow_length_ratio=0.13, zorder=10)
    tip = 1.1 * np.array([a, b, c])
    axes.text(tip[0], tip[1], tip[2], label, color=colour, fontsize=11, ha="center", va="center", zorder=12)


def _view(axes: Axes3D, along: Vector, mu: float) -> None:
    """Set equal axes, seen nearly across the plane of r and u, so that the right angle is one."""
    reach, height = 1.08 * max(TOP * mu, NARROW), TOP * 1.07
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_zlim(-0.05, TOP * 1.02)
    diagonal = norm(np.array([2 * reach, 2 * reach, height]))
    zoom: Any = min(1.0, 0.47 * diagonal / height)  # the stubs want an int
    axes.set_box_aspect((2 * reach, 2 * reach, height), zoom=zoom)
    axes.set_axis_off()
    across = np.degrees(np.arctan2(along[1], along[0]))
    axes.view_init(elev=17, azim=across - 68)
    for end, label in (((1, 0, 0), r"$\mathrm{T}_1$"), ((0, 1, 0), r"$\mathrm{T}_2$"), ((0, 0, 1), r"$\mathrm{N}$")):
        length = TOP * 1.1 if end[2] else reach * 1.05
        x, y, z = np.array(end) * length
        axes.plot([0, x], [0, y], [0, z], color=canvas.GREY, linewidth=0.7, zorder=2)
        axes.text(1.09 * x, 1.09 * y, 1.09 * z, label, color="#555555", fontsize=7, ha="center", va="center")
