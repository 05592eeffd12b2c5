"""Answers to the contact formulations as systems for `part_error`.

A contact is one block: the friction law is in the change of variable û = u + μ‖u_T‖e_N (De Saxcé and Feng 1998), so
that û is in the dual of the cone of r and orthogonal to it. Moments are divided and angular velocities multiplied by
the lengths of the contacts, so that a block has one unit.

A reaction in its cone with u = 0 obeys the law, whatever μ is. So a contact is off by no more than its distance from
the cone and its velocity; û has μ times the rounding of u_T.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector, dense
from cpbench.foundation.product_cones import Cone
from cpbench.verification.frame import Frame, System, Terms
from cpbench.verification.parts import Measure
from cpbench.verification.projections import row_norms
from cpbench.verification.sets import ConeFactors, Sets
from cpbench.verification.systems import kept, stack
from cpbench.verification.tables import rows_of


@rows_of("fc", by=Measure.ENERGY, stacked=True)
@rows_of("rfc", "afc", by=Measure.ENERGY)
def local(P: Any, point: Any) -> System:
    """Return the rows of fc, rfc and afc: r beside û(Wr + q)."""
    unit = _units(P)
    r, u = point.r / unit, (P.W @ point.r + P.q) * unit

    def frame() -> Frame:
        block = np.arange(r.size) // P.dimension
        terms = Terms.of_blocks(_scaled(P.W, unit, unit), block, block)
        return Frame(terms, _norms(P.q * unit, P.dimension), contact_sets(P), block=block)

    return System(kept(P, frame), r, shifted(P, u), velocity=u)


@rows_of("fcm", by=Measure.ENERGY)
def mixed(P: Any, point: Any) -> System:
    """Return the rows of fcm: (r, λ) beside û(Wr + Vλ + q) and Vᵀr + Rλ + s."""
    unit, lam = _units(P), point.lam
    u = (P.W @ point.r + P.V @ lam + P.q) * unit
    rows, joints = point.r.size, lam.size
    f = np.concatenate([shifted(P, u), P.V.T @ point.r + P.R @ lam + P.s])

    def frame() -> Frame:
        block = np.concatenate([np.arange(rows) // P.dimension, P.nc + np.arange(joints)])
        V = _scaled(P.V, unit, np.ones(joints))
        terms = Terms.of_blocks(stack([[_scaled(P.W, unit, unit), V], [V.T, P.R]]), block, block)
        constants = np.concatenate([_norms(P.q * unit, P.dimension), np.abs(P.s)])
        return Frame(terms, constants, contact_sets(P, joints), block=block)

    velocity = np.concatenate([u, np.zeros(joints)])
    return System(kept(P, frame), np.concatenate([point.r / unit, lam]), f, velocity=velocity)


@rows_of("gfc", "grfc", by=Measure.ENERGY)
def dynamic(P: Any, point: Any) -> System:
    """Return the rows of gfc and grfc: (r, v, λ) beside û(Hᵀv + w), Mv − Hr − Gλ − f and Gᵀv + b."""
    v, lam = point.v, point.lam
    force = P.M @ v - P.H @ point.r - P.G @ lam - P.f
    joints = P.G.T @ v + P.b
    return _dynamics(P, point.r, v, lam, force, joints, lambda: P.M, np.abs(P.f), np.abs(P.b), P.G, keep=True)


@rows_of("nfc", by=Measure.ENERGY)
def nonlinear_dynamic(P: Any, point: Any) -> System:
    """Return the rows of nfc: (r, v) beside û(Hᵀv + w) and F(v) − Hr, F linearized at v."""
    v, F, M = point.v, P.F(point.v), P.F.jacobian(point.v)
    none = np.zeros(0)
    constants = np.abs(F - M @ v)
    G = sp.csr_array((v.size, 0))
    return _dynamics(P, point.r, v, none, F - P.H @ point.r, none, lambda: M, constants, none, G, keep=False)


def _dynamics(
    P: Any, r: Vector, v: Vector, lam: Vector, force: Vector, joints: Vector, mass: Any, load: Vector, drift: Vector,
    G: Any, *, keep: bool,
) -> System:  # fmt: skip
    unit = _units(P)
    u = (P.H.T @ v + P.w) * unit
    rows, n, p = r.size, v.size, lam.size

    def frame() -> Frame:
        block = np.concatenate([np.arange(rows) // P.dimension, P.nc + np.arange(n + p)])
        at = np.arange(P.nc + n + p)
        H = _scaled(P.H, np.ones(n), unit)
        whole = stack([[None, H.T, None], [H, mass(), G], [None, G.T, None]])
        return Frame(
            terms=Terms.of_blocks(whole, block, block),
            constants=np.concatenate([_norms(P.w * unit, P.dimension), load, drift]),
            sets=contact_sets(P, n + p),
            block=block,
            multiplier=(at < P.nc) | (at >= P.nc + n),
        )

    return System(
        kept(P, frame) if keep else frame(),
        x=np.concatenate([r / unit, v, lam]),
        f=np.concatenate([shifted(P, u), force, joints]),
        velocity=np.concatenate([u, np.zeros(n + p)]),
    )


def worst_loaded(P: Any, system: System, tolerance: float) -> float:
    """Return largest ‖r_c − P(r_c − ρ_c û_c)‖/max(‖r_c‖, ρ_c‖û_c‖) of the contacts that carry load.

    A contact does where its own reaction or velocity has more than the tolerance of the energy of the free velocities,
    so that neither the self-stress of others nor a contact that only just touches decides.
    """
    assert system.velocity is not None
    (law,), d = system.frame.sets.cones, P.dimension
    r, u = system.x[: P.nc * d], system.f[: P.nc * d]
    rho = np.repeat(P.rho, d)
    defect = row_norms(law.defect(r, u, np.ones(r.size), rho))
    r_size, u_size = _norms(r, d), P.rho * _norms(u, d)
    free = P.q if hasattr(P, "q") else P.free_velocity if hasattr(P, "free_velocity") else P.reference.free_velocity
    energy = np.sqrt((P.rho * _norms(free * _units(P), d) ** 2).sum())
    own = np.maximum(r_size, u_size)
    loaded = own / np.sqrt(P.rho) > np.sqrt(tolerance) * energy
    return float(np.max(np.divide(defect, own, out=np.zeros_like(own), where=loaded & (own > 0)), initial=0.0))


def contact_sets(P: Any, free: int = 0) -> Sets:
    """Return the cones of the reactions, and unknowns after them that may be anything."""
    at = np.arange(P.nc * P.dimension).reshape(P.nc, P.dimension)
    mu, mu_r = coefficients(P)
    kind, rolling = (Cone.SECOND_ORDER, np.zeros(P.nc)) if mu_r is None else (Cone.ROLLING, mu_r)
    return Sets.of((at.size + free, -np.inf, np.inf), cones=[ConeFactors(kind, at, mu, rolling)])


def coefficients(P: Any) -> tuple[Vector, Vector | None]:
    """Return μ and μ_r of the cones in the variables of the blocks: 1 for an elliptic cone, whose axes are in the
    units."""
    mu_r = getattr(P, "mu_r", None)
    if P.node == "afc":
        return np.ones(P.nc), None
    if mu_r is None:
        return P.mu, None
    k = (P.dimension - 1) // 2
    length = _units(P).reshape(P.nc, P.dimension)[:, 1 + k]
    return P.mu, mu_r / length


def shifted(P: Any, u: Vector) -> Vector:
    """Return û of velocities in the units of the blocks."""
    U = u.reshape(P.nc, P.dimension).copy()
    mu, mu_r = coefficients(P)
    k = P.dimension - 1 if mu_r is None else (P.dimension - 1) // 2
    slide = mu * np.sqrt((U[:, 1 : 1 + k] ** 2).sum(axis=1))
    roll = 0.0 if mu_r is None else mu_r * np.sqrt((U[:, 1 + k :] ** 2).sum(axis=1))
    U[:, 0] += slide + roll
    return U.ravel()


def _units(P: Any) -> Vector:
    """Return what divides reactions and multiplies velocities: lengths of moments, axes of an elliptic cone."""
    if P.node == "afc":
        mu = dense(P.mu)
        return np.column_stack([np.ones(P.nc), mu]).ravel()
    if hasattr(P, "mu_r"):
        return P.lengths.ravel()
    return np.ones(P.nc * P.dimension)


def _scaled(M: Any, left: Vector, right: Vector) -> Any:
    if (left == 1.0).all() and (right == 1.0).all():
        return M
    if isinstance(M, np.ndarray):
        return left[:, None] * M * right
    return sp.csr_array(sp.diags_array(left) @ sp.csr_array(M) @ sp.diags_array(right))


def _norms(x: Vector, d: int) -> Vector:
    return row_norms(x.reshape(-1, d))
