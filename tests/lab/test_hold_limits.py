"""`cpbench sweep --bisect`: least friction and largest load against laws by hand; proofs checked from the numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import cpbench as command
from flint import fmpq

import cpbench
from cpbench.errors import ProblemError
from cpbench.formulations import LCP, FrictionContact, GlobalFrictionContact
from cpbench_lab.certificates.hold_programs import Balance
from cpbench_lab.certificates.holding import balance_of, forces_hold, held, motion_gains
from cpbench_lab.hold_limits import hold_limit

Rationals = Sequence[Any]


def capstan(pegs: int, angle: float, mu: float, arcs: bool) -> tuple[GlobalFrictionContact, Any]:
    """A rope that turns by `angle` over pegs, held by the tension 1 at one end; and the pull at the other.

    At each peg there is a massless bead; the rope between two is a contact without friction, whose force is its
    tension. With `arcs` the coefficient at a peg is that by which it holds as much as the arc of rope on it, e^(μφ).
    """
    turn = angle / pegs
    along = [np.array([math.cos(k * turn), -math.sin(k * turn)]) for k in range(pegs + 1)]
    H = np.zeros((2 * pegs, 2 * (2 * pegs - 1)))
    coefficient = math.tanh(0.5 * mu * turn) / math.tan(0.5 * turn) if arcs else mu
    for k in range(pegs):
        tangent = (along[k] + along[k + 1]) / np.linalg.norm(along[k] + along[k + 1])
        H[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = np.column_stack([[-tangent[1], tangent[0]], tangent])
    for k in range(1, pegs):
        frame = np.column_stack([along[k], [-along[k][1], along[k][0]]])
        at = 2 * (pegs + k - 1)
        H[2 * k - 2 : 2 * k, at : at + 2], H[2 * k : 2 * k + 2, at : at + 2] = frame, -frame
    f, pull = np.zeros((2, 2 * pegs))
    f[:2], pull[-2:] = -along[0], along[-1]
    friction = np.append(np.full(pegs, coefficient), np.zeros(pegs - 1))
    return GlobalFrictionContact(M=np.eye(2 * pegs), H=H, f=f, w=np.zeros(H.shape[1]), mu=friction, dimension=2), pull


def block(force: Sequence[float], mu: float = 0.5) -> GlobalFrictionContact:
    """A block on four feet; the force acts at its centre, half as high as it is wide."""
    H = np.zeros((6, 12))
    for c, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        for k, direction in enumerate(([0, 0, 1], [1, 0, 0], [0, 1, 0])):
            H[:3, 3 * c + k] = direction
            H[3:, 3 * c + k] = np.cross([x, y, -0.5], direction)
    load = np.concatenate([force, np.zeros(3)])
    return GlobalFrictionContact(M=np.eye(6), H=H, f=load, w=np.zeros(12), mu=np.full(4, mu), name="block")


def checked(problem: Any, f: Any, mu: Any, proof: Rationals, holds: bool) -> bool:
    """A proof by its definition, with matrices of fractions: no code of cpbench."""
    proof = [Fraction(str(value)) for value in proof]
    A = [[Fraction(value) for value in row] for row in np.asarray(problem.H if problem.node == "gfc" else problem.W)]
    load = [Fraction(float(value)) for value in f]
    d = problem.dimension
    if holds:
        sums = [sum((a * r for a, r in zip(row, proof, strict=True)), Fraction(0)) for row in A]
        parts = [proof[c : c + d] for c in range(0, len(proof), d)]
        fits = (
            r[0] >= 0 and sum(t * t for t in r[1:]) <= (Fraction(float(m)) * r[0]) ** 2
            for r, m in zip(parts, mu, strict=True)
        )
        return all(s + b == 0 for s, b in zip(sums, load, strict=True)) and all(fits)
    u = [sum((A[i][j] * v for i, v in enumerate(proof)), Fraction(0)) for j in range(len(A[0]))]
    parts = [u[c : c + d] for c in range(0, len(u), d)]
    fits = (
        x[0] >= 0 and Fraction(float(m)) ** 2 * sum(t * t for t in x[1:]) <= x[0] ** 2
        for x, m in zip(parts, mu, strict=True)
    )
    return sum(a * b for a, b in zip(load, proof, strict=True)) > 0 and all(fits)


@pytest.mark.parametrize(
    ("pegs", "angle", "mu"), [(1, 1.0, 0.3), (6, math.pi, 0.3), pytest.param(20, 7.0, 0.2, marks=pytest.mark.nightly)]
)
def test_a_rope_on_pegs_holds_up_to_the_law_of_the_capstan(pegs: int, angle: float, mu: float) -> None:
    """Euler and Eytelwein: e^(μθ)."""
    problem, pull = capstan(pegs, angle, mu, arcs=True)
    limit = hold_limit(problem, pull, width=2e-7)
    assert limit.narrow
    assert limit.holding <= math.exp(mu * angle) * (1 + 1e-12)
    assert limit.moving >= math.exp(mu * angle) * (1 - 1e-12)
    assert limit.holding == pytest.approx(math.exp(mu * angle), rel=1e-6)
    assert (limit.at_holding.proved, limit.at_moving.proved) == (True, True)
    for value, at in ((limit.holding, limit.at_holding), (limit.moving, limit.at_moving)):
        proof = at.forces if at.holds else at.motion
        assert checked(problem, problem.f + value * pull, problem.mu, proof, bool(at.holds))


@pytest.mark.parametrize(("down", "along"), [(4.0, (3.0, 0.0)), (1.0, (0.6, 0.8)), (2.0, (0.1, 0.7))])
def test_a_block_on_an_incline_needs_the_tangent(down: float, along: tuple[float, float]) -> None:
    problem = block([*along, -down])
    limit = hold_limit(problem, width=1e-6)
    tangent = math.hypot(*along) / down
    assert limit.holding == pytest.approx(tangent, rel=1e-6)
    assert limit.moving <= tangent * (1 + 1e-12)
    for value, at in ((limit.holding, limit.at_holding), (limit.moving, limit.at_moving)):
        assert at.proved
        assert checked(problem, problem.f, np.full(4, value), at.forces if at.holds else at.motion, bool(at.holds))


def test_a_local_problem_and_the_load_of_a_factor() -> None:
    """u = r + q, weight 4, push 1 + 2λ, μ = 3/4: λ = 1."""
    problem = FrictionContact(W=np.eye(2), q=[-4.0, 1.0], mu=[0.75], dimension=2)
    limit = hold_limit(problem, np.array([0.0, 2.0]), width=1e-9)
    assert limit.holding == pytest.approx(1.0, rel=1e-8)
    assert limit.at_holding.proved
    assert limit.at_moving.proved


def test_joints_bear_what_contacts_do_not() -> None:
    """A joint along the tangent holds any push, one along the normal none."""
    parts = {"M": np.eye(2), "H": np.eye(2), "f": [9.0, 0.0][::-1], "w": np.zeros(2), "mu": [0.5], "dimension": 2}
    held_up = GlobalFrictionContact(**{**parts, "f": [-1.0, 9.0]}, G=[[0.0], [1.0]])
    sliding = GlobalFrictionContact(**{**parts, "f": [-1.0, 9.0]}, G=[[1.0], [0.0]])
    assert (held(balance_of(held_up)).holds, held(balance_of(held_up)).proved) == (True, True)
    limit = hold_limit(sliding)
    assert limit.name == "mu"  # the joint presses: N may be as large as friction needs


def test_false_forces_and_motions_are_no_proof() -> None:
    """Of a block that μ = 0.76 holds and 0.74 does not: a sum, a cone or a sign that is wrong."""
    stays, slides = (balance_of(block([3.0, 0.0, -4.0], mu=mu)) for mu in (0.76, 0.74))
    forces, motion = held(stays).forces, held(slides).motion
    assert forces_hold(stays, forces)
    assert motion_gains(slides, motion)
    assert not forces_hold(stays, [forces[0] + fmpq(1, 10**30), *forces[1:]])
    assert not motion_gains(slides, [fmpq(0)] * 6)
    assert not forces_hold(slides, forces)
    assert not motion_gains(stays, motion)
    assert not forces_hold(stays, [-value for value in forces])
    assert not motion_gains(slides, [-value for value in motion])


@pytest.mark.parametrize(("room", "answer"), [(1.5e-9, True), (0.7e-9, None)])
def test_what_no_proof_is_found_for_needs_a_clear_margin(room: float, answer: bool | None) -> None:
    """Three rows that rounding makes contradict each other: no forces are exact. Normal 1, tangent 1/2 − room."""
    tangent = 0.5 - room
    A = np.array([[1.0, 0.0], [0.0, 1.0], [0.1, 0.3]])
    f = -A @ [1.0, tangent]
    f[2] = np.nextafter(f[2], 0.0)
    found = held(Balance(cpbench.foundation.matrices.sparse(A), f, np.array([0.5]), 2))
    assert (found.holds, found.proved) == (answer, False)


@pytest.mark.parametrize(
    ("problem", "load", "error", "cause"),
    [
        (LCP(M=[[1.0]], q=[1.0]), None, ProblemError, "has no hold limit: that is of fc and gfc"),
        (block([3.0, 0.0, -4.0]), np.zeros(3), ProblemError, "load: has 3 numbers, expected 6 as gfc.f has"),
    ],
)
def test_what_has_no_limit_is_refused(problem: Any, load: Any, error: type[Exception], cause: str) -> None:
    with pytest.raises(error, match=cause):
        hold_limit(problem, load)


def test_coefficients_of_joints_are_none_of_contacts() -> None:
    joint = cpbench.formulations.base.Info(properties={"joints": "contact 0: friction of joint elbow"})
    problem = FrictionContact(W=np.eye(2), q=[-4.0, 3.0], mu=[0.5], dimension=2, info=joint)
    with pytest.raises(ProblemError, match=r"mu: is not of contacts alone: contact 0: friction of joint elbow"):
        hold_limit(problem)


@pytest.mark.parametrize(
    ("problem", "load", "answer", "proved"),
    [
        (block([0.0, 0.0, -4.0]), None, "held without friction: any mu >= 0 holds", (True, False)),
        (block([0.0, 0.0, 4.0]), None, "no mu holds, however large", (False, True)),
        (block([0.0, 0.0, 4.0]), np.eye(6)[0], "no factor >= 0 holds", (False, True)),
        (block([0.0, 0.0, -4.0]), -np.eye(6)[2], "holds at any load: every factor", (True, False)),
        (block([0.0, 0.0, 4.0]), -2 * np.eye(6)[2], "holds at any load: every factor from 2", (True, False)),
        (block([2.0, 0.0, -4.0]), np.eye(6)[0], "no factor above 0 holds", (True, False)),
    ],
)  # fmt: skip
def test_what_has_no_limit_is_an_answer(problem: Any, load: Any, answer: str, proved: tuple[bool, bool]) -> None:
    limit = hold_limit(problem, load)
    assert limit.answer.startswith(answer)
    assert limit.narrow
    assert (
        bool(limit.at_holding and limit.at_holding.proved),
        bool(limit.at_moving and limit.at_moving.proved),
    ) == proved


def pinched(force: float) -> GlobalFrictionContact:
    """A block between two walls, which press it as hard as they like."""
    H = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
    return GlobalFrictionContact(M=np.eye(2), H=H, f=[0.0, -force], w=np.zeros(4), mu=[0.5, 0.5], dimension=2)


def test_a_limit_that_is_not_attained_is_said_to_be_none() -> None:
    limit = hold_limit(pinched(3.0))
    assert limit.answer == "any mu > 0 holds; mu = 0 does not"
    assert limit.record()["does not hold"]["value"] == 0.0
    assert limit.at_holding.proved


def test_rounding_decides_at_a_corner() -> None:
    """All of a weight of 600 is over the foot at (0.11, -0.06): 36 and 66 are its moments up to a rounding."""
    H, corners = np.zeros((6, 12)), ((0.11, -0.06), (-0.11, -0.06), (0.11, 0.06), (-0.11, 0.06))
    for c, (x, y) in enumerate(corners):
        for k, direction in enumerate(([0, 0, 1], [1, 0, 0], [0, 1, 0])):
            H[:, 3 * c + k] = np.append(direction, np.cross([x, y, 0], direction))
    problem = GlobalFrictionContact(M=np.eye(6), H=H, f=[0, 0, -600, -36, 66, 0], w=np.zeros(12), mu=np.full(4, 0.5))
    limit = hold_limit(problem)
    assert limit.answer.startswith("by rounding alone: undecided; at mu = 0 forces balance the load to")
    assert limit.narrow


def test_contacts_that_move_by_themselves_are_refused() -> None:
    problem = GlobalFrictionContact(M=np.eye(2), H=np.eye(2), f=[-1.0, 0.0], w=[0.0, 0.5], mu=[0.5], dimension=2)
    with pytest.raises(ProblemError, match=r"gfc\.w: is 0\.5 somewhere, expected 0"):
        hold_limit(problem)


def test_the_command(tmp_path: Path) -> None:
    cpbench.save(block([3.0, 0.0, -4.0]), tmp_path / "block.h5")
    np.save(tmp_path / "push.npy", -np.eye(6)[0])
    done = command(tmp_path, "sweep", "block.h5", "--over", "mu", "--bisect")
    assert done.returncode == 0
    first, holds, moves, meaning = done.stdout.splitlines()
    assert "it may move as well, as `cpbench solve` then says" in meaning
    assert first.startswith("block (gfc): least friction that holds: mu = 0.75")
    assert "proved: forces in rational arithmetic" in holds
    assert "proved: a motion" in moves
    record = json.loads(command(tmp_path, "sweep", "block.h5", "--load", "push.npy", "--bisect", "--json").stdout)
    assert record["holds"]["value"] == pytest.approx(5.0, rel=1e-6)  # 3 − λ from 2 to −2
    forces = [Fraction(text) for text in record["holds"]["forces"]]
    problem = block([3.0, 0.0, -4.0])
    assert checked(problem, problem.f + record["holds"]["value"] * -np.eye(6)[0], problem.mu, forces, True)


@pytest.mark.parametrize(
    "arguments",
    [["--over", "mu"], ["--bisect"], ["--over", "mu=1|2", "--bisect"], ["--load", "push.npy"], [],
     ["--over", "mu", "--load", "push.npy", "--bisect"]],
)  # fmt: skip
def test_options_that_do_not_go_together(tmp_path: Path, arguments: list[str]) -> None:
    cpbench.save(block([3.0, 0.0, -4.0]), tmp_path / "block.h5")
    done = command(tmp_path, "sweep", "block.h5", *arguments)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
