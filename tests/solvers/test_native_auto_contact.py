"""The automatic choice on frictional contact: policy, accelerated sweeps against plain NumPy, twice the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import planted
import planted_contact
import pytest
import scipy.sparse as sp

from cpbench import storage
from cpbench.formulations import FCPoint, FrictionContact
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.contact.members import PlainMember
from cpbench_solvers.contact.policy import PATIENCE, TurnProgress, factor_entries
from cpbench_solvers.contact.sweeps import AcceleratedSweeps, BlockRows, Sweeps, block_rows, scaled_contacts
from cpbench_solvers.kernels import anderson

DUE = {"newton": 1e8, "admm": 3e8}
"""Ten thousand and thirty thousand sweeps of 10 us."""


@pytest.mark.parametrize(
    ("errors", "first"),
    [
        ((1e-2, 1e-4, 1e-6), True),  # as fast again: a few hundred sweeps of 10 us
        ((1e-1, 3e-2, 3e-2), True),  # they may stand still for a while
        ((1e-1, 3e-2, 3e-2, 3e-2, 3e-2), False),
    ],
)
def test_sweeps_that_stand_still_for_long_wait(errors: tuple[float, ...], first: bool) -> None:
    sweeps = TurnProgress(1e7, 1e7, lull=4.5e7)
    for error in errors:
        sweeps.note(1e7, error)
        sweeps.rest()
    assert (sweeps.due(1e-8) < DUE["newton"]) is first


def test_a_rate_foretells_the_work_that_is_left() -> None:
    steady, stalled = TurnProgress(6e6, 4e6), TurnProgress(6e6, 4e6)
    for k in range(4):
        steady.note(1e6, 10.0 ** -(k + 1))
        stalled.note(1e6, 1e-3)
    for one in (steady, stalled):
        one.rest()
    stalled.note(4e6, 1e-3)
    stalled.rest()
    assert steady.due(1e-6) == pytest.approx(2e6)
    assert stalled.due(1e-6) == PATIENCE * 16e6


def test_whatever_fails_all_come_again() -> None:
    """Without any progress all go on in turn, each with about as much work as the others."""
    methods = {name: TurnProgress(work, work) for name, work in (DUE | {"sweeps": 5e5}).items()}
    for _ in range(60):
        one = min(methods.values(), key=lambda one: one.due(1e-8))
        one.note(one.turn - one.spent, 2.0)
        one.rest()
    work = [one.spent for one in methods.values()]
    assert max(work) < 4 * min(work)


def plain(rows: BlockRows, sweeps: int) -> np.ndarray:
    """Anderson's acceleration in NumPy: least squares by `lstsq`, a sweep by `Sweeps`."""
    problem, one = rows.problem, Sweeps(rows)
    weight = np.repeat(1.0 / np.sqrt(problem.rho), problem.dimension)
    r = np.zeros(problem.q.size)
    g_old = f_old = r
    moves: list[np.ndarray] = []
    changes: list[np.ndarray] = []
    for k in range(1, sweeps + 1):
        g = r.copy()
        one.sweep(g, 1, 0.0)
        f = weight * (g - r)
        if k > 1:
            moves.append(g - g_old)
            changes.append(f - f_old)
        g_old, f_old, r = g, f, g
        if changes and k % anderson.PERIOD == 0:
            gamma = np.linalg.lstsq(np.array(changes).T, f, rcond=None)[0]
            r = g - gamma @ np.array(moves)
    return r


@pytest.mark.parametrize("dimension", [2, 3])
def test_accelerated_sweeps_are_those_of_plain_numpy(rng: np.random.Generator, dimension: int) -> None:
    problem, _ = planted.fc(rng, 10, dimension, "positive definite")
    rows = block_rows(problem)
    accelerated = AcceleratedSweeps(rows)
    accelerated.sweep(3, 1e-300)
    accelerated.sweep(3, 1e-300)  # goes on where it was
    state = accelerated._work[1 : anderson.MEASURED].view(np.int64)
    assert state[anderson.REJECTED] == 0, "every step was followed"
    r = accelerated._work[anderson.ANSWER + problem.q.size :][: problem.q.size]  # the next iterate
    np.testing.assert_allclose(r, plain(rows, 6), rtol=1e-6, atol=1e-9)
    assert accelerated.done == 6


def test_what_is_no_number_stops_the_sweeps() -> None:
    rows = block_rows(FrictionContact(W=np.eye(6) + 10.0, q=np.full(6, -1.0), mu=[0.5, 0.5]))
    accelerated = AcceleratedSweeps(rows, np.full(6, np.nan))
    assert not accelerated.sweep(100, 1e-8)
    assert accelerated.done == 1


@pytest.mark.parametrize(("tolerance", "most"), [(1e-4, 5_000), (1e-8, 7_000)])
def test_a_scene_on_which_acceleration_stands_still_is_solved(shared_data: Path, tolerance: float, most: int) -> None:
    """`nsgs` needs 1,710 and 5,034 sweeps; accelerated ones stand still at 3e-4, and Newton steps cost more."""
    problem = storage.load(shared_data / "fc3d_local" / "mj_soup60_mu08-nc140.hdf5")
    output = solvers.get("auto-fc").run(problem, Budget(tolerance=tolerance))
    assert judge(problem, output.point, tolerance).solved
    assert output.counters["newton_steps"] == 0
    assert output.counters["sweeps"] <= most


def test_plain_sweeps_foretell_when_they_are_done(shared_data: Path) -> None:
    """On that scene, where the error falls at a steady rate, they are asked again before others have had as much."""
    problem = storage.load(shared_data / "fc3d_local" / "mj_soup60_mu08-nc140.hdf5")
    member = PlainMember(scaled_contacts(problem), np.zeros(problem.q.size))
    member.begin(np.zeros(problem.q.size))
    assert member.progress.due(1e-4) == 1200 * member.cost
    for _ in range(3):
        spent = member.spent
        member.advance(100_000, np.inf, 1e-4)
        member.progress.note(member.spent - spent, problem.residuals(FCPoint(member.r)).error)
        member.progress.rest()
    assert member.steps == 1200
    assert 1200 < (member.spent + member.progress.due(1e-4)) / member.cost < 2400
    member.advance(100_000, np.inf, 1e-4)
    assert problem.residuals(FCPoint(member.r)).error <= 1e-4


@pytest.mark.parametrize("node", ["fc 2", "fc 3", "rfc", "gfc"])
def test_where_no_contact_closes_nothing_is_prepared(rng: np.random.Generator, node: str) -> None:
    """r = 0 solves it exactly where every free velocity is q_N ≥ 0; the least that closes is solved as before."""
    problem: Any
    if node == "gfc":
        problem, _ = planted_contact.gfc(rng, 3, 4, 2, 3, sparse=False)
        name, given, free = "w", problem.w, problem.free_velocity
    else:
        rolling = node == "rfc"
        problem, _ = planted_contact.rfc(rng, 5, 5, sparse=False) if rolling else planted.fc(rng, 5, int(node[-1]))
        name, given, free = "q", problem.q, problem.q
    d, raised = problem.dimension, given.copy()
    raised[::d] += np.abs(free[::d]) - free[::d] + 1e-3
    for less, at_once in ((0.0, True), (abs(free[0]) + 2e-3, False)):
        raised[0] -= less
        other = replace(problem, **{name: raised.copy()})
        output = solvers.get(f"auto-{other.node}").run(other, Budget(tolerance=1e-8))
        assert output.claim is Claim.SOLVED
        assert judge(other, output.point, 1e-8).solved
        assert (not output.point.r.any() and output.counters["iterations"] == 0) is at_once


def test_entries_of_factors_are_counted_before_they_are_made() -> None:
    """A chain has no fill, whatever the order in which it is numbered; a ring has one for each contact but three."""
    nc, order = 60, np.random.default_rng(1).permutation(60)
    for closed, edges in ((0.0, nc - 1), (1.0, nc + nc - 3)):
        links = sp.diags_array([np.ones(nc - 1), [closed]], offsets=[1, nc - 1], shape=(nc, nc))
        graph = sp.csr_array(links + links.T + 4.0 * sp.eye_array(nc))[order][:, order]
        W = sp.csr_array(sp.kron(graph, np.eye(3) + 0.1))
        rows = block_rows(FrictionContact(W=W, q=-np.ones(3 * nc), mu=np.full(nc, 0.5)))
        assert factor_entries(rows) == 9 * (nc + 2 * edges)


def test_members_go_on_where_norms_hide_an_error() -> None:
    """Two cubes, the upper one 10⁶ times as heavy: the first answer within the tolerance by norms has velocities that
    are off by more than the free ones. Members that were nearly done go on; they began again, and took ten times."""
    problem = heavy_on_light(1e6)
    output = solvers.get("auto-fc").run(problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED
    assert judge(problem, output.point, 1e-6).solved
    assert output.counters["iterations"] < 4_000  # 11,946 before


def heavy_on_light(ratio: float) -> FrictionContact:
    """Return a cube of 1 kg on the ground under one of `ratio` kg, four contacts each, after 10 ms of free fall."""
    rows = []
    corners = [np.array([x, y, -0.5]) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    for lower in (False, True):
        for at in corners:
            for axis in ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
                upper = np.concatenate([axis, np.cross(at, axis)])
                beneath = np.concatenate([axis, np.cross(at + np.array([0.0, 0.0, 1.0]), axis)])
                rows.append(np.concatenate([-beneath, upper] if lower else [upper, np.zeros(6)]))
    H = np.array(rows)
    inverse = np.concatenate([np.repeat([1.0, 6.0], 3), np.repeat([1.0, 6.0], 3) / ratio])
    v = np.random.default_rng(0).normal(scale=1e-3, size=12)
    v[[2, 8]] -= 0.0981
    return FrictionContact(W=(H * inverse) @ H.T, q=H @ v, mu=np.full(8, 0.5))
