"""Frictional contact in local (Delassus) form, Acary's P_L: u = Wr + q with Signorini and Coulomb at every contact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench import cones, matrices
from cpbench.errors import ProblemError
from cpbench.formulations.base import (
    Contacts,
    Point,
    Problem,
    Residuals,
    Sequence,
    formulations,
    matrix_field,
    scaled,
    vector_field,
)
from cpbench.matrices import Dense, Matrix, Vector, norm


@dataclass(frozen=True, eq=False)
class FCPoint(Point):
    """r, shape (nc·d,): reactions (impulses), normal first in every contact."""

    r: Vector


@formulations.register("fc")
@dataclass(frozen=True, eq=False, kw_only=True)
class FrictionContact(Problem):
    """u = Wr + q, and for every contact K*_μ ∋ û ⟂ r ∈ K_μ with û = u + μ‖u_T‖e_N (De Saxcé and Feng).

    Rows of a contact are consecutive, normal first: (N, T) for dimension 2, (N, T1, T2) for dimension 3.
    W need not be symmetric. Residuals: see :func:`contact_residuals`.
    """

    node: ClassVar[str] = "fc"
    title: ClassVar[str] = "frictional contact, local"
    equation: ClassVar[str] = "P_L"
    point_type: ClassVar[type[Point]] = FCPoint

    W: Matrix = matrix_field("m", "m")
    q: Vector = vector_field("m")
    mu: Vector = vector_field("nc")
    dimension: int = 3
    sequence: Sequence | None = None
    contacts: Contacts | None = None

    def check(self) -> None:
        check_contacts(self.node, self.dimension, self.q.size, self.mu, "q", self.contacts)

    @property
    def nc(self) -> int:
        return self.mu.size

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"r": self.q.size}

    @cached_property
    def diagonal_blocks(self) -> Dense:
        """W_cc, shape (nc, d, d), read-only."""
        return matrices.freeze(diagonal_blocks(self.W, self.dimension))

    @cached_property
    def rho(self) -> Vector:
        """ρ_c = d / tr W_cc, 1 where the trace is not positive; a property of the problem, never of an answer."""
        trace = np.einsum("cii->c", self.diagonal_blocks)
        return natural_rho(trace, self.dimension)

    def slacks(self, point: FCPoint) -> dict[str, Vector]:
        return {"u": self.W @ point.r + self.q}

    def residuals(self, point: FCPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            u = self.W @ point.r + self.q
            judged, parts, flags = contact_residuals(
                point.r, u, self.q, self.mu, self.rho, tolerance, absolute=not self.q.any()
            )
            return Residuals(judged, parts, flags)


def check_contacts(node: str, dimension: int, rows: int, mu: Vector, rows_of: str, contacts: Contacts | None) -> None:
    """Conditions shared by the contact nodes; raises ProblemError."""
    if dimension not in (2, 3):
        raise ProblemError(f"{node}.dimension", f"is {dimension}, must be 2 or 3")
    if rows != dimension * mu.size:
        raise ProblemError(
            f"{node}.{rows_of}", f"has {rows} rows, expected {dimension} for each of the {mu.size} contacts in mu"
        )
    if (mu < 0).any():
        i = int(np.flatnonzero(mu < 0)[0])
        raise ProblemError(f"{node}.mu", f"is negative at contact {i}: {mu[i]:g}")
    if contacts is not None and len(contacts.id) != mu.size:
        raise ProblemError(f"{node}.contacts", f"describe {len(contacts.id)} contacts, mu has {mu.size}")


def diagonal_blocks(W: Matrix, d: int) -> Dense:
    """The d×d diagonal blocks of a square matrix, shape (nc, d, d)."""
    nc = W.shape[0] // d
    if not sp.issparse(W):
        c = np.arange(nc)
        return np.ascontiguousarray(np.asarray(W).reshape(nc, d, nc, d)[c, :, c, :])
    coo = sp.coo_array(W)
    inside = coo.row // d == coo.col // d
    blocks = np.zeros((nc, d, d))
    row, col = coo.row[inside], coo.col[inside]
    np.add.at(blocks, (row // d, row % d, col % d), coo.data[inside])
    return blocks


def natural_rho(trace: Vector, d: int) -> Vector:
    """ρ_c = d / trace, 1 where the trace is not positive."""
    positive = trace > 0
    return matrices.freeze(np.where(positive, d / np.where(positive, trace, 1.0), 1.0))


def contact_residuals(
    r: Vector, u: Vector, q: Vector, mu: Vector, rho: Vector, tolerance: float, *, absolute: bool
) -> tuple[dict[str, float], dict[str, float], tuple[str, ...]]:
    """Judged numbers, readable parts and flags of reactions r with velocities u (recomputed by the caller).

    Judged: `natural` = ‖r − P_K(r − û)‖/max(‖q‖, ‖r‖, ‖u‖), Siconos' fc3d_compute_error; and the energy norm
    `energy` = √Σ‖Δ_c‖²/ρ_c / max(√Σ‖r_c‖²/ρ_c, √Σρ_c‖u_c‖², √Σρ_c‖q_c‖²), Δ_c = r_c − P(r_c − ρ_c û_c), which
    does not change with the units of r and u. Both are absolute (unscaled) where the caller says so: q = 0.

    The slip angle ∠(−u_T, r_T) is taken over contacts that push (r_N > 0), rub (μ > 0, r_T ≠ 0) and slide: ρ_c‖u_T‖
    above tolerance·‖r_c‖, and √ρ_c‖u_T‖ above tolerance times the scale of `energy`, below which an answer within
    the tolerance may have any velocity.
    """
    nc = mu.size
    if nc == 0:
        return {"natural": 0.0, "energy": 0.0}, {}, ("no contact",)
    R, U, Q = r.reshape(nc, -1), u.reshape(nc, -1), q.reshape(nc, -1)
    hat = cones.de_saxce(U, mu)
    defect = R - cones.project_friction_cone(R - hat, mu)
    delta = R - cones.project_friction_cone(R - rho[:, None] * hat, mu)
    row = _row_norms
    r_c, u_c, q_c, delta_c = row(R), row(U), row(Q), row(delta)
    natural = norm(defect.ravel())
    root = np.sqrt(rho)
    energy = norm(delta_c / root)
    per_contact_scale = np.maximum(np.maximum(r_c, rho * u_c), rho * q_c)
    per_contact = np.divide(delta_c, per_contact_scale, out=delta_c.copy(), where=per_contact_scale > 0)
    energy_scale = max(norm(r_c / root), norm(root * u_c), norm(root * q_c))
    judged = {
        "natural": natural if absolute else scaled(natural, norm(q), norm(r), norm(u)),
        "energy": energy if absolute else scaled(energy, energy_scale),
    }
    angles, weights = slip_angles(R, U, mu, tolerance * np.maximum(r_c / rho, energy_scale / root))
    work = float(np.einsum("ci,ci->", R, hat))
    parts = {
        "per_contact": float(per_contact.max()),
        "natural_absolute": natural,
        "fclib2018": scaled(natural, norm(q)),
        "cone_violation [N s]": norm(cones.distance_to_friction_cone(R, mu)),
        "dual_violation [m/s]": norm(cones.distance_to_dual_cone(hat, mu)),
        "work [J]": abs(work),
        "penetration_velocity [m/s]": float(max(0.0, -U[:, 0].min())),
        "work_cosine": scaled(abs(work), norm(r) * norm(hat.ravel())),
        "slip_angle [deg]": float(angles.max(initial=0.0)),
        "mean_slip_angle [deg]": float(np.average(angles, weights=weights)) if angles.size else 0.0,
    }
    flags = ("absolute",) if absolute else ()
    return judged, parts, flags


def slip_angles(R: Dense, U: Dense, mu: Vector, noise: Vector) -> tuple[Vector, Vector]:
    """∠(−u_T, r_T) in degrees and r_N of the contacts that push, rub, and slide faster than `noise`."""
    rt, ut = cones.tangential_norm(R), cones.tangential_norm(U)
    sliding = (R[:, 0] > 0) & (mu > 0) & (rt > 0) & (ut > noise)
    opposite = -np.einsum("ci,ci->c", R[sliding, 1:], U[sliding, 1:])
    if R.shape[1] == 2:
        across = np.zeros_like(opposite)
    else:
        across = R[sliding, 1] * U[sliding, 2] - R[sliding, 2] * U[sliding, 1]
    return np.degrees(np.arctan2(np.abs(across), opposite)), R[sliding, 0]


def _row_norms(X: Dense) -> Vector:
    return np.sqrt(np.einsum("ij,ij->i", X, X))
