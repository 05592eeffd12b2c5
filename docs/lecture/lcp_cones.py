"""An LCP with n = 2: its complementary cones, q, the solutions, and the path of Lemke's method.

Left the plane of q, with the line q + z₀e along which Lemke's method comes to q; right the same pivots in z.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench import LCP
from cpbench.foundation.matrices import Dense, Vector, dense, max_abs
from cpbench.report import canvas
from lecture.numerics.complementary_cones import (
    ComplementaryCone,
    LemkePath,
    complementary_cones,
    lemke_path,
    solutions,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FILLS: dict[tuple[int, ...], str] = {(): "#D9D9D9", (0,): "#A9CCE6", (1,): "#F2C6A6", (0, 1): "#B5DECF"}
_NUMBER, _Q = (8, -7), (-8, -8)
"""Where the number of a pivot and the q stand beside their points [pt]."""
NAMES: dict[tuple[int, ...], str] = {(): r"$z = 0$", (0,): r"$z_1 > 0$", (1,): r"$z_2 > 0$", (0, 1): r"$z_1, z_2 > 0$"}


def draw(problem: LCP) -> Figure:
    """Draw two panels."""
    cones = complementary_cones(problem)
    path, found = lemke_path(problem), solutions(cones)
    figure = canvas.page(canvas.PAGE, 3.3)
    _plane_of_q(figure.add_axes((0.06, 0.125, 0.41, 0.86)), cones, problem.q, path)
    _plane_of_z(figure.add_axes((0.565, 0.125, 0.41, 0.86)), dense(problem.M), problem.q, path, found)
    return figure


def _plane_of_q(axes: Axes, cones: list[ComplementaryCone], q: Vector, path: LemkePath) -> None:
    points = np.vstack([np.zeros((1, 2)), q[None, :], q + path.cover[:, None]])
    reach = 1.3 * max(max_abs(points), 1e-300)
    taken = [q, *(q + np.outer(np.linspace(0.0, max(path.cover, default=0.0), 9), np.ones(2)))]
    rays = {r"$e_1$": np.array([1.0, 0.0]), r"$e_2$": np.array([0.0, 1.0])}
    for k, name in enumerate((r"$-M_{\cdot 1}$", r"$-M_{\cdot 2}$")):
        rays[name] = next(c for c in cones if c.active == (k,)).generators[:, k]
    for name, ray in rays.items():
        size = float(np.linalg.norm(ray))
        if size > 0:
            x, y = ray / size * 3.0 * reach
            axes.plot([0, x], [0, y], color="#555555", linewidth=0.8, zorder=2)
            tip = 0.93 * reach * ray / max_abs(ray)
            taken.append(tip)
            axes.text(tip[0], tip[1], name, fontsize=8, ha="center", va="center", bbox=canvas.PLATE, zorder=6)
    point = 2.0 * reach / (72.0 * axes.get_position().width * axes.figure.get_figwidth())  # type: ignore[union-attr]
    numbers = [q + cover + point * np.array(_NUMBER) for cover in path.cover[:, None] * np.ones(2)]
    taken += [q + point * np.array(_Q), *numbers]
    for cone in cones:
        g = cone.generators / np.maximum(np.linalg.norm(cone.generators, axis=0), 1e-300)
        if not cone.degenerate:
            axes.fill(*(3.0 * reach * _sector(g)), color=FILLS[cone.active], alpha=0.75, linewidth=0, zorder=1)
        where = _free(_inside_cone(g, cone.degenerate) * reach, taken)
        taken.append(where)
        words = NAMES[cone.active] + (" (flat)" if cone.degenerate else "")
        plate = canvas.PLATE if cone.degenerate else None
        axes.text(
            where[0], where[1], words, ha="center", va="center", fontsize=8, color="#333333", bbox=plate, zorder=3
        )
    _pivots(axes, q + path.cover[:, None] * np.ones(2), aside=0.028 * reach, offset=_NUMBER)
    axes.plot(*q, "o", color=canvas.INK, markersize=4.5, zorder=8)
    axes.annotate(r"$q$", (q[0], q[1]), _Q, textcoords="offset points", fontsize=10, zorder=9, ha="center", va="center")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_aspect("equal")
    axes.set_xlabel("$q_1$", labelpad=1)
    axes.set_ylabel("$q_2$", labelpad=1)


def _pivots(axes: Axes, places: Dense, aside: float, offset: tuple[float, float]) -> None:
    """Draw numbered points on the line, a step that turns back drawn beside it."""
    for k, place in enumerate(places):
        if k:
            back = k > 1 and float((place - places[k - 1]) @ (places[k - 1] - places[k - 2])) < 0
            shift = np.array([aside, -aside]) * back
            _step(axes, places[k - 1] + shift, place + shift)
    numbers: list[tuple[Vector, list[str]]] = []
    for k, place in enumerate(places, start=1):
        same = [own for at, own in numbers if max_abs(at - place) <= 1e-9 * max_abs(places)]
        if same:
            same[0].append(str(k))
        else:
            numbers.append((place, [str(k)]))
    for (x, y), own in numbers:
        axes.plot(x, y, "o", color=canvas.RED, markersize=3.2, zorder=7)
        look: dict[str, Any] = {"fontsize": 8, "color": "#A34700", "fontweight": "bold", "zorder": 9, "ha": "center"}
        axes.annotate(",".join(own), (x, y), offset, textcoords="offset points", va="center", **look)


def _step(axes: Axes, start: Vector, end: Vector) -> None:
    look: dict[str, Any] = {"arrowstyle": "-|>", "color": canvas.RED, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 1}
    if max_abs(end - start) > 1e-9 * max(max_abs(start), max_abs(end)):
        axes.annotate("", (end[0], end[1]), (start[0], start[1]), arrowprops={**look, "mutation_scale": 8}, zorder=6)


def _plane_of_z(axes: Axes, M: Dense, q: Vector, path: LemkePath, found: list[Vector]) -> None:
    everything = np.vstack([np.zeros((1, 2)), path.z, *(z[None, :] for z in found)])
    reach = 1.35 * max(max_abs(everything), 1e-300) if max_abs(everything) > 0 else 1.0
    low, high = -0.18 * reach, reach
    taken = list(everything)
    for i in range(2):
        a, b = M[i]
        size = float(np.hypot(a, b))
        if size == 0:
            continue
        foot, along = -q[i] * np.array([a, b]) / size**2, np.array([-b, a]) / size
        line = foot[:, None] + along[:, None] * np.array([-9.0, 9.0]) * reach
        axes.plot(*line, color=(canvas.BLUE, canvas.GREEN)[i], linewidth=1.2, zorder=2)
        candidates = _within(foot, along, low, high)
        if len(candidates):
            where, colour = _free(candidates, taken), (canvas.BLUE, canvas.GREEN)[i]
            taken.append(where)
            words = f"$w_{i + 1} = 0$"
            axes.text(where[0], where[1], words, color=colour, ha="center", va="center", bbox=canvas.PLATE, zorder=3)
    axes.axhline(0.0, color="#555555", linewidth=0.8, zorder=1)
    axes.axvline(0.0, color="#555555", linewidth=0.8, zorder=1)
    _pivots(axes, path.z, aside=0.0, offset=(-7, 6))
    for z in found:
        axes.plot(*z, "o", markersize=8, markerfacecolor="none", color=canvas.INK, markeredgewidth=1.3, zorder=8)
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)
    axes.set_aspect("equal")
    axes.set_xlabel("$z_1$", labelpad=0)
    axes.set_ylabel("$z_2$", labelpad=1)


def _within(foot: Vector, along: Vector, low: float, high: float) -> Dense:
    """Return places on a line inside the square [low, high]², not too near its sides; (k, 2)."""
    places = foot + np.linspace(-3.0, 3.0, 601)[:, None] * (high - low) * along
    margin = 0.1 * (high - low)
    return places[((places > low + margin) & (places < high - margin)).all(axis=1)]


def _free(candidates: Dense, taken: list[Vector]) -> Vector:
    """Return the candidate farthest from everything that is there; words are wider than high."""
    between = (candidates[:, None, :] - np.array(taken)[None, :, :]) / (3.0, 1.0)
    apart = np.linalg.norm(between, axis=2).min(axis=1)
    return candidates[int(np.argmax(apart))]


def _sector(g: Dense) -> Dense:
    """Return the cone of two unit vectors up to the unit circle: columns of corners."""
    first, second = np.arctan2(g[1], g[0])
    turn = (second - first + np.pi) % (2.0 * np.pi) - np.pi
    arc = first + turn * np.linspace(0.0, 1.0, 33)
    return np.column_stack([np.zeros(2), np.array([np.cos(arc), np.sin(arc)])])


def _inside_cone(g: Dense, degenerate: bool) -> Dense:
    """Return places for a name in the unit square, along the edges of a flat cone, else well between them; (k, 2)."""
    rays = g.T if degenerate else _sector(g)[:, 8:26].T
    rays = rays[np.abs(rays).max(axis=1) > 1e-9]
    if not len(rays):
        rays = np.array([[-1.0, -1.0]])
    rays = rays / np.abs(rays).max(axis=1, keepdims=True)
    return np.vstack([share * rays for share in (0.75, 0.65, 0.55, 0.45, 0.35, 0.25)])
