"""Scenes of rigid bodies: their matrices, Newton's law, contacts that come and go, and motions with a closed form."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from cpbench import graph
from cpbench.errors import ProblemError, UnknownName
from cpbench.formulations.global_contact import GFCPoint
from cpbench.foundation import matrices
from cpbench.solvers import Budget, solvers
from cpbench.solvers.base import Claim, Solver, SolverOutput, SolverSpec
from cpbench_problems.scenes import motions, stepper
from cpbench_problems.scenes.bodies import BodyScene, families
from cpbench_problems.scenes.simulation import LOCAL, NotSolved, Simulation, scene_of

pytestmark = pytest.mark.needs("cpbench_solvers")

NAMES = families.names()
BY_DAY = ("arch", "chain", "rolling-heap")
"""Of the families, one with blocks, one with joints, one with rolling friction."""
FAMILIES = [name if name in BY_DAY else pytest.param(name, marks=pytest.mark.nightly) for name in NAMES]
STANDING = ("tower", "wall", "arch", "clusters", "trough")
EPS = np.finfo(float).eps


def solve(problem: Any) -> GFCPoint:
    """The automatic choice, to 1e-10."""
    point: Any = solvers.get(f"auto-{problem.node}").run(problem, Budget(tolerance=1e-10)).point
    return point


def solve_any(problem: Any) -> GFCPoint:
    """Also of problems with rolling friction, which are solved in local form."""
    if problem.node == "gfc":
        return solve(problem)
    arrival = graph.arrive(problem, LOCAL[problem.node])
    return graph.lift(arrival.problem, solve(arrival.problem), len(arrival.route.steps))


def made(scene: BodyScene, steps: int) -> list[Any]:
    """The steps, of all of which there are problems and answers in these tests."""
    return list(stepper.run(scene, steps, solve_any))


def exact_rows(scene: BodyScene, step_state: Any, contacts: Any, d: int) -> list[dict[int, Fraction]]:
    """J in rational arithmetic: the velocity that a contact's point has by each unit velocity of a body, by definition.

    v + ω × (p − x), ω = R ω_body, of the first body less that of the second; rolling rows have ω itself.
    """

    def fractions(x: Any) -> list[Fraction]:
        return [Fraction(float(entry)) for entry in x]

    def cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    rows: list[dict[int, Fraction]] = []
    n = len(scene.bodies.mass)
    for c, pair in enumerate(contacts.bodies.tolist()):
        axes = [fractions(row) for row in contacts.frame[c]]
        for k in range(d):
            row: dict[int, Fraction] = {}
            for body, sign in zip(pair, (1, -1), strict=True):
                if body >= n:
                    continue
                point, x = fractions(contacts.position[c]), fractions(step_state.x[body])
                arm = [p - o for p, o in zip(point, x, strict=True)]
                axis = axes[k] if k < 3 else axes[k - 2]
                for i in range(3):
                    turned = fractions(step_state.R[body][:, i])  # ω of a unit spin about principal axis i
                    if k < 3:
                        row[6 * body + i] = sign * axis[i]
                        moved = cross(turned, arm)
                    else:
                        moved = turned
                    row[6 * body + 3 + i] = sign * sum((a * b for a, b in zip(axis, moved, strict=True)), Fraction(0))
            rows.append(row)
    return rows


@pytest.mark.parametrize("name", FAMILIES)
def test_the_delassus_matrix_is_that_of_the_kinematics(name: str) -> None:
    """W of the local twin against J M⁻¹ Jᵀ in rational arithmetic, after a step that turned the bodies."""
    scene = scene_of(name, size=3, mass_ratio=1e3)
    first, second = made(scene, 2)
    problem = second.problem
    J = exact_rows(scene, first.state, problem.contacts, problem.dimension)
    W, M = _without_joints(problem), [Fraction(float(m)) for m in problem.M.diagonal()]
    scale = error = 0.0
    for i, one in enumerate(J):
        for j, other in enumerate(J):
            common = one.keys() & other.keys()
            exact = sum((one[k] * other[k] / M[k] for k in common), Fraction(0))
            error += float(Fraction(float(W[i, j])) - exact) ** 2
            scale += float(sum((abs(one[k] * other[k]) / M[k] for k in common), Fraction(0))) ** 2
    assert scale > 0
    assert math.sqrt(error) <= 8 * EPS * math.sqrt(scale)


def _without_joints(problem: Any) -> np.ndarray:
    free = dataclasses.replace(problem, G=None, b=None) if problem.b.size else problem
    local: Any = graph.arrive(free, LOCAL[problem.node]).problem
    return matrices.dense(local.W)


@pytest.mark.parametrize("name", FAMILIES)
def test_momentum_changes_by_the_loads_and_the_reactions(name: str) -> None:
    """Linear momentum: the force Fᵀr of each contact on one body, and its opposite on the other, added one by one."""
    scene = scene_of(name, size=4)
    before = scene.start.v
    for step in made(scene, 4):
        impulse = scene.dt * scene.force[:, :3]
        r = step.point.r.reshape(-1, step.problem.dimension)[:, :3]
        for pair, frame, reaction in zip(
            step.problem.contacts.bodies.tolist(), step.problem.contacts.frame, r, strict=True
        ):
            for body, sign in zip(pair, (1.0, -1.0), strict=True):
                if body < len(impulse):
                    impulse[body] += sign * frame.T @ reaction
        gained = scene.bodies.mass[:, None] * (step.state.v - before)[:, :3]
        largest = max(np.abs(impulse).max(), scene.dt * np.abs(scene.force).max())
        joints = step.problem.G @ step.point.lam
        np.testing.assert_allclose(gained, impulse + joints.reshape(-1, 6)[:, :3], atol=1e-13 * largest, rtol=0)
        if name == "chain":  # forces in its joints are internal
            np.testing.assert_allclose(gained.sum(axis=0), impulse.sum(axis=0), atol=1e-12 * largest, rtol=0)
        before = step.state.v


@pytest.mark.parametrize("name", STANDING)
def test_the_ground_carries_the_weight_of_what_stands(name: str) -> None:
    scene = scene_of(name, size=6)
    weight = -scene.dt * scene.force[:, 2].sum()
    for step in made(scene, 5):
        ground = step.problem.contacts.bodies[:, 1] >= len(scene.bodies.mass)
        forces = np.einsum("cij,ci->cj", step.problem.contacts.frame, step.point.r.reshape(-1, 3))[ground].sum(axis=0)
        np.testing.assert_allclose(forces, [0.0, 0.0, weight], atol=1e-7 * weight)
        assert np.abs(step.state.x - scene.start.x).max() < 1e-8


def test_joints_of_a_chain_drift_by_no_rounding_of_its_places() -> None:
    """Ends that meet have places that differ in the last digits; a distance of 1e-9 m is one to close within a step."""
    for size in (3, 10, 30):
        scene = scene_of("chain", size=size)
        assert scene.hold is not None
        assert (scene.hold(scene.start)[1] == 0.0).all()
        moved = scene.start.x.copy()
        moved[1, 0] += 1e-9
        drift = scene.hold(dataclasses.replace(scene.start, x=moved))[1].reshape(-1, 3)
        np.testing.assert_allclose(drift[:2, 0], [1e-9 / scene.dt, -1e-9 / scene.dt], rtol=1e-6)
        assert np.count_nonzero(drift) == 2


def test_a_thick_arch_stands_and_a_thin_one_opens() -> None:
    """Milankovitch 1907: thickness 0.1075 of the mean radius is the least; 0.16 and 0.08 here."""
    speeds = {}
    for name in ("arch", "falling-arch"):
        speeds[name] = np.abs(made(scene_of(name, size=15), 6)[-1].state.v).max()
    assert speeds["arch"] < 1e-7
    assert speeds["falling-arch"] > 1e-2


def test_contacts_come_and_go_with_their_ids() -> None:
    """An id is of the same two bodies in all steps; in this heap some come, and in the chain some go."""
    changes = {}
    for name in ("spheres", "chain"):
        ids: list[set[int]] = []
        bodies: dict[int, list[int]] = {}
        for step in made(scene_of(name, size=12, seed=3), 40):
            contacts = step.problem.contacts
            assert len(np.unique(contacts.id)) == contacts.count
            ids.append(set(contacts.id.tolist()))
            for number, pair in zip(contacts.id.tolist(), contacts.bodies.tolist(), strict=True):
                assert bodies.setdefault(number, pair) == pair
        changes[name] = [(len(b - a), len(a - b), len(a & b)) for a, b in pairwise(ids)]
    came, went = (sum(c[k] for c in changes["spheres"]) for k in (0, 1))
    assert came > 5
    assert sum(c[1] for c in changes["chain"]) + went > 0
    assert all(kept > 0 for _, _, kept in changes["spheres"])


@pytest.mark.parametrize("name", NAMES)
def test_the_mass_ratio_is_that_of_the_bodies(name: str) -> None:
    mass = scene_of(name, size=8, mass_ratio=1e7).bodies.mass
    assert mass.max() / mass.min() == pytest.approx(1e7, rel=1e-12)


@pytest.mark.parametrize("make", motions.MOTIONS)
def test_a_motion_follows_its_closed_form(make: Any) -> None:
    motion = make()
    last = made(motion.scene, motion.steps)[-1].state
    assert motion.error(last) < 2e-8


def test_the_rope_is_eytelweins_for_many_knots() -> None:
    """Loads in the ratio e^(μπ) just do not move; a little more moves them, on either side of the formula."""
    for ratio, moves in ((0.99, False), (1.01, True)):
        scene = motions.rope_on_drum(60, 1.0, ratio * math.exp(motions.MU * math.pi))
        last = made(scene, 3)[-1].state
        assert (abs(last.v[0, 2]) > 1e-3) == moves


def test_what_makes_no_scene_is_refused() -> None:
    for name, given, said in (
        ("arch", {"size": 2}, "at least 3 stones"),
        ("tower", {"mu": -0.1}, "mu: is -0.1"),
        ("tower", {"mass_ratio": 0.5}, "mass_ratio: is 0.5"),
        ("tower", {"mu": math.inf}, "mu: is inf"),
    ):
        with pytest.raises(ProblemError, match=said):
            scene_of(name, **given)
    with pytest.raises(UnknownName, match="tower"):
        scene_of("towr")


def test_a_step_without_an_answer_ends_the_simulation(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message has the scene, the step and the solver; the bodies stay where they were."""

    class NoAnswer(Solver):
        """A solver that gives up."""

        spec = SolverSpec(name="gives-up", node="fc", summary="", method="")

        def solve(self, prepared: Any, budget: Budget, options: Any, start: Any = None, record: Any = None) -> Any:
            return SolverOutput(claim=Claim.FAILED, message="gave up")

    solvers.discover()
    monkeypatch.setitem(solvers._items, "gives-up", NoAnswer())
    simulation = Simulation(scene_of("tower", size=2), "gives-up")
    with pytest.raises(NotSolved, match=r"^tower: step 0: gives-up gave no answer \(failed: gave up\)"):
        list(simulation.run(3))
    assert simulation.steps == []


def test_steps_are_solved_on_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sums over several threads have other roundings, and threads that wait for a core keep small products waiting."""
    seen: list[int] = []

    class Asks(Solver):
        """A solver that looks how many threads the libraries of linear algebra have, and gives up."""

        spec = SolverSpec(name="asks", node="fc", summary="", method="")

        def solve(self, prepared: Any, budget: Budget, options: Any, start: Any = None, record: Any = None) -> Any:
            seen.extend(library["num_threads"] for library in threadpool_info())
            return SolverOutput(claim=Claim.FAILED)

    solvers.discover()
    monkeypatch.setitem(solvers._items, "asks", Asks())
    with threadpool_limits(2):
        before = [library["num_threads"] for library in threadpool_info()]
        with pytest.raises(NotSolved):
            list(Simulation(scene_of("tower", size=2), "asks").run(1))
        assert [library["num_threads"] for library in threadpool_info()] == before
    assert max(before) == 2
    assert set(seen) == {1}
