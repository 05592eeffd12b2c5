"""Arrays of engines: M and J of a step, one coefficient for all contacts, orders of rows, joints in one matrix."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cpbench
from cpbench.errors import FormatError
from cpbench.formulations import GlobalFrictionContact

ORDER = {"NTT": [0, 1, 2], "TTN": [1, 2, 0]}
DT = 0.01


def step(order: str = "NTT", turn: float = 0.3) -> dict[str, Any]:
    """A box of 2 kg that slides on a floor on four corners; rows in an order."""
    c, s = np.cos(turn), np.sin(turn)
    frame = np.array([[0.0, 0, 1], [c, s, 0], [-s, c, 0]])
    corners = [(x, y, -0.05) for x in (-0.15, 0.15) for y in (-0.1, 0.1)]
    J = np.array([[np.append(d, np.cross(p, d)) for d in frame] for p in corners])
    J = np.vstack([J[:, 0], J[:, 1:].reshape(-1, 6)]) if order == "N..NT..T" else J[:, ORDER[order]].reshape(-1, 6)
    M, tau = np.diag([2.0, 2, 2, 0.008, 0.017, 0.022]), np.array([0.0, 0, -19.62, 0, 0, 0])
    return {"M": M, "J": J, "v": np.array([0.4, 0.1, 0, 0, 0, 0.5]), "tau": tau, "dt": DT, "mu": 0.5 * np.ones(4)}


def read(tmp_path: Path, arrays: dict[str, Any]) -> Any:
    np.savez(tmp_path / "step.npz", **arrays)
    return cpbench.load(tmp_path / "step.npz")


@pytest.mark.parametrize("order", ["NTT", "TTN", "N..NT..T"])
@pytest.mark.parametrize("said", [True, False])
def test_a_step_is_the_same_in_every_order(tmp_path: Path, order: str, said: bool) -> None:
    given = step()
    wanted = GlobalFrictionContact(
        M=given["M"], H=given["J"].T, f=given["M"] @ given["v"] + DT * given["tau"], w=np.zeros(12), mu=given["mu"]
    )
    more = {"order": order} if said else {"v": np.array([0.4, 0.4, 0, 0, 0, 0])}
    if not said:  # all move along the positive tangents: the loads press on the normals alone
        wanted = GlobalFrictionContact(
            M=given["M"], H=given["J"].T, f=given["M"] @ more["v"] + DT * given["tau"], w=np.zeros(12), mu=given["mu"]
        )
    assert read(tmp_path, step(order) | more).fingerprint == wanted.fingerprint


def test_what_the_numbers_do_not_decide_is_asked_for(tmp_path: Path) -> None:
    """Both a normal and a tangent close, or 12 rows that are 4 contacts in space or 6 in a plane."""
    with pytest.raises(FormatError, match=r"order: is missing: the rows of J may be NTT or TTN; add an array order"):
        read(tmp_path, step() | {"v": np.array([-0.4, -0.4, 0, 0, 0, 0])})
    with pytest.raises(
        FormatError, match=r"mu: is one number for all contacts, 6 contacts of 2 rows or 4 contacts of 3"
    ):
        read(tmp_path, step() | {"mu": 0.5, "J": step()["J"] * np.arange(1.0, 7.0)})  # no frames
    sliding = {"mu": 0.5, "v": np.array([0.4, 0.4, 0, 0, 0, 0])}
    assert (read(tmp_path, step() | sliding).dimension, read(tmp_path, step("N..NT..T") | sliding).nc) == (3, 4)
    assert read(tmp_path, step() | {"mu": 0.5, "order": "NTT"}).nc == 4
    assert read(tmp_path, step() | {"mu": 0.5, "phi": np.zeros(4), "order": "NTT"}).nc == 4
    with pytest.raises(FormatError, match=r"dt: is 0, expected a time step > 0 beside tau and phi"):
        read(tmp_path, {name: value for name, value in step().items() if name != "dt"})
    with pytest.raises(FormatError, match=r"order: is NNT, expected NTT, TTN or N\.\.NT\.\.T for 3 rows of a contact"):
        read(tmp_path, step() | {"order": "NNT"})


@pytest.mark.needs("cpbench_solvers")
def test_gaps_and_restitution(tmp_path: Path) -> None:
    """w_N = phi/dt, of both signs; e u_N⁻ where the contact closes within the step."""
    fall = {"v": np.array([0, 0, -1.0, 0, 0, 0]), "phi": np.array([0.005, -0.001, 0.02, 0.0])}
    assert read(tmp_path, step() | fall).w[::3] == pytest.approx([0.5, -0.1, 2.0, 0.0])
    bounced = read(tmp_path, step() | fall | {"restitution": 0.6})
    assert bounced.w[::3] == pytest.approx([-0.6, -0.6, 2.0, -0.6])
    after = cpbench.solve(read(tmp_path, step() | {"v": fall["v"], "restitution": 0.6}))
    assert after.point.arrays()["v"][2] == pytest.approx(0.6)  # Newton: u_N⁺ = −e u_N⁻


@pytest.mark.parametrize("node", ["fc", "gfc"])
def test_one_coefficient_and_orders_of_other_forms(tmp_path: Path, node: str) -> None:
    given, grouped = step(), step("N..NT..T")

    def arrays(of: dict[str, Any]) -> dict[str, Any]:
        inverse, f = np.linalg.inv(of["M"]), of["M"] @ of["v"] + DT * of["tau"]
        if node == "gfc":
            return {"M": of["M"], "H": of["J"].T, "f": f, "w": np.zeros(12), "mu": of["mu"]}
        return {"W": of["J"] @ inverse @ of["J"].T, "q": of["J"] @ inverse @ f, "mu": of["mu"]}

    wanted = read(tmp_path, arrays(given))
    assert read(tmp_path, arrays(given) | {"mu": 0.5, "dimension": 3}).fingerprint == wanted.fingerprint
    assert read(tmp_path, arrays(grouped) | {"order": "N..NT..T"}).fingerprint == wanted.fingerprint
    if node == "gfc":
        return
    assert "N, T, T of each contact" in wanted.info.properties["note"]
    for order, why in (
        ("N..NT..T", r"has contacts of condition [\d.]+, NTT 1e\+16"),
        ("TTN", "closes all 4 contacts by q"),
    ):
        with pytest.raises(FormatError, match=rf"W: may have other rows: the order {order} {why}"):
            read(tmp_path, arrays(step(order, 0.0) | {"v": np.array([0.4, 0.1, 0, 0, 0, 0])}))


def test_a_square_J_is_not_taken_for_H(tmp_path: Path) -> None:
    given = step()
    rest = {"M": given["M"], "f": np.ones(6), "w": np.zeros(6), "mu": 0.5 * np.ones(2)}
    with pytest.raises(
        FormatError, match=r"H: is square, and its rows, not its columns, are frames of contacts: H is Jᵀ"
    ):
        read(tmp_path, rest | {"H": given["J"][:6]})
    assert "not as J" in read(tmp_path, rest | {"H": given["J"][:6].T}).info.properties["note"]


@pytest.mark.parametrize("joints", [np.array(2), np.array([3, 7])])
def test_joints_in_a_delassus_matrix(tmp_path: Path, joints: Any) -> None:
    rng = np.random.default_rng(4)
    A = rng.standard_normal((8, 9))
    W, q = A @ A.T, rng.standard_normal(8)
    first = np.arange(2) if joints.ndim == 0 else joints
    rest = np.setdiff1d(np.arange(8), first)
    made = read(tmp_path, {"W": W, "q": q, "mu": np.array([0.5, 0.3]), "joints": joints})
    assert (made.node, made.nc) == ("fcm", 2)
    np.testing.assert_array_equal(made.V, W[np.ix_(rest, first)])
    np.testing.assert_array_equal(made.s, q[first])
