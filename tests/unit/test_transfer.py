"""Starts from the step before: contacts found again by id, forces kept in the world, answers that stay answers."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import planted
import planted_contact
import pytest
from scipy.spatial.transform import Rotation

from cpbench.errors import NotApplicable, PointError
from cpbench.formulations import (
    LCP,
    Contacts,
    FCMPoint,
    FCPoint,
    FrictionContact,
    GFCPoint,
    GlobalFrictionContact,
    LCPPoint,
    MixedFrictionContact,
    RollingFrictionContact,
)
from cpbench.formulations.transfer import BY_ID, BY_ORDER, transfer

NC = 9


def frames(rng: np.random.Generator, nc: int = NC) -> np.ndarray:
    """Orthonormal, every other one left-handed."""
    F = Rotation.random(nc, random_state=int(rng.integers(2**31))).as_matrix()
    F[::2, 2] *= -1.0
    return F


def spun(F: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The same normals, tangents turned by any angle and half of them mirrored."""
    angle = rng.uniform(0, 2 * np.pi, len(F))
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    t1, t2 = c * F[:, 1] + s * F[:, 2], c * F[:, 2] - s * F[:, 1]
    t2[rng.random(len(F)) < 0.5] *= -1.0
    return np.stack([F[:, 0], t1, t2], axis=1)


def geometry(F: np.ndarray, ids: Any = None, bodies: Any = None) -> Contacts:
    nc = len(F)
    ids = np.arange(nc) if ids is None else ids
    bodies = np.column_stack([np.asarray(ids), np.asarray(ids) + 1]) if bodies is None else bodies
    return Contacts(id=ids, bodies=bodies, position=np.zeros((nc, 3)), frame=F)


def local(nc: int, contacts: Contacts | None = None, d: int = 3) -> FrictionContact:
    return FrictionContact(W=np.eye(d * nc), q=np.ones(d * nc), mu=np.ones(nc), dimension=d, contacts=contacts)


def rolling(nc: int, contacts: Contacts | None = None, d: int = 5) -> RollingFrictionContact:
    return RollingFrictionContact(
        W=np.eye(d * nc), q=np.ones(d * nc), mu=np.ones(nc), mu_r=np.ones(nc), dimension=d, contacts=contacts
    )


def world(contacts: Contacts, r: np.ndarray, d: int = 3) -> dict[int, np.ndarray]:
    """Force, and moment behind it, of every contact in the world, by id."""
    R = r.reshape(-1, d)
    vectors: dict[int, np.ndarray] = {}
    for i, x, F in zip(contacts.id, R, contacts.frame, strict=True):
        force = x[0] * F[0] + x[1] * F[1] + (x[2] * F[2] if d != 2 else 0.0)
        moment = x[3] * F[1] + x[4] * F[2] if d == 5 else np.zeros(0)
        vectors[int(i)] = np.concatenate([force, moment])
    return vectors


@pytest.mark.parametrize("d", [2, 3, 5])
def test_the_force_in_the_world_stays_where_the_normal_does(d: int, rng: np.random.Generator) -> None:
    """Tangents turned, contacts in another order, three gone and four new: surviving forces the same to 1e-14."""
    for _ in range(50):
        F = frames(rng)
        before = geometry(F, rng.permutation(100)[:NC])
        r = rng.normal(size=d * NC) * 10.0 ** rng.integers(-6, 7)
        G = F.copy() if d == 2 else spun(F, rng)
        if d == 2:  # the one tangent can only point the other way
            G[rng.random(NC) < 0.5, 1] *= -1.0
        stays = rng.permutation(NC)[:6]
        ids = np.concatenate([before.id[stays], np.arange(200, 204)])
        order = rng.permutation(10)
        after = geometry(np.concatenate([G[stays], frames(rng, 4)])[order], ids[order])
        make = rolling if d == 5 else local
        got = transfer(before, FCPoint(r=r), make(10, after, d))
        assert (got.how, got.matched, got.new, got.gone) == (BY_ID, 6, 4, 3)
        old, new = world(before, r, d), world(after, got.point.r, d)
        for i, x in new.items():
            expected = old.get(i, np.zeros_like(x)) if i < 200 else np.zeros_like(x)
            assert np.abs(x - expected).max() <= 1e-14 * np.abs(r).max()


def test_the_force_turns_with_its_normal(rng: np.random.Generator) -> None:
    """r_N and ‖r_T‖ stay, and the world force is turned by the least rotation (SciPy's) from normal to normal."""
    F, r = frames(rng, 200), rng.normal(size=600)
    Q = Rotation.from_rotvec(rng.normal(size=(200, 3)) * 0.9).as_matrix()
    G = spun(np.einsum("cij,ckj->cki", Q, F), rng)
    got = transfer(geometry(F), FCPoint(r=r), local(200, geometry(G))).point.r.reshape(-1, 3)
    R = r.reshape(-1, 3)
    near = np.einsum("ci,ci->c", F[:, 0], G[:, 0]) > 0
    assert 100 < near.sum() < 200
    np.testing.assert_array_equal(got[:, 0], R[:, 0])
    np.testing.assert_allclose(np.hypot(*got[near, 1:].T), np.hypot(*R[near, 1:].T), rtol=1e-13)
    for c in np.flatnonzero(near):
        axis = np.cross(F[c, 0], G[c, 0])
        angle = np.arctan2(np.linalg.norm(axis), F[c, 0] @ G[c, 0])
        least = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
        np.testing.assert_allclose(G[c].T @ got[c], least.apply(F[c].T @ R[c]), atol=1e-13)
    assert not got[~near, 1:].any(), "a normal that turned by more than a right angle says nothing of tangents"


def test_bodies_in_the_other_order(rng: np.random.Generator) -> None:
    """The normal turns over with the bodies: the force on each body stays."""
    F, r = frames(rng), rng.normal(size=3 * NC)
    before = geometry(F)
    G = spun(F, rng)
    G[::2] *= -1.0
    bodies = before.bodies.copy()
    bodies[::2] = bodies[::2, ::-1]
    after = geometry(G, bodies=bodies)
    got = transfer(before, FCPoint(r=r), local(NC, after)).point.r
    old, new = world(before, r), world(after, got)
    for c in range(NC):
        np.testing.assert_allclose(new[c], old[c] * (-1.0 if c % 2 == 0 else 1.0), atol=1e-14)
    unordered = dataclasses.replace(after, frame=F)  # bodies without an order: the normal did not turn
    np.testing.assert_allclose(transfer(before, FCPoint(r=r), local(NC, unordered)).point.r, r, atol=1e-14)


def _turned(problem: Any, point: Any, order: np.ndarray, F: np.ndarray, G: np.ndarray) -> Any:
    """The same physical problem with its contacts in another order and tangents turned: rows B of the new frames."""
    d, nc = problem.dimension, problem.nc
    B = np.zeros((d * nc, d * nc))
    for new, old in enumerate(order):
        rotation = G[new] @ F[old].T
        block = np.eye(d)
        block[1:3, 1:3] = rotation[1:, 1:]
        if d == 5:
            block[3:, 3:] = rotation[1:, 1:]
        B[d * new : d * new + d, d * old : d * old + d] = block
    dense = {k: v.toarray() if hasattr(v, "toarray") else v for k, v in problem.data().items()}
    change = {
        "W": lambda x: B @ x @ B.T,
        "V": lambda x: B @ x,
        "H": lambda x: x @ B.T,
        "q": lambda x: B @ x,
        "w": lambda x: B @ x,
        "mu": lambda x: x[order],
        "mu_r": lambda x: x[order],
    }
    return dataclasses.replace(problem, **{k: change[k](v) if k in change else v for k, v in dense.items()})


@pytest.mark.parametrize("node", ["fc", "rfc", "fcm", "gfc", "grfc"])
def test_an_answer_answers_the_same_problem_in_other_frames(node: str, rng: np.random.Generator) -> None:
    problem, point = {
        "fc": lambda: planted.fc(rng, NC, 3, "positive definite"),
        "rfc": lambda: planted_contact.rfc(rng, NC, 5, "positive definite"),
        "fcm": lambda: planted_contact.fcm(rng, NC, 2, 3, "positive definite"),
        "gfc": lambda: planted_contact.gfc(rng, NC + 1, NC, 2, 3),
        "grfc": lambda: planted_contact.grfc(rng, NC + 1, NC, 2, 5),
    }[node]()
    F, order = frames(rng), rng.permutation(NC)
    G = spun(F, rng)[order]
    after = dataclasses.replace(_turned(problem, point, order, F, G), contacts=geometry(G, order))
    got = transfer(geometry(F), point, after)
    assert got.matched == NC
    assert problem.residuals(point).error < 1e-13
    assert after.residuals(got.point).error < 1e-12


def test_velocities_and_joint_reactions_are_kept_where_their_number_is(rng: np.random.Generator) -> None:
    H = rng.normal(size=(6, 3))
    problem = GlobalFrictionContact(
        M=np.eye(6), H=H, G=rng.normal(size=(6, 2)), f=np.ones(6), w=np.ones(3), b=np.ones(2), mu=[1.0]
    )
    same = transfer(None, GFCPoint(v=np.arange(6.0), r=np.ones(3), lam=np.full(2, 7.0)), problem)
    assert same.how == BY_ORDER
    np.testing.assert_array_equal(same.point.v, np.arange(6.0))
    np.testing.assert_array_equal(same.point.lam, [7.0, 7.0])
    other = transfer(None, GFCPoint(v=np.ones(12), r=np.ones(3), lam=np.ones(1)), problem).point
    assert not other.v.any()
    assert not other.lam.any()
    np.testing.assert_array_equal(other.r, np.ones(3))
    mixed = MixedFrictionContact(W=np.eye(3), V=np.ones((3, 1)), R=np.eye(1), q=np.ones(3), s=[1.0], mu=[1.0])
    assert transfer(None, FCMPoint(r=np.ones(3), lam=[5.0]), mixed).point.lam[0] == 5.0


def test_without_ids_the_order_counts_and_a_changed_number_is_refused(rng: np.random.Generator) -> None:
    r = rng.normal(size=3 * NC)
    got = transfer(None, FCPoint(r=r), local(NC, geometry(frames(rng))))
    assert got.how == BY_ORDER
    np.testing.assert_array_equal(got.point.r, r)
    with pytest.raises(NotApplicable, match="9 contacts before, 10 now, and no ids"):
        transfer(geometry(frames(rng)), FCPoint(r=r), local(10))
    lcp = LCP(M=np.eye(2), q=np.ones(2))
    np.testing.assert_array_equal(transfer(None, LCPPoint(z=[1.0, 2.0]), lcp).point.z, [1.0, 2.0])
    with pytest.raises(NotApplicable, match="other unknowns"):
        transfer(None, LCPPoint(z=[1.0]), lcp)


def test_bad_geometry_is_refused(rng: np.random.Generator) -> None:
    F, point = frames(rng), FCPoint(r=np.ones(3 * NC))
    good = geometry(F)
    with pytest.raises(NotApplicable, match="the id 0 stands for 9 contacts"):
        transfer(good, point, local(NC, geometry(F, np.zeros(NC, int))))
    bent = F.copy()
    bent[4, 1] *= 1.5
    with pytest.raises(NotApplicable, match=r"frame of contact 4 is not orthonormal \(off by 1\.2e\+00\)"):
        transfer(good, point, local(NC, geometry(bent)))
    with pytest.raises(PointError, match="8 reactions for 9 contacts"):
        transfer(good, FCPoint(r=np.ones(24)), local(NC, good))
    with pytest.raises(PointError, match="a LCPPoint, expected FCPoint"):
        transfer(good, LCPPoint(z=np.ones(27)), local(NC, good))


def test_ids_count_not_the_order(rng: np.random.Generator) -> None:
    r = rng.normal(size=3 * NC)
    swapped = transfer(Contacts(id=np.arange(NC)), FCPoint(r=r), local(NC, Contacts(id=np.arange(NC)[::-1])))
    assert swapped.how == BY_ID
    np.testing.assert_array_equal(swapped.point.r.reshape(-1, 3), r.reshape(-1, 3)[::-1])
