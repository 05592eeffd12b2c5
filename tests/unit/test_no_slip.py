"""mu = inf: refused as Coulomb friction, with the formulations that state a contact without slip."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import planted
import planted_contact
import pytest
from command_line import cpbench as command

import cpbench
from cpbench import storage
from cpbench.errors import ProblemError
from cpbench.formulations import (
    MLCP,
    ConeQP,
    ConeQPPoint,
    FCPoint,
    FrictionContact,
    GlobalFrictionContact,
    MixedFrictionContact,
)
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge

N, T = [0, 3], [1, 2, 4, 5]
"""Normal and tangential rows of two contacts in space."""


def pressed() -> tuple[FrictionContact, np.ndarray]:
    """Planted: two contacts that stick under reactions (3, ±1, ...) at friction 0.9, W positive definite."""
    A = np.random.default_rng(3).standard_normal((6, 6))
    W, r = A @ A.T + np.eye(6), np.array([3.0, 1.0, -1.0, 2.0, -0.5, 1.0])
    return FrictionContact(W=W, q=-W @ r, mu=[0.9, 0.9]), r


@pytest.mark.needs("cpbench_solvers")
def test_a_contact_that_never_slips_is_stated_by_fcm_and_mlcp_as_the_message_says() -> None:
    fc, r = pressed()
    assert judge(fc, FCPoint(r), 1e-12).solved, "it sticks, so that no larger friction changes it"
    W, q = np.asarray(fc.W), fc.q
    mixed = MixedFrictionContact(W=W, V=W[:, T], R=W[np.ix_(T, T)], q=q, s=q[T], mu=np.zeros(2))
    found = cpbench.solve(mixed, tolerance=1e-10)
    np.testing.assert_allclose(found.point.lam, r[T], rtol=1e-8)
    np.testing.assert_allclose(found.point.r, np.where(np.isin(np.arange(6), N), r, 0.0), atol=1e-8)
    linear = MLCP(
        A=W[np.ix_(T, T)], C=W[np.ix_(T, N)], D=W[np.ix_(N, T)], B=W[np.ix_(N, N)], a=q[T], b=q[N]
    )  # fmt: skip
    found = cpbench.solve(linear, tolerance=1e-10)
    np.testing.assert_allclose(found.point.u, r[T], rtol=1e-8)
    np.testing.assert_allclose(found.point.v, r[N], rtol=1e-8)


@pytest.mark.needs("cpbench_solvers")
def test_beside_contacts_with_friction_gfc_takes_it_among_its_bilateral_rows() -> None:
    """M = 1, H = I: v = r + f, so that r = −f where a contact sticks; the second one slides by its friction 0.2."""
    f = np.array([-3.0, -1.0, 1.0, -2.0, 1.5, 0.0])
    same = {"M": np.eye(6), "H": np.eye(6), "f": f, "w": np.zeros(6)}
    held = GlobalFrictionContact(**same, G=np.eye(6)[:, [1, 2]], b=np.zeros(2), mu=[0.0, 0.2])
    found = cpbench.solve(held, tolerance=1e-10)
    np.testing.assert_allclose(found.point.lam, [1.0, -1.0], atol=1e-8)
    np.testing.assert_allclose(found.point.r, [3.0, 0.0, 0.0, 2.0, -0.4, 0.0], atol=1e-8)
    rough = cpbench.solve(GlobalFrictionContact(**same, mu=[1e3, 0.2]), tolerance=1e-10)
    np.testing.assert_allclose(rough.point.v, found.point.v, atol=1e-8)


def contacts() -> dict[str, object]:
    rng = np.random.default_rng(0)
    return {
        "fc": planted.fc(rng, 3, 3)[0],
        "gfc": planted_contact.gfc(rng, 2, 3, 0, 3)[0],
        "rfc": planted_contact.rfc(rng, 3, 5)[0],
        "afc": planted_contact.afc(rng, 3)[0],
    }


@pytest.mark.parametrize(
    ("node", "ways"), [("fc", ("fcm", "mlcp")), ("gfc", ("G", "lam")), ("rfc", ("gfc", "fcm")), ("afc", ("gfc", "fcm"))]
)
def test_infinite_friction_is_refused_with_its_contact_and_the_way_out(node: str, ways: tuple[str, ...]) -> None:
    problem = contacts()[node]
    mu = np.array(problem.mu)
    mu[1] = np.inf
    with pytest.raises(
        ProblemError, match=rf"^{node}\.mu: is inf at contact 1: a contact that never slips .* linear"
    ) as told:
        dataclasses.replace(problem, mu=mu)
    assert all(f" {way} " in f"{told.value} ".replace(",", " ") for way in ways)
    assert "\n" not in str(told.value)
    if node == "rfc":
        with pytest.raises(ProblemError, match=r"^rfc\.mu_r: is inf at contact 0: a contact that never rolls"):
            dataclasses.replace(problem, mu_r=[np.inf, 1.0, 1.0])


@pytest.mark.parametrize("mu", [[np.nan, 0.5], [-np.inf, 0.5], ["much", 0.5]])
def test_other_coefficients_that_are_none_keep_their_messages(mu: list[object]) -> None:
    with pytest.raises(ProblemError, match=r"non-finite|numbers"):
        dataclasses.replace(pressed()[0], mu=mu)


def test_readers_refuse_it_in_one_line(tmp_path: Path) -> None:
    fc = pressed()[0]
    np.savez(tmp_path / "bench.npz", G=fc.W, g=fc.q, mus=[0.5, np.inf])
    storage.save(fc, tmp_path / "own.h5")
    with h5py.File(tmp_path / "own.h5", "r+") as root:
        root["fclib_local/vectors/mu"][1] = np.inf
    for file, place in (("bench.npz", "mu"), ("own.h5", "fclib_local/vectors/mu")):
        done = command(tmp_path, "info", file)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
        assert f"{file}: {place}: is inf at contact 1: a contact that never slips" in done.stderr


def test_a_cone_of_infinite_friction_is_the_half_space() -> None:
    """min ½‖x − (−1, 2)‖² over x₁ ≥ 0, as a second-order cone with μ = ∞: (0, 2), with multiplier (1, 0)."""
    K = ProductCone.of((Cone.SECOND_ORDER, 1, 2, np.inf))
    problem = ConeQP.over(np.eye(2), np.array([1.0, -2.0]), K)
    assert judge(problem, ConeQPPoint(x=[0.0, 2.0], y=[1.0, 0.0]), 1e-12).solved


def pushed_cube(mu: float) -> tuple[FrictionContact, np.ndarray]:
    """A cube of side 2 and mass 1 on its corners, pushed sideways by half its weight, and the Jacobian of its corners:
    it stays where it is, while friction is above a half."""
    rows = []
    for corner in [np.array([x, y, -1.0]) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]:
        for axis in (np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])):
            rows.append(np.concatenate([axis, np.cross(corner, axis)]))
    J, inverse = np.array(rows), np.diag([1.0, 1.0, 1.0, 1.5, 1.5, 1.5])
    fall = np.array([0.5 * 0.00981, 0.0, -0.00981, 0.0, 0.0, 0.0])
    return FrictionContact(W=J @ inverse @ J.T, q=J @ fall, mu=np.full(4, mu)), J


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("exponent", [1, 4, 6, 8, 9, 10, 12])
def test_a_cube_on_rough_ground_stays_where_it_is(exponent: int) -> None:
    """To rounding, whatever the coefficient; the reactions balance weight and push, by statics."""
    problem, J = pushed_cube(10.0**exponent)
    for tolerance in (1e-4, 1e-6, 1e-8):
        output = solvers.get("auto-fc").run(problem, Budget(tolerance=tolerance))
        assert output.claim is Claim.SOLVED, output.message
        assert isinstance(output.point, FCPoint)
        assert judge(problem, output.point, tolerance).error <= tolerance
        np.testing.assert_allclose((J.T @ output.point.r)[:3], [-0.5 * 0.00981, 0.0, 0.00981], atol=tolerance)
