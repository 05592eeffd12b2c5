"""Figures of problems: their data against planted states, formulas and independent arithmetic, and each through the
command line with what it cannot draw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from tiers import some_by_day

from cpbench import storage
from cpbench.analysis.contact_states import State, contact_states, forces
from cpbench.cli import cli
from cpbench.errors import CpbenchError, PointError, ProblemError
from cpbench.formulations import LCP, Contacts, FCPoint, FrictionContact, LCPPoint
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing, find

PICTURES = "cpbench_lab.pictures"
PLANTED = "builtin/fc/contact-planted-3d.h5"


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, list(map(str, arguments)))


def refused(*arguments: object) -> str:
    """What the command line says of bad input."""
    done = run(*arguments)
    assert done.exit_code != 0
    assert isinstance(done.exception, (CpbenchError, SystemExit)), done.exception
    return str(done.exception) + done.output


def builtin(address: str) -> tuple[object, object]:
    from cpbench.generators.collection import builtin_folder

    where = str(builtin_folder() / address)
    found = storage.solution(where)
    assert found is not None
    return storage.load(where), found[0]


def drawn(kind: str, *given: object, **options: object) -> Drawing:
    with canvas.drawing():
        return find(PICTURES, kind).draw(*given, **options)


# --- contacts -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("address", ["bodies-8", "bodies-20"])
def test_states_are_those_that_were_planted(address: str) -> None:
    """The generator writes how many contacts of each state it planted."""
    problem, point = builtin(f"gfc/contact-global.h5::{address}")
    planted = problem.info.properties["states"]
    states = contact_states(problem, point)
    assert {
        "open": states.count(State.OPEN),
        "slide": states.count(State.SLIP),
        "stick": states.count(State.STICK),
    } == (planted)


def test_states_do_not_change_with_units() -> None:
    """Newton seconds to kilonewton seconds and metres to millimetres: r·s, u·t, W·t/s."""
    problem, point = builtin("fc/contact-planted-3d.h5::full-rank-30")
    s, t = 1e-3, 1e3
    other = FrictionContact(W=problem.W * (t / s), q=problem.q * t, mu=problem.mu)
    before, after = contact_states(problem, point), contact_states(other, FCPoint(r=point.r * s))
    assert before.state.tolist() == after.state.tolist()
    assert len(set(before.state.tolist())) == 3


def test_sliding_with_two_coefficients_is_against_the_scaled_velocity() -> None:
    problem, point = builtin("afc/anisotropic.h5::planted-10")
    states = contact_states(problem, point)
    slips = states.state == "slip"
    assert slips.any()
    np.testing.assert_allclose(states.share[slips], states.against[slips], atol=1e-9)


def test_moments_are_left_out_of_rolling_contacts() -> None:
    problem, point = builtin("rfc/rolling.h5::planted-12")
    states = contact_states(problem, point)
    assert states.r.shape == (12, 3)
    np.testing.assert_array_equal(states.r, point.r.reshape(12, 5)[:, :3])


def test_a_state_needs_finite_numbers_and_contacts() -> None:
    problem, _ = builtin("fc/contact-planted-3d.h5::one-slide")
    with pytest.raises(PointError, match="not finite"):
        contact_states(problem, FCPoint(r=np.full(3, np.nan)))
    with pytest.raises(ProblemError, match="has no contacts"):
        contact_states(LCP(M=np.eye(2), q=-np.ones(2)), LCPPoint(np.ones(2)))


def test_forces_turn_with_the_frame() -> None:
    """Normal up and tangents along y, x: a force (N, T1, T2) = (3, 1, 2) is (2, 1, 3) in the scene."""
    frame = np.array([[[0.0, 0, 1], [0, 1, 0], [1, 0, 0]]])
    contacts = Contacts(id=[7], bodies=[[0, 1]], position=np.zeros((1, 3)), frame=frame)
    problem = FrictionContact(W=np.eye(3), q=np.zeros(3), mu=np.array([1.0]), contacts=contacts)
    states = contact_states(problem, FCPoint(r=np.array([3.0, 1.0, 2.0])))
    np.testing.assert_array_equal(forces(states, contacts), [[2.0, 1.0, 3.0]])


def test_a_disk_where_there_are_no_positions() -> None:
    problem, point = builtin("fc/contact-planted-3d.h5::full-rank-30")
    figure = drawn("contact", problem, point).figure
    states = contact_states(problem, point)
    dots = np.vstack([c.get_offsets() for c in figure.axes[0].collections if type(c).__name__ == "PathCollection"])
    assert len(dots) == states.count(State.STICK) + states.count(State.SLIP)
    assert np.linalg.norm(dots, axis=1).max() <= 1 + 1e-12
    assert "no positions" in drawn("contact", problem, point).guide


@pytest.mark.parametrize("address", ["contact-planted-3d.h5::full-rank-30", "contact-planted-2d.h5::full-rank-2d-40"])
def test_wrong_answers_stay_in_the_picture(address: str, rng: np.random.Generator) -> None:
    problem, _ = builtin(f"fc/{address}")
    wrong = FCPoint(r=rng.standard_normal(problem.q.size))
    assert np.abs(contact_states(problem, wrong).share).max() > 2
    drawing = drawn("contact", problem, wrong)
    axes = drawing.figure.axes[0]
    dots = np.vstack([c.get_offsets() for c in axes.collections if type(c).__name__ == "PathCollection"])
    assert np.abs(dots[:, 0]).max() < axes.get_xlim()[1] < 3
    assert "Outside are " in drawing.guide


# --- the command ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "said"),
    some_by_day(
        [
            (("contatc",), "did you mean contact"),
            (("contact", f"{PLANTED}::one-open", "-p", "sides=3"), "unknown parameter of contact, in -p NAME=VALUE"),
            (("contact", f"{PLANTED}::one-open", "--node", "lcp"), "--node: a figure of problems"),
            (("contact",), "Missing argument 'FILE'"),
            (("contact", "builtin/fc/contact-planted-3d.h5::one-open", "-p", "view=zz"), "one of xy, xz, yz"),
            (("contact", "builtin/fc/contact-planted-3d.h5::one-open", "-p", "view=xy"), "no positions"),
            (("contact", "builtin/lcp/lcp-planted.h5::spd-20"), "has no contacts"),
        ],
        8,
    ),
)
def test_what_cannot_be_drawn_is_refused(arguments: tuple[str, ...], said: str, tmp_path: Path) -> None:
    output = tmp_path / "x.svg"
    assert said in refused("plot", *arguments, "-o", output)
    assert not output.exists()
