"""Figures of problems: their data against planted states, formulas and independent arithmetic, and each through the
command line with what it cannot draw."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from tiers import some_by_day

from cpbench import storage
from cpbench.analysis.contact_states import State, angle_between, contact_states, forces, most_rubbing
from cpbench.cli import cli
from cpbench.errors import CpbenchError, PointError, ProblemError
from cpbench.formulations import LCP, Contacts, FCPoint, FrictionContact, LCPPoint
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing, find
from cpbench_lab.figures.complementary_cones import complementary_cones, is_p_matrix, lemke_path, solutions

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


def lcp(M: list[list[float]], q: list[float]) -> LCP:
    return LCP(M=np.array(M, dtype=float), q=np.array(q, dtype=float), name="plane")


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
        contact_states(lcp([[1, 0], [0, 1]], [-1, -1]), LCPPoint(np.ones(2)))


def test_forces_turn_with_the_frame() -> None:
    """Normal up and tangents along y, x: a force (N, T1, T2) = (3, 1, 2) is (2, 1, 3) in the scene."""
    frame = np.array([[[0.0, 0, 1], [0, 1, 0], [1, 0, 0]]])
    contacts = Contacts(id=[7], bodies=[[0, 1]], position=np.zeros((1, 3)), frame=frame)
    problem = FrictionContact(W=np.eye(3), q=np.zeros(3), mu=np.array([1.0]), contacts=contacts)
    states = contact_states(problem, FCPoint(r=np.array([3.0, 1.0, 2.0])))
    np.testing.assert_array_equal(forces(states, contacts), [[2.0, 1.0, 3.0]])


def test_the_contact_that_is_shown_rubs_most() -> None:
    problem, point = builtin("gfc/contact-global.h5::bodies-20")
    states = contact_states(problem, point)
    work = [-float(r[1:] @ u[1:]) for r, u in zip(states.r, states.u, strict=True)]
    assert work[most_rubbing(states)] == max(work) > 0


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


# --- cone -----------------------------------------------------------------------------------------------------------


def test_a_wrong_reaction_is_drawn_with_its_angle() -> None:
    from cpbench_lab.pictures.cone import example

    problem = example()
    wrong = FCPoint(r=np.array([1.0, -0.6, 0.0]))
    u = problem.q + wrong.r
    hat = u + np.array([0.6 * np.linalg.norm(u[1:]), 0, 0])
    angle = math.degrees(math.acos(wrong.r @ hat / np.linalg.norm(wrong.r) / np.linalg.norm(hat)))
    assert abs(angle - 90) > 5
    assert f"is at {angle:.1f}° to $r$" in drawn("cone", problem, wrong).guide


@pytest.mark.parametrize("degrees", [0.0, 1e-9, 30.0, 90.0, 180.0 - 1e-9, 180.0])
def test_angles_keep_their_digits(degrees: float) -> None:
    turn = math.radians(degrees)
    assert angle_between(np.array([2.0, 0.0]), np.array([math.cos(turn), math.sin(turn)])) == pytest.approx(
        degrees, abs=1e-12
    )
    assert math.isnan(angle_between(np.zeros(2), np.ones(2)))


# --- LCP ------------------------------------------------------------------------------------------------------------


def brute(M: np.ndarray, q: np.ndarray) -> list[np.ndarray]:
    """Solutions with a nonsingular M_αα, by trying every α."""
    found: list[np.ndarray] = []
    for active in ((), (0,), (1,), (0, 1)):
        z = np.zeros(2)
        F = list(active)
        if F:
            if abs(np.linalg.det(M[np.ix_(F, F)])) < 1e-12:
                continue
            z[F] = np.linalg.solve(M[np.ix_(F, F)], -q[F])
        if z.min() >= -1e-9 and (M @ z + q).min() >= -1e-9 and all(np.abs(z - y).max() > 1e-7 for y in found):
            found.append(z)
    return found


def test_cones_hold_q_where_there_is_a_solution(rng: np.random.Generator) -> None:
    counts = set()
    for _ in range(60):
        M, q = rng.standard_normal((2, 2)), rng.standard_normal(2)
        found, expected = solutions(complementary_cones(lcp(M, q))), brute(M, q)
        assert len(found) == len(expected)
        for z in expected:
            assert min(np.abs(z - y).max() for y in found) < 1e-9
        counts.add(len(found))
    assert {0, 1, 2} <= counts


def test_p_matrices_have_one_solution_and_lemke_finds_it(rng: np.random.Generator) -> None:
    for _ in range(20):
        A = rng.standard_normal((2, 2))
        problem = lcp(A @ A.T + 0.1 * np.eye(2), rng.standard_normal(2))
        assert is_p_matrix(problem)
        (z,) = solutions(complementary_cones(problem))
        path = lemke_path(problem)
        assert not path.ray
        assert np.abs((path.z[-1] if len(path.z) else np.zeros(2)) - z).max() < 1e-9


def test_every_pivot_of_lemke_is_almost_complementary(rng: np.random.Generator) -> None:
    """z ≥ 0, w = Mz + q + z₀e ≥ 0, z_i w_i = 0 for both (at the end z₀ = 0, before it is basic and one pair both 0)."""
    longest = 0
    for _ in range(40):
        M, q = rng.standard_normal((2, 2)), -np.abs(rng.standard_normal(2))
        path = lemke_path(lcp(M, q))
        for k, (z, cover) in enumerate(zip(path.z, path.cover, strict=True)):
            w = M @ z + q + cover
            assert min(z.min(), w.min(), cover) >= -1e-9
            assert np.abs(z * w).max() < 1e-9
            assert (cover > 0) == (path.ray or k < len(path.cover) - 1)
        longest = max(longest, len(path.cover))
    assert longest >= 3


@pytest.mark.parametrize("size", [1.0, 1e6])
def test_cones_hold_what_is_nine_digits_from_them(size: float) -> None:
    """All cones of M = −I are the quadrant, from which q = (1, −δ) is δ away."""
    near, far = (complementary_cones(lcp([[-1, 0], [0, -1]], [size, -size * away])) for away in (0.9e-9, 1.1e-9))
    assert len(solutions(near)) == 2
    assert not solutions(far)


@pytest.mark.parametrize(
    ("M", "q"),
    some_by_day(
        [
            ([[2, 1], [1, 2]], [-5, -6]),
            ([[1, 2], [3, 1]], [-1, -1]),
            ([[-1, 0], [0, -1]], [-1, -2]),
            ([[1, -1], [-1, 1]], [-2, 1]),
            ([[0, 1], [-1, 0]], [-1, 2]),
            ([[0, 0], [0, 0]], [-1, 0]),
            ([[0, 0], [0, 0]], [0, 0]),
            ([[1e8, 0], [0, 1e-8]], [-1e-6, -1]),
        ],
        1,
    ),
)
def test_the_plane_is_drawn_whatever_the_matrix(M: list[list[float]], q: list[float], tmp_path: Path) -> None:
    drawing = drawn("lcp-cones", lcp(M, q))
    circles = [line for line in drawing.figure.axes[1].lines if line.get_markersize() == 8]
    assert len(circles) == len(solutions(complementary_cones(lcp(M, q))))
    with canvas.drawing():
        canvas.write(drawing, tmp_path / "x.svg")
    ET.parse(tmp_path / "x.svg")


# --- the command ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "said"),
    some_by_day(
        [
            (("conee",), "did you mean cone"),
            (("cone", "builtin/rfc/rolling.h5::planted-12"), "this is rfc of dimension 5"),
            (("cone", "builtin/fc/contact-planted-2d.h5::full-rank-2d-5"), "this is fc of dimension 2"),
            (("cone", "builtin/lcp/lcp-classics.h5::munson1"), "this is lcp"),
            (("cone", "-p", "contact=3"), "there is no contact 3; there are 1"),
            (("cone", "-p", "facets=5"), "opposite pairs"),
            (("cone", "--answer", "r.npy"), "give its FILE too"),
            (("lcp-cones", "builtin/lcp/lcp-classics.h5::murty-10", "--answer", "r.npy"), "lcp-cones shows none"),
            (("contact", f"{PLANTED}::one-open", "--node", "lcp"), "--node: a figure of problems"),
            (("cone", "-p", "sides=3"), "unknown parameter of cone, in -p NAME=VALUE 'sides'"),
            (("cone", "-p", "contact=first"), "'first' is not a valid integer"),
            (("contact",), "Missing argument 'FILE'"),
            (("contact", "builtin/fc/contact-planted-3d.h5::one-open", "-p", "view=zz"), "one of xy, xz, yz"),
            (("contact", "builtin/fc/contact-planted-3d.h5::one-open", "-p", "view=xy"), "no positions"),
            (("contact", "builtin/lcp/lcp-planted.h5::spd-20"), "has no contacts"),
            (("lcp-cones", "builtin/lcp/lcp-classics.h5::murty-10"), "n = 2, this lcp has n = 10"),
            (("lcp-cones", f"{PLANTED}::one-open"), "this is fc"),
        ],
        8,
    ),
)
def test_what_cannot_be_drawn_is_refused(arguments: tuple[str, ...], said: str, tmp_path: Path) -> None:
    output = tmp_path / "x.svg"
    assert said in refused("plot", *arguments, "-o", output)
    assert not output.exists()
