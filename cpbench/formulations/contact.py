"""Base of the contact nodes: their law, the conditions on their data, and how their answers are measured."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.errors import ProblemError
from cpbench.formulations.base import Contacts, Point, Problem, Residuals, Sequence, Term, point_field, scaled, squared
from cpbench.foundation import matrices
from cpbench.foundation.cones import Coulomb, Law, RollingCoulomb
from cpbench.foundation.matrices import Dense, Matrix, Vector, norm


@dataclass(frozen=True, eq=False)
class FCPoint(Point):
    """r, shape (nc·d,): reactions (impulses), normal first in every contact."""

    r: Vector = point_field("m")


class _HasFriction:
    """`mu` is declared by the nodes, in the order of their data; a dataclass would put it first."""

    mu: Any


class _HasDelassus:
    W: Matrix
    q: Vector


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactProblem(_HasFriction, Problem):
    """nc contacts of `dimension` rows each, consecutive and normal first.

    Rows are (N, T) or (N, T1, T2) for dimension 2 or 3; with rolling friction (N, T, M) or (N, T1, T2, M1, M2)
    for dimension 3 or 5, where M are moments of the reaction and angular velocities ω.
    """

    dimensions: ClassVar[tuple[int, ...]] = (2, 3)
    rows_of: ClassVar[str]
    """Name of the vector with one number a contact row (q or w)."""
    no_slip: ClassVar[str] = "bilateral constraints, which gfc has in G and fcm in V and R, with free multipliers"
    """How a contact that never slips is stated, where mu = inf would be asked of Coulomb's law."""

    dimension: int = 3
    sequence: Sequence | None = None
    contacts: Contacts | None = None

    def __post_init__(self) -> None:
        self._require_finite_friction()
        super().__post_init__()

    def _require_finite_friction(self) -> None:
        """Raise ProblemError where a coefficient is infinite: Coulomb's law has no such limit, for a contact that is
        open has no r_T, however large μ is; u_T = 0 with any r_T is another law, and linear."""
        for name, moves, still in (("mu", "slips", "u_T = 0 with r_T free"), ("mu_r", "rolls", "ω = 0 with m free")):
            given: Any = getattr(self, name, None)
            value = matrices.dense(given) if sp.issparse(given) else np.asarray(given)
            if value.dtype.kind != "f" or not np.isposinf(value).any():
                continue
            contact = int(np.argwhere(np.isposinf(value))[0][0])
            law = f"a contact that never {moves} has {still}, open or not, which is linear"
            how = self.no_slip if name == "mu" else ContactProblem.no_slip
            raise ProblemError(f"{self.node}.{name}", f"is inf at contact {contact}: {law}: {how}")

    def check(self) -> None:
        d, rows, nc = self.dimension, getattr(self, self.rows_of).size, self.nc
        if d not in self.dimensions:
            allowed = " or ".join(map(str, self.dimensions))
            raise ProblemError(f"{self.node}.dimension", f"is {d}, must be {allowed}")
        if rows != d * nc:
            raise ProblemError(
                f"{self.node}.{self.rows_of}", f"has {rows} rows, expected {d} for each of the {nc} contacts in mu"
            )
        for name in ("mu", "mu_r"):
            value = matrices.dense(getattr(self, name, np.zeros(0)))
            if (value < 0).any():
                i = int(np.flatnonzero((value < 0).reshape(nc, -1).any(axis=1))[0])
                raise ProblemError(f"{self.node}.{name}", f"is negative at contact {i}: {np.min(value[i]):g}")
        if self.contacts is not None and self.contacts.count != nc:
            raise ProblemError(f"{self.node}.contacts", f"describe {self.contacts.count} contacts, mu has {nc}")

    @property
    def nc(self) -> int:
        return int(self.mu.shape[0])

    @property
    def law(self) -> Law:
        """Coulomb's, or with rolling friction."""
        mu_r = getattr(self, "mu_r", None)
        return Coulomb(self.mu) if mu_r is None else RollingCoulomb(self.mu, mu_r)

    @cached_property
    @abstractmethod
    def mobility(self) -> Dense:
        """Diagonal of the Delassus operator, shape (nc, d)."""

    @cached_property
    def lengths(self) -> Dense:
        """Factor from moments to impulses, shape (nc, d): 1, and ℓ_c = √(tr W_TT/tr W_MM) in the rows of M.

        m/ℓ is in N·s and ωℓ in m/s, so that one norm may hold both, whatever the unit of length.
        """
        lengths = np.ones((self.nc, self.dimension))
        if hasattr(self, "mu_r"):
            k = (self.dimension - 1) // 2
            slides, rolls = self.mobility[:, 1 : 1 + k].sum(axis=1), self.mobility[:, 1 + k :].sum(axis=1)
            both = (slides > 0) & (rolls > 0)
            lengths[both, 1 + k :] = np.sqrt(slides[both] / rolls[both])[:, None]
        return matrices.freeze(lengths)

    @cached_property
    def rho(self) -> Vector:
        """ρ_c = d / tr W_cc, 1 where the trace is not positive; with rolling, moments and ω in units of `lengths`."""
        return natural_rho((self.mobility * self.lengths**2).sum(axis=1), self.dimension)

    @cached_property
    def effective_mass(self) -> Vector:
        """ρ_c of every row (ρ_cℓ_c² in rows of M): a reaction that answers a velocity; shape (nc·d,)."""
        return matrices.freeze((self.rho[:, None] * self.lengths**2).ravel())

    def contact_residuals(
        self, r: Vector, u: Vector, q: Vector, tolerance: float, *, absolute: bool
    ) -> tuple[dict[str, float], dict[str, float], tuple[str, ...]]:
        """Return :func:`contact_residuals` of this problem's law; q are the velocities for r = 0."""
        lengths = self.lengths if hasattr(self, "mu_r") else None
        return contact_residuals(r, u, q, self.law, self.rho, tolerance, absolute=absolute, lengths=lengths)


@dataclass(frozen=True, eq=False, kw_only=True)
class DelassusContact(_HasDelassus, ContactProblem):
    """Contact with the Delassus operator W from reactions to velocities."""

    rows_of: ClassVar[str] = "q"

    @cached_property
    def diagonal_blocks(self) -> Dense:
        """W_cc, shape (nc, d, d), read-only."""
        return matrices.freeze(diagonal_blocks(self.W, self.dimension))

    @cached_property
    def mobility(self) -> Dense:
        return matrices.freeze(np.einsum("cii->ci", self.diagonal_blocks).copy())


@dataclass(frozen=True, eq=False, kw_only=True)
class LocalContact(DelassusContact):
    """Contact in terms of reactions alone: u = Wr + q."""

    terms: ClassVar[tuple[Term, ...]] = (("q", 1, "W", "r"),)

    def slacks(self, point: FCPoint) -> dict[str, Vector]:
        return {"u": self.W @ point.r + self.q}

    def measure(self, point: FCPoint, tolerance: float) -> Residuals:
        u = self.W @ point.r + self.q
        return Residuals(*self.contact_residuals(point.r, u, self.q, tolerance, absolute=not self.q.any()))


def diagonal_blocks(W: Matrix, d: int) -> Dense:
    """Return the d×d diagonal blocks of a square matrix, shape (nc, d, d)."""
    nc = W.shape[0] // d
    if not sp.issparse(W):
        c = np.arange(nc)
        return np.ascontiguousarray(np.asarray(W).reshape(nc, d, nc, d)[c, :, c, :])
    blocks = np.zeros((nc, d, d))
    for k in range(1 - d, d):  # SciPy reads a diagonal in one pass without a copy of anything
        entries = W.diagonal(k)
        for row in range(max(0, -k), d - max(0, k)):
            blocks[:, row, row + k] = entries[row - max(0, -k) :: d][:nc]
    return blocks


def natural_rho(trace: Vector, d: int) -> Vector:
    """Return ρ_c = d / trace, 1 where the trace is not positive; `trace` (nc,), of the diagonal blocks of W."""
    positive = trace > 0
    return matrices.freeze(np.where(positive, d / np.where(positive, trace, 1.0), 1.0))


def contact_residuals(
    r: Vector,
    u: Vector,
    q: Vector,
    law: Law,
    rho: Vector,
    tolerance: float,
    *,
    absolute: bool,
    lengths: Dense | None = None,
) -> tuple[dict[str, float], dict[str, float], tuple[str, ...]]:
    """Return the measured numbers, readable parts and flags of reactions r with velocities u (recomputed by the
    caller).

    Measured: `natural` = ‖r − P_K(r − û)‖/max(‖q‖, ‖r‖, ‖u‖), Siconos' fc3d_compute_error; the energy norm
    `energy` = √Σ‖Δ_c‖²/ρ_c / max(√Σ‖r_c‖²/ρ_c, √Σρ_c‖u_c‖², √Σρ_c‖q_c‖²), Δ_c = r_c − P(r_c − ρ_c û_c), which
    does not change with the units of r and u (nor with that of length: moments are divided and angular velocities
    multiplied by `lengths`); and `opening` = Σρ_c dist(û_c, K*)² / Σρ_c‖q_c‖², the energy in velocities that no
    contact may have over that in the free ones. The first two have ‖r‖ in their scale, so that reactions that grow
    without bound would pass on a problem without solution; no answer can stretch the scale of the third.

    All are absolute (unscaled) where the caller says so: q = 0.

    The slip angle ∠(−u_T, r_T) is taken over contacts that push (r_N > 0), rub (μ > 0, r_T ≠ 0) and slide: ρ_c‖u_T‖
    above tolerance·‖r_c‖, and √ρ_c‖u_T‖ above tolerance times the scale of `energy`, below which an answer within
    the tolerance may have any velocity. Rolling angles ∠(−ω, m) in the same way. `reaction_error` is Δ over the
    reactions alone, max(√Σ‖r_c‖²/ρ_c, √Σρ_c q_Nc²): what the speed of sliding hides in `natural` and `energy`.
    """
    nc = rho.size
    if nc == 0:
        return {"natural": 0.0, "energy": 0.0, "opening": 0.0}, {}, ("no contact",)
    R, U, Q = r.reshape(nc, -1), u.reshape(nc, -1), q.reshape(nc, -1)
    hat = law.shift(U)
    defect = R - law.project(R - hat)
    cone_violation = R - law.project(R)
    dual_violation = law.project(-hat)  # û − P_{K*}(û) = −P_K(−û), Moreau
    natural = norm(defect.ravel())

    # the same in lengths of the contacts, where norms of forces and moments together mean something
    even, R_L, U_L, Q_L, hat_L, opens = law, R, U, Q, hat, dual_violation
    if lengths is not None:
        even, R_L, U_L, Q_L = law.in_units(lengths), R / lengths, U * lengths, Q * lengths
        hat_L = even.shift(U_L)
        opens = even.project(-hat_L)
    delta_c = _row_norms(R_L - even.project(R_L - rho[:, None] * hat_L))
    r_c, u_c, q_c = _row_norms(R_L), _row_norms(U_L), _row_norms(Q_L)
    root = np.sqrt(rho)
    energy, opening = norm(delta_c / root), norm(root * _row_norms(opens))
    r_energy, u_energy, q_energy = norm(r_c / root), norm(root * u_c), norm(root * q_c)
    energy_scale = max(r_energy, u_energy, q_energy)
    per_contact_scale = np.maximum(np.maximum(r_c, rho * u_c), rho * q_c)
    per_contact = np.divide(delta_c, per_contact_scale, out=delta_c.copy(), where=per_contact_scale > 0)
    measured = {
        "natural": natural if absolute else scaled(natural, norm(q), norm(r), norm(u)),
        "energy": energy if absolute else scaled(energy, energy_scale),
        "opening": squared(opening if absolute else scaled(opening, q_energy or u_energy)),
    }
    noise = tolerance * np.maximum(r_c / rho, energy_scale / root)
    work = float(np.einsum("ci,ci->", R, hat))
    parts = {
        "per_contact": float(per_contact.max()),
        "reaction_error": scaled(energy, r_energy, norm(root * Q[:, 0])),
        "natural_absolute": natural,
        "fclib2018": scaled(natural, norm(q)),
        "cone_violation [N s]": norm(cone_violation.ravel()),
        "dual_violation [m/s]": norm(dual_violation.ravel()),
        "work [J]": abs(work),
        "penetration_velocity [m/s]": float(max(0.0, -U[:, 0].min())),
        "work_cosine": scaled(abs(work), norm(r) * norm(hat.ravel())),
        **_angles(R_L, U_L, law, noise),
    }
    return measured, parts, ("absolute",) if absolute else ()


def _angles(R: Dense, U: Dense, law: Law, noise: Vector) -> dict[str, float]:
    """Return largest and r_N-weighted mean angle between what moves and what resists, sliding and rolling."""
    mu_r = getattr(law, "mu_r", None)
    last = R.shape[1] if mu_r is None else 1 + (R.shape[1] - 1) // 2
    kinds = {"slip": (slice(1, last), getattr(law, "mu", np.ones(len(R))))}
    if mu_r is not None:
        kinds["rolling"] = (slice(last, None), mu_r)
    parts: dict[str, float] = {}
    for name, (columns, coefficient) in kinds.items():
        angles, weights = opposition(R[:, 0], R[:, columns], U[:, columns], coefficient, noise)
        parts[f"{name}_angle [deg]"] = float(angles.max(initial=0.0))
        parts[f"mean_{name}_angle [deg]"] = float((angles * weights).sum() / weights.sum()) if angles.size else 0.0
    return parts


def opposition(normal: Vector, rt: Dense, ut: Dense, mu: Vector, noise: Vector) -> tuple[Vector, Vector]:
    """Return ∠(−u_T, r_T) [degrees] and r_N of the sliding contacts: r_N, μ and ‖r_T‖ positive, ‖u_T‖ above `noise`.

    Coulomb's law asks for an angle of 0. `rt`, `ut` : (nc, d − 1); the other arguments (nc,).
    """
    sliding = (normal > 0) & (mu > 0) & (_row_norms(rt) > 0) & (_row_norms(ut) > noise)
    rt, ut = rt[sliding], ut[sliding]
    opposite = -np.einsum("ci,ci->c", rt, ut)
    across = rt[:, 0] * ut[:, 1] - rt[:, 1] * ut[:, 0] if rt.shape[1] == 2 else np.zeros_like(opposite)
    return np.degrees(np.arctan2(np.abs(across), opposite)), normal[sliding]


def without_motion(problem: ContactProblem) -> list[int]:
    """Return the contacts with W_NN = 0: at most 1e-12 of the largest mobility."""
    mobility = problem.mobility
    return np.flatnonzero(mobility[:, 0] <= 1e-12 * mobility.max(initial=0.0)).tolist()


def _row_norms(X: Dense) -> Vector:
    return np.sqrt(np.einsum("ij,ij->i", X, X))
