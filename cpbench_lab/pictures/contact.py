"""The contacts of an answer: where they are, the forces in them, and which stick, slip or are open.

Files with positions show them with an arrow a force, seen along a coordinate axis. Files without show the disk of
r_T/(μ r_N), of which plane problems have a diameter: slip is on its rim, stick inside.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench.analysis.contact_states import ContactStates, State, contact_states, forces
from cpbench.errors import CpbenchError, NotApplicable
from cpbench.formulations.base import Contacts, Point, Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation.matrices import Dense
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.text import counted
from cpbench.verification import judge

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOOKS: dict[State, dict[str, Any]] = {
    State.STICK: {"color": canvas.BLUE, "marker": "o", "s": 17},
    State.SLIP: {"color": canvas.RED, "marker": "^", "s": 24},
    State.OPEN: {"edgecolors": canvas.GREY, "facecolors": "white", "marker": "o", "s": 13, "linewidths": 0.8},
}
"""Shape and filling differ as well as colour."""
SIGNS = {State.STICK: "●", State.SLIP: "▲", State.OPEN: "○"}
INKS = {State.STICK: canvas.BLUE, State.SLIP: canvas.RED, State.OPEN: "#666666"}
LONGEST = 0.2
"""Length of the largest force over the width of the scene."""
FARTHEST = 2.0
"""Reactions farther outside the disk (of wrong answers) are drawn on the edge of the picture."""
VIEWS = ("xy", "xz", "yz")


@figure_kind(
    "contact",
    answer=Need.REQUIRED,
    view="Plane to look at, xy, xz or yz (default: the one in which positions spread most).",
    tolerance="Size, relative to the whole answer, up to which a reaction or a velocity is noise.",
)
def draw(problem: Problem, point: Point, *, view: str = "", tolerance: float = 1e-6) -> Drawing:
    """Draw a map of the contacts where there are positions, else the disk."""
    if view not in ("", *VIEWS):
        raise CpbenchError(f"view {view}: is one of {', '.join(VIEWS)}")
    states = contact_states(problem, point, tolerance)
    assert isinstance(problem, ContactProblem)
    if not problem.nc:
        raise NotApplicable("contact", "the problem has no contact: there is nothing to draw")
    figure = canvas.page(canvas.COLUMN, 3.45)
    error = judge(problem, point, tolerance).error
    how = f"Error of the answer, as cpbench judges it: {canvas.number(error)}."
    placed = problem.contacts is not None and problem.contacts.knows("position") and problem.contacts.knows("frame")
    if problem.contacts is not None and placed:
        guide = _map(figure, problem.contacts, states, view)
    elif view:
        raise NotApplicable("contact", f"view {view}: the file has no positions and frames of contacts")
    else:
        guide = _disk(figure, states)
    _counts(figure, states)
    named = canvas.literal(problem.name or problem.node)
    return Drawing(figure, f"{named}: {counted(problem.nc, 'contact')}", f"{guide} {how}")


def _counts(figure: Figure, states: ContactStates) -> None:
    """Write `● 12 stick ▲ 5 slip ○ 3 open` above the picture, which is its legend."""
    for k, state in enumerate(State):
        words = f"{SIGNS[state]} {states.count(state)} {state}"
        figure.text(0.13 + 0.27 * k, 0.965, words, color=INKS[state], fontsize=8, fontweight="bold", va="center")


def _map(figure: Figure, contacts: Contacts, states: ContactStates, view: str) -> str:
    """Draw positions in a plane, with the forces on the first body of each contact."""
    position = np.asarray(contacts.position)
    spread = np.ptp(position, axis=0)
    if not view:
        wide = np.sort(np.argsort(spread, kind="stable")[1:])
        view = "".join("xyz"[k] for k in wide)
    across = ["xyz".index(letter) for letter in view]
    force: Dense = forces(states, contacts)[:, across]
    place: Dense = position[:, across]
    box = (0.17, 0.115, 0.81, 0.80)
    axes = figure.add_axes(box)
    extent = float(np.ptp(place, axis=0).max()) or 1.0
    largest = float(np.linalg.norm(force, axis=1).max())
    factor = LONGEST * extent / largest if largest > 0 else 0.0
    for state in (State.OPEN, State.STICK, State.SLIP):
        own = states.state == str(state)
        if state is not State.OPEN and own.any():
            axes.quiver(
                *place[own].T, *(factor * force[own]).T, color=INKS[state], angles="xy", scale_units="xy", scale=1.0,
                width=0.0055, headwidth=3.6, headlength=4.2, headaxislength=3.9, zorder=3,
            )  # fmt: skip
        axes.scatter(*place[own].T, zorder=4 if state is not State.OPEN else 2, **LOOKS[state])
    reach = np.vstack([place, place + factor * force])
    middle, half = 0.5 * (reach.min(axis=0) + reach.max(axis=0)), 0.5 * np.ptp(reach, axis=0) + 0.06 * extent
    tall = max(half[1], half[0] * box[3] * figure.get_figheight() / (box[2] * figure.get_figwidth()))
    broad = tall * box[2] * figure.get_figwidth() / (box[3] * figure.get_figheight())
    axes.set_xlim(middle[0] - broad, middle[0] + broad)
    axes.set_ylim(middle[1] - tall, middle[1] + tall)
    axes.locator_params(nbins=6)
    axes.set_xlabel(f"${view[0]}$ [m]")
    axes.set_ylabel(f"${view[1]}$ [m]")
    return (
        f"Contacts seen in the plane {view}; an arrow is the force on the first body of the contact, "
        f"{canvas.number(largest)} N s where it is longest."
    )


def _disk(figure: Figure, states: ContactStates) -> str:
    axes = figure.add_axes((0.15, 0.105, 0.82, 0.82))
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.fill(np.cos(turn), np.sin(turn), color="#F0F0F0", zorder=0)
    axes.plot(np.cos(turn), np.sin(turn), color=canvas.GREY, linewidth=0.9, zorder=1)
    many = 1.0 if len(states.r) <= 100 else 0.45
    for state in (State.STICK, State.SLIP):
        own = states.state == str(state)
        share, against = (_in_plane(part[own]) for part in (states.share, states.against))
        share = _clip_to_radius(share)
        if state is State.SLIP:
            axes.quiver(
                *share.T, *(0.14 * against).T, color=canvas.RED, angles="xy", scale_units="xy", scale=1.0,
                width=0.004, headwidth=3.5, alpha=many, zorder=3,
            )  # fmt: skip
        look = {**LOOKS[state], "s": LOOKS[state]["s"] * (1.0 if many == 1.0 else 0.5)}
        axes.scatter(*share.T, zorder=4, alpha=many, **look)
    far = max(1.22, 1.08 * min(FARTHEST, float(np.abs(states.share).max(initial=0.0))))
    axes.set_xlim(-far, far)
    axes.set_ylim(-far, far)
    axes.set_aspect("equal")
    axes.set_xticks([-1, 0, 1])
    axes.set_yticks([-1, 0, 1])
    axes.set_xlabel(r"$r_{\mathrm{T}1}\,/\,\mu r_\mathrm{N}$", labelpad=1)
    axes.set_ylabel(r"$r_{\mathrm{T}2}\,/\,\mu r_\mathrm{N}$", labelpad=-2)
    return (
        r"Each contact that pushes, at $r_\mathrm{T}/\mu r_\mathrm{N}$: inside the disk it sticks, on the rim it "
        r"slips; an arrow has the direction of $-\mu u_\mathrm{T}$, straight outwards by Coulomb's law. Open contacts "
        f"are left out, those without friction are in the middle; the file has no positions.{_outside(states)}"
    )


def _in_plane(vectors: Dense) -> Dense:
    """Return vectors with two components, the second one 0 in plane problems."""
    return vectors if vectors.shape[1] == 2 else np.column_stack([vectors, np.zeros(len(vectors))])


def _clip_to_radius(share: Dense) -> Dense:
    """Clip vectors longer than FARTHEST to that length."""
    size = np.linalg.norm(share, axis=1, keepdims=True)
    return share * np.minimum(1.0, FARTHEST / np.maximum(size, FARTHEST))


def _outside(states: ContactStates) -> str:
    """Return the guide's sentence about reactions that no contact may have, '' for an admissible answer."""
    size = np.linalg.norm(states.share, axis=1)
    beyond = int((size > 1.01).sum())
    return f" Outside are {counted(beyond, 'reaction')}, up to {canvas.number(float(size.max()))}." if beyond else ""
