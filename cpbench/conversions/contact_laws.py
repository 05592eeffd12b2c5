"""Laws of local contact as what they are converted to: maps in units of their own, cones, minima with a term frozen.

With r = Dx and u = D⁻¹s²y (D diagonal and constant on the forces of a contact, s a number) the law on (u, r) is that
on (y, x): cones and disks do not notice D, which is near s√ρ_c, nor does rᵀu but for s². Then y = D(WDx + q)/s² has
diagonal blocks near 1, |q| near 1, and the natural map of (x, y) at 1 is the energy norm that answers are judged by.
Moments have the factor ℓ_c as in `ContactProblem.lengths`, so that μ_r changes. All factors are powers of two: nothing
is rounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.conversions import bounds
from cpbench.conversions.base import Conversion
from cpbench.formulations.base import Kind, Problem, Trace, formulations
from cpbench.formulations.conic import ConeQP, ConeQPPoint, cone_fields
from cpbench.formulations.contact import ContactProblem, FCPoint, LocalContact
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder, either, less, product, recorded, where
from cpbench.formulations.local_contact import RollingFrictionContact
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Dense, Matrix, Vector, max_abs, power_of_two

STEPS = 200
"""Projections before a problem is handed to methods that need a start."""


@dataclass(frozen=True, eq=False)
class Units:
    """r = unit ∘ x and y = unit ∘ u/size²; unit has shape (nc·d,)."""

    unit: Vector
    size: float

    def reactions(self, x: Vector) -> FCPoint:
        return FCPoint(r=self.unit * x)

    def own(self, point: FCPoint) -> Vector:
        """Return x."""
        return point.r / self.unit

    @property
    def trace(self) -> Trace:
        return {"unit": self.unit, "size": self.size}

    @classmethod
    def of_trace(cls, trace: Trace) -> Units:
        return cls(np.asarray(trace["unit"]), float(trace["size"]))


def units(problem: LocalContact) -> Units:
    """Return D and s of a problem."""
    D = _nearest(np.sqrt(problem.effective_mass))
    top = max_abs(D * problem.q)
    size = float(_nearest(np.array([top]))[0]) if top > 0 else 1.0
    return Units(size * D, size)


def _nearest(x: Vector) -> Vector:
    """Return the powers of two within a factor √2 of positive numbers."""
    return 0.5 / power_of_two(np.sqrt(2.0) * x)


def rolling_coefficient(problem: Any, chosen: Units) -> Vector:
    """Return μ_r in these units, shape (nc,)."""
    D = chosen.unit.reshape(problem.nc, problem.dimension)
    return problem.mu_r * D[:, 0] / D[:, -1]


def velocities(problem: LocalContact, chosen: Units, x: Any) -> Any:
    """Return y of a column x of symbols, of shape (nc, d): a row a contact, each number once."""
    unit, q = chosen.unit, chosen.unit * problem.q / chosen.size**2
    W = matrices.sparse(problem.W).multiply(unit[:, None] / chosen.size**2).multiply(unit[None, :])
    return (product(W, x) + q).reshape(problem.nc, problem.dimension)


def row_norms(parts: Any) -> Any:
    """Return the norms of the rows of an array of symbols; the derivative at 0 is 0, one of its subgradients."""
    squares = (parts * parts).sum(axis=-1)
    positive = less(0.0, squares)
    return where(positive, np.sqrt(either(positive, squares, 1.0)))


def shifted(problem: LocalContact, chosen: Units) -> Map:
    """Return x ↦ ŷ = y + μ‖y_T‖e_N, De Saxcé and Feng's change of variable; with rolling friction + μ_r‖ω‖e_N too."""
    record = MapRecorder(problem.q.size)
    y = velocities(problem, chosen, record.z)
    rolls = hasattr(problem, "mu_r")
    last = 1 + (problem.dimension - 1) // 2 if rolls else problem.dimension
    normal = y[:, :1]
    if problem.nc:
        normal = normal + (problem.mu * row_norms(y[:, 1:last]))[:, None]
        if rolls:
            normal = normal + (rolling_coefficient(problem, chosen) * row_norms(y[:, last:]))[:, None]
    return record.map(np.hstack([normal, y[:, 1:]]))


def approached(problem: LocalContact, chosen: Units) -> FCPoint:
    """Return the result of STEPS projections x ← P_K(x − ŷ/L) from 0, accelerated (Nesterov; O'Donoghue and Candès
    2015): the contacts that carry are mostly identified by then. L is ‖DWD‖/s², by power iteration.
    """
    D, nc = chosen.unit, problem.nc
    W = matrices.sparse(problem.W).multiply(D[:, None] / chosen.size**2).multiply(D[None, :]).tocsr()
    q = D * problem.q / chosen.size**2
    L = 1.1 * _size(W) or 1.0
    best = x = y = np.zeros(q.size)
    least, momentum = np.inf, 1.0
    for _ in range(STEPS):
        hat = problem.law.shift(by_contact(W @ y + q, nc))
        ahead = problem.law.project(by_contact(y, nc) - hat / L).ravel()
        gone = float(np.linalg.norm(ahead - y))
        if not np.isfinite(gone):
            break
        if gone < least:
            best, least = ahead, gone
        if (y - ahead) @ (ahead - x) > 0:
            momentum, y = 1.0, ahead
        else:
            following = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * momentum**2))
            y = ahead + (momentum - 1.0) / following * (ahead - x)
            momentum = following
        x = ahead
    return chosen.reactions(best)


def _size(W: Any) -> float:
    """Estimate the spectral radius of W, 0 for no rows."""
    v, size = np.ones(W.shape[0]), 0.0
    for _ in range(20):
        v = W @ v
        size = float(np.linalg.norm(v))
        v = v / (size or 1.0)
    return size


def plain(problem: LocalContact, chosen: Units) -> Map:
    """Return x ↦ y."""
    return recorded(problem.q.size, lambda x: velocities(problem, chosen, x))


def by_contact(x: Vector, nc: int) -> Dense:
    """Return x with a row a contact; two columns where there is none."""
    return x.reshape(nc, x.size // nc if nc else 2)


def clipped(r: Dense, mu: Vector) -> Dense:
    """Clip r to r_N ≥ 0 and ‖r_T‖ ≤ μ r_N, shape (nc, d)."""
    R = r.copy()
    R[:, 0] = np.maximum(R[:, 0], 0.0)
    tangential = np.linalg.norm(R[:, 1:], axis=1)
    outside = tangential > mu * R[:, 0]
    R[outside, 1:] *= (mu[outside] * R[outside, 0] / tangential[outside])[:, None]
    return R


# -------------------------------------------------------------------------------------------- whole laws


def cones(problem: LocalContact, rolling: Vector | None = None) -> ProductCone:
    """Return the product of the friction cones; `rolling` : μ_r of rolling friction, if not that of the problem."""
    if not isinstance(problem, RollingFrictionContact):
        return ProductCone.of((Cone.SECOND_ORDER, problem.nc, problem.dimension, problem.mu))
    mu_r = problem.mu_r if rolling is None else rolling
    return ProductCone.of((Cone.ROLLING, problem.nc, problem.dimension, problem.mu, mu_r))


class InUnits(Conversion):
    """Base of the edges whose unknowns are x, r = Dx. Trace: `unit`, `size`.

    Attributes
    ----------
    unknown : the part of the target's answer that x is.
    """

    kind: ClassVar[Kind] = Kind.EQUIVALENT
    cost: ClassVar[float] = 3.0
    unknown: ClassVar[str] = "z"

    def lift(self, point: Any, trace: Trace) -> FCPoint:
        return Units.of_trace(trace).reactions(getattr(point, self.unknown))

    def push(self, point: FCPoint, trace: Trace) -> Any:
        made: Any = formulations.get(self.target).point_type
        return made(**{self.unknown: Units.of_trace(trace).own(point)})


class OverCones(InUnits):
    """Base of the edges to a problem over the cones of the law, `cp` or `vi`. Trace: `unit`, `size`, `steepness`.

    A steep cone hides what a contact misses. Where û_N lacks δ of being μ‖û_T‖, the distance to the dual cone is
    δ/√(1 + μ²), and the rows have terms μ times larger: an error of ε of the target may be one of μ² ε here. The target
    is asked for as much more, at most `bounds.MOST`: beyond μ = 100 the rest is lost, and from 10⁸ on it is rounding.
    """

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for a digit more, for the target's error is over ‖q̂‖, that of contact over ‖q‖, and once in other units;
        and for steep cones.
        """
        steepness = max(trace["steepness"], 1.0)
        return 0.1 * tolerance / min(steepness * steepness, bounds.MOST)

    def apply(self, problem: LocalContact) -> tuple[Problem, Trace]:
        chosen, rolling, steep = units(problem), None, problem.mu
        if isinstance(problem, RollingFrictionContact):
            rolling = rolling_coefficient(problem, chosen)
            steep = np.concatenate([steep, rolling])
        fields: dict[str, Any] = {"F": shifted(problem, chosen), **cone_fields(cones(problem, rolling))}
        trace = {**chosen.trace, "steepness": float(np.max(steep, initial=0.0))}
        return formulations.get(self.target)(**fields), trace


class ToConeQP(Conversion):
    """Base of the edges to a minimum over cones, whose multiplier is the velocity. Trace: `W`, `q`."""

    kind: ClassVar[Kind] = Kind.RELAXATION

    def lift(self, point: ConeQPPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.x)

    def push(self, point: FCPoint, trace: Trace) -> ConeQPPoint:
        return ConeQPPoint(x=point.r, y=trace["W"] @ point.r + trace["q"])


@dataclass(frozen=True)
class Frozen(Conversion):
    """Base of the edges that freeze De Saxcé's shift. `slip`: s_c [m/s], one number a contact, none for s = 0.

    The shift μ‖u_T‖ (or μ‖u_T‖ + μ_r‖ω‖) of every contact is held at s_c: a contact is then the cone complementarity
    K* ∋ u + s e_N ⟂ r ∈ K. s = 0 is the convex relaxation of Anitescu and Tasora (2010), in which sliding contacts
    dilate; the fixed point s_c = μ_c‖u_Tc‖ is the law itself (Acary and Cadoux 2013).
    """

    equation: ClassVar[str] = "De Saxcé, frozen"
    kind: ClassVar[Kind] = Kind.RELAXATION
    cost: ClassVar[float] = 3.0

    slip: tuple[float, ...] = ()

    def obstacle(self, problem: Any) -> str | None:
        return wrong_count("slip", self.slip, problem)

    def shifted(self, velocity: Vector, problem: ContactProblem) -> Vector:
        """Return a free velocity q of the contacts with the shift, q + s e_N."""
        result = velocity.copy()
        if self.slip:
            result[:: problem.dimension] += self.slip
        return result


class FrozenConeQP(Frozen, ToConeQP):
    """Base of `fc-coneqp` and `rfc-coneqp`. Trace: `W`, `q` (shifted).

    Attributes
    ----------
    instead : what to use where W is not symmetric.
    """

    instead: ClassVar[str]

    def obstacle(self, problem: LocalContact) -> str | None:
        return super().obstacle(problem) or asymmetric("W", problem.W, self.instead)

    def apply(self, problem: LocalContact) -> tuple[ConeQP, Trace]:
        self.require(problem)
        q = self.shifted(problem.q, problem)
        return ConeQP.over(problem.W, q, cones(problem)), {"W": problem.W, "q": q}


def wrong_count(what: str, values: tuple[float, ...], problem: ContactProblem) -> str | None:
    """Return the obstacle of frozen numbers that do not fit the problem."""
    if not values:
        return None
    if len(values) != problem.nc:
        return f"{what} has {len(values)} numbers, expected one for each of the {problem.nc} contacts"
    if min(values) < 0 or not np.isfinite(values).all():
        return f"{what} has {min(values):g} among its numbers, expected lengths of at least 0"
    return None


def asymmetric(what: str, M: Matrix, instead: str) -> str | None:
    """Return the obstacle of a matrix that is not a Hessian."""
    if matrices.is_symmetric(M):
        return None
    return f"{what} is not symmetric, asymmetry = {matrices.asymmetry(M):.1e}; {instead}"
