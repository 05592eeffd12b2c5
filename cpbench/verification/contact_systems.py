"""Answers to the contact formulations at their contacts, for `contacts.contact_error`.

In problems of motion the reactions make velocities, and an answer has others: what is between them is an error of u,
and of bodies and joints an error by itself, as the root of an energy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.sparse.csgraph import connected_components

from cpbench.foundation.matrices import Dense, Vector
from cpbench.verification.contacts import ContactAnswer
from cpbench.verification.rows import EPS, FAR_BELOW, ROUNDINGS, ROWS, STACKED, Groups, kept
from cpbench.verification.sets import inverse

STACKED.enter(True, "fc")


@ROWS.of("fc", "rfc", "afc")
def local(P: Any, point: Any) -> ContactAnswer:
    """Return r beside u = Wr + q."""
    W, part = kept(P, lambda: (abs(P.W), _contacts_of(P, connected(P, P.q.size, (P.W, 0, 0)))))
    return _at(P, point.r, P.W @ point.r + P.q, W @ np.abs(point.r) + np.abs(P.q), part)


@ROWS.of("fcm")
def mixed(P: Any, point: Any) -> ContactAnswer:
    """Return r beside u = Wr + Vλ + q, with what Vᵀr + Rλ + s = 0 leaves."""

    def made() -> Any:
        label = connected(P, P.q.size + P.s.size, (P.W, 0, 0), (P.V, 0, P.q.size), (P.R, P.q.size, P.q.size))
        return abs(P.W), abs(P.V), label, _contacts_of(P, label)

    W, V, label, part = kept(P, made)
    r, lam = point.r, point.lam
    miss = P.V.T @ r + P.R @ lam + P.s
    u, sums = P.W @ r + P.V @ lam + P.q, W @ np.abs(r) + V @ np.abs(lam) + np.abs(P.q)
    masses = inverse(np.abs(P.R.diagonal()))
    terms = abs(P.V).T @ np.abs(r) + abs(P.R) @ np.abs(lam) + np.abs(P.s)
    others = _energies(P, label, [(label[P.q.size :], masses, miss, P.s, terms)])
    off = None if P.factorization.singular or not lam.size else P.V @ P.factorization.solve(miss)
    return _at(P, r, u, sums, part, off, others)


@ROWS.of("gfc", "grfc")
def dynamic(P: Any, point: Any) -> ContactAnswer:
    """Return r beside u = Hᵀv + w, with what Mv = Hr + Gλ + f and Gᵀv + b = 0 leave."""
    v, r, lam = point.v, point.r, point.lam
    M, H, G = P.at_hand
    force, joints = M @ v - H @ r - G @ lam - P.f, G.T @ v + P.b
    pushed = inverse(np.abs(M.diagonal())) * force if P.factorization.singular else P.factorization.solve(force)
    joined = joints.size and not P.saddle.singular
    off = P.saddle.solve(np.concatenate([force, joints]))[: v.size] if joined else pushed
    return _dynamics(P, v, r, lam, (M, H, G), (pushed, off), joints, P.f, P.b)


@ROWS.of("nfc")
def nonlinear_dynamic(P: Any, point: Any) -> ContactAnswer:
    """Return r beside u = Hᵀv + w, with what F(v) = Hr leaves, linearized at v."""
    v, F, M = point.v, P.F(point.v), P.F.jacobian(point.v)
    none, force = np.zeros(0), F - P.H @ point.r
    try:
        off = spla.splu(sp.csc_array(M)).solve(force) if v.size else none
    except RuntimeError:  # singular
        off = inverse(np.abs(M.diagonal())) * force
    return _dynamics(P, v, point.r, none, (M, P.H, sp.csr_array((v.size, 0))), (off, off), none, F - M @ v, none)


def _dynamics(
    P: Any,
    v: Vector,
    r: Vector,
    lam: Vector,
    matrices: tuple[Any, Any, Any],
    moved: tuple[Vector, Vector],
    joints: Vector,
    load: Vector,
    drift: Vector,
) -> ContactAnswer:
    """Return the contacts of bodies with velocities v and matrices M, H, G; `moved` is how far v is from what all
    forces make it, and from what the reactions make it where joints hold."""
    M, H, _ = matrices

    def made() -> Any:
        m, n = r.size, v.size
        label = connected(P, m + n + lam.size, *zip(matrices, (m, m, m), (m, 0, m + n), strict=True))
        return abs(H), abs(matrices[2]), label, _contacts_of(P, label)

    sizes, G, label, part = kept(P, made)
    masses = np.abs(M.diagonal())
    impulses = abs(M) @ np.abs(v) + sizes @ np.abs(r) + G @ np.abs(lam) + np.abs(load)
    sums = sizes.T @ (np.abs(v) + inverse(masses) * impulses) + np.abs(P.w)
    of_joints = inverse((G * G).T @ inverse(masses)) if lam.size else lam
    bodies, ties = label[r.size : r.size + v.size], label[r.size + v.size :]
    moving = (bodies, masses, moved[0], P.free_motion, np.abs(v) + np.abs(moved[0]))
    others = _energies(P, label, [moving, (ties, of_joints, joints, drift, G.T @ np.abs(v) + np.abs(drift))])
    return _at(P, r, H.T @ v + P.w, sums, part, H.T @ moved[1], others)


def _at(
    P: Any, r: Vector, u: Vector, sums: Vector, part: Groups, off: Vector | None = None, others: Vector | None = None
) -> ContactAnswer:
    unit = _units(P)

    def by_contact(x: Vector) -> Dense:
        return (x * unit).reshape(-1, P.dimension)

    return ContactAnswer(
        r=(r / unit).reshape(-1, P.dimension),
        u=by_contact(u),
        q=by_contact(_free_velocity(P)),
        rho=P.rho,
        balls=_balls(P),
        noise=by_contact(ROUNDINGS * EPS * sums),
        part=part,
        off=0.0 if off is None else by_contact(off),
        others=others,
    )


def _free_velocity(P: Any) -> Vector:
    """Return the velocities of the contacts for r = 0."""
    if P.node in ("fc", "rfc", "afc"):
        return P.q
    return P.reference.free_velocity if P.node == "nfc" else P.free_velocity


def _balls(P: Any) -> tuple[tuple[slice, Vector], ...]:
    """Return the components of friction and of rolling friction, with the coefficients in the units of the answer."""
    if P.node == "afc":
        return ((slice(1, None), np.ones(P.nc)),)
    if not hasattr(P, "mu_r"):
        return ((slice(1, None), P.mu),)
    k = 1 + (P.dimension - 1) // 2
    return (slice(1, k), P.mu), (slice(k, None), P.mu_r / P.lengths[:, k])


def _units(P: Any) -> Vector:
    """Return what divides reactions and multiplies velocities: lengths of moments, axes of an elliptic cone."""
    if P.node == "afc":
        return P.divisor
    return P.lengths.ravel()


def connected(P: Any, size: int, *blocks: tuple[Any, int, int]) -> Any:
    """Return the number of the connected part of every row: by the entries of the blocks, each with its first row and
    column, and of one contact all components belong together; shape (size,)."""
    components = np.arange(P.nc * P.dimension)
    rows, columns = [components], [components - components % P.dimension]
    for block, row, column in blocks:
        of_row, of_column = np.nonzero(block) if isinstance(block, np.ndarray) else block.nonzero()
        rows.append(of_row + row)
        columns.append(of_column + column)
    ends = np.concatenate(rows), np.concatenate(columns)
    graph = sp.coo_array((np.ones(ends[0].size), ends), shape=(size, size))
    return connected_components(graph, directed=False)[1]


def _contacts_of(P: Any, label: Any) -> Groups:
    """Return the parts of the contacts, whose components are the first rows."""
    first = label[: P.nc * P.dimension].reshape(P.nc, P.dimension)
    return Groups(first[:, 0], int(label.max(initial=-1)) + 1, P.nc)


def _energies(P: Any, label: Any, rows: list[tuple[Any, Vector, Vector, Vector, Vector]]) -> Vector:
    """Return √(m e²) of every row over the root of the energy that the data give its part; where nothing moves with
    the row, e over its own terms.

    rows : the part of each, its mass, its error, the velocity that the data give it, and the sum of its terms.
    """
    count = int(label.max(initial=-1)) + 1
    q = _free_velocity(P) ** 2
    energy = np.zeros(count)
    for at, energies in [(label[: q.size], P.effective_mass * q), *((at, m * e**2) for at, m, _, e, _ in rows)]:
        np.add.at(energy, at, energies)
    energy = np.where(energy > FAR_BELOW**2 * energy.max(initial=0.0), energy, energy.max(initial=0.0))
    unit = np.where(energy > 0, inverse(np.sqrt(energy)), 1.0)
    shares = [(np.sqrt(m) * np.abs(e) * unit[at], np.abs(e) * inverse(terms)) for at, m, e, _, terms in rows]
    return np.concatenate([np.where(m > 0, *both) for (_, m, *_), both in zip(rows, shares, strict=True)])
