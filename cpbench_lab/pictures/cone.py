"""The friction cone of a contact in 3D, with inner and outer facets, the reaction r and the velocities u and û.

Without FILE: a contact that slides, W = I, q = (−1, 1.2, 0.9), with its solution. Without an answer: the cone alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench.analysis.contact_states import ContactStates, State, angle_between, contact_states, most_rubbing
from cpbench.conversions.base import make
from cpbench.conversions.facets import wrong_knobs
from cpbench.errors import NotApplicable, ProblemError
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation.cones import de_saxce
from cpbench.foundation.matrices import Dense, Vector, norm
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.solvers.base import solve

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d.axes3d import Axes3D

CIRCULAR = ("fc", "fcm", "gfc")
TOP = 1.25
"""Height at which the cone is cut, over r_N."""
NARROW = 0.6
"""Least half width of the picture, in the same unit."""
BELOW = 0.25
"""How far a velocity into the obstacle may point below the tip, which only a wrong answer has."""


@figure_kind(
    "cone",
    problem=Need.OPTIONAL,
    answer=Need.OPTIONAL,
    contact="Number of the contact, from 0 (default: the one whose friction does most work).",
    facets="Facets ν of the polygons.",
)
def draw(problem: Problem | None = None, point: Point | None = None, *, contact: int = -1, facets: int = 8) -> Drawing:
    """Draw K_μ with both pyramids, r on it, and u and û from its tip."""
    if problem is None:
        problem = example()
        point = solve(problem, "nsgs").point
    if not isinstance(problem, ContactProblem) or problem.node not in CIRCULAR or problem.dimension != 3:
        raise NotApplicable(
            "cone", f"draws three-dimensional contacts of {', '.join(CIRCULAR)}; this is {_what(problem)}"
        )
    states = None if point is None else contact_states(problem, point)
    wrong = wrong_knobs(facets, 0.0)
    if wrong is not None:
        raise NotApplicable("cone", wrong)
    place = chosen(problem, states, contact)
    mu = float(problem.mu[place])
    figure = canvas.page(canvas.COLUMN, 2.7)
    axes: Any = figure.add_axes((-0.15, -0.23, 1.3, 1.45), projection="3d", computed_zorder=False)
    _cone(axes, mu, facets)
    sentence = "It has no answer." if states is None else _vectors(axes, states, place)
    along = np.array([1.0, 0.0])
    if states is not None and states.state[place] != str(State.OPEN):
        along = states.r[place, 1:]
    elif states is not None:
        along = -states.u[place, 1:]
    _view(axes, along, mu / np.cos(np.pi / facets))
    named = canvas.literal(problem.name or problem.node)
    where = named if problem.nc == 1 else f"{named}, contact {place}"
    guide = (
        rf"Grey: $K_\mu$, reactions with $|r_\mathrm{{T}}| \leq \mu r_\mathrm{{N}}$, $\mu$ = {mu:.3g}; solid and "
        f"dashed edges: inner and outer pyramids with ν = {facets}. {sentence}"
    )
    return Drawing(figure, f"Friction cone: {where}", guide)


def example() -> FrictionContact:
    """Return one contact that slides."""
    return FrictionContact(W=np.eye(3), q=np.array([-1.0, 1.2, 0.9]), mu=np.array([0.6]), name="a contact that slides")


def chosen(problem: ContactProblem, states: ContactStates | None, contact: int) -> int:
    """Return the requested contact, or one worth seeing; raises ProblemError when there is none of that number."""
    if contact == -1 and problem.nc:
        return int(np.argmax(problem.mu > 0)) if states is None else most_rubbing(states)
    if not 0 <= contact < problem.nc:
        raise ProblemError(problem.node, f"there is no contact {contact}; there are {problem.nc}, counted from 0")
    return contact


def _what(problem: Problem) -> str:
    return (
        f"{problem.node} of dimension {getattr(problem, 'dimension', '?')}"
        if hasattr(problem, "dimension")
        else (problem.node)
    )


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


def _vectors(axes: Axes3D, states: ContactStates, place: int) -> str:
    """Draw r over r_N; u and û in a scale of their own; return the guide's sentence about them."""
    r, u, mu = states.r[place], states.u[place], float(states.mu[place, 0])
    hat = de_saxce(u[None, :], np.array([mu]))[0]
    state = State(str(states.state[place]))
    if state is not State.OPEN:
        _arrow(axes, r / max(r[0], norm(r[1:]) / (TOP * max(mu, NARROW))), canvas.BLUE, r"$r$")
    if state is State.STICK:
        inside = r"$r$ inside, $u = 0$" if mu > 0 else r"without friction the cone is its axis"
        return f"The contact does not slide: {inside}."
    far = max(max(norm(u), norm(hat)) / (0.95 * max(TOP * mu, NARROW)), -u[0] / BELOW)
    u, hat = u / far, hat / far
    _arrow(axes, u, canvas.RED, r"$u$")
    if state is State.OPEN:
        return "The contact is open: no reaction, $u$ leaves."
    if mu == 0:
        return "The contact slides without friction: the cone is its axis."
    _arrow(axes, hat, canvas.GREEN, r"$\hat{u}$")
    lift = np.array([u, hat])
    axes.plot(lift[:, 1], lift[:, 2], lift[:, 0], color=canvas.GREEN, linewidth=1, linestyle=":", zorder=9)
    x, y, z = 0.5 * (u + hat)[[1, 2, 0]]
    words = r"$\mu|u_\mathrm{T}|e_\mathrm{N}$  "
    axes.text(x, y, z, words, color=canvas.GREEN, fontsize=7, ha="right", va="center", zorder=12)
    angle = angle_between(r, hat)
    if abs(angle - 90.0) < 0.5:
        one, other = 0.12 * r / norm(r), 0.12 * hat / norm(hat)
        corner = np.array([one, one + other, other])
        axes.plot(corner[:, 1], corner[:, 2], corner[:, 0], color=canvas.INK, linewidth=0.8, zorder=11)
    return (
        rf"The contact slips: $|r_\mathrm{{T}}|$ = {norm(states.share[place]):.4g} $\mu r_\mathrm{{N}}$, "
        rf"{angle_between(r[1:], -u[1:]):.1f}° from $-u_\mathrm{{T}}$; De Saxcé's "
        rf"$\hat{{u}} = u + \mu|u_\mathrm{{T}}|e_\mathrm{{N}}$ is at {angle:.1f}° to $r$ (velocities in their own "
        "scale)."
    )


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
