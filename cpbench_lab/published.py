"""Measures of answers that others have published: one answer under all of them, each with whose it is.

None of them gives a verdict unless it is named: most change with the units of a problem, and each has few formulations.
What `Problem.residuals` has measured already is read from there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cpbench import verification
from cpbench.formulations.base import Problem
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Dense, Vector, max_abs, norm
from cpbench.verification import sets
from cpbench.verification.projections import project, row_norms
from cpbench.verification.published import CONTACT, Conic, clarabel, conic, force, rows_of
from cpbench.verification.systems import BOUNDS

VERDICT = "cpbench (backward gives the verdict)"
NEAR = 1e-7
"""Default feasibility tolerance of HiGHS: its root is how near a bound is active, and how small a multiplier is 0."""

SOURCES: Mapping[tuple[str, str], str] = {
    ("lcp", "natural"): "Siconos (lcp_compute_error)",
    ("mlcp", "siconos_mlcp"): "Siconos (mlcp_compute_error)",
    ("relay", "natural"): "Siconos (relay_compute_error)",
    ("ncp", "natural_absolute"): "Siconos (ncp_compute_error)",
    ("fc", "natural"): "Siconos (fc2d_compute_error, fc3d_compute_error)",
    ("rfc", "natural"): "Siconos (rolling_fc2d_compute_error, rolling_fc3d_compute_error)",
    **{(node, "fclib2018"): "FCLIB (Acary, Brémond and Huber 2018)" for node in (*CONTACT, "rfc", "afc", "grfc")},
    **{("qp", f"{k}_absolute"): "qpbenchmark (Caron et al.), and PIQP" for k in ("primal", "stationarity", "gap")},
}
"""Whose the numbers of `Problem.residuals` are, by formulation and name; those without a source are not listed."""


@dataclass(frozen=True)
class PublishedMeasure:
    """One number of an answer, and its source: a name, and in brackets more of it. An angle is compared with no
    tolerance: its `bounded` is False."""

    name: str
    value: float
    source: str
    bounded: bool = True

    def within(self, tolerance: float) -> bool | None:
        """Return whether the number is at most the tolerance; None where that says nothing."""
        return self.value <= tolerance if self.bounded else None


def scs(a: Conic) -> dict[str, float]:
    """Return the least ε = ε_abs = ε_rel at which the two residuals and the gap of SCS pass, in the ∞-norm."""
    return {
        "scs_primal": max_abs(a.Ax + a.b - a.s) / (1.0 + max(map(max_abs, (a.Ax, a.b, a.s)))),
        "scs_dual": max_abs(a.Qx + a.p - a.Aty) / (1.0 + max(map(max_abs, (a.Qx, a.p, a.Aty)))),
        "scs_gap": abs(sum(a.products)) / (1.0 + max(map(abs, a.products))),
    }


def dimacs(a: Conic) -> dict[str, float]:
    """Return the six errors of the DIMACS challenge (Mittelmann, An independent benchmarking of SDP and SOCP solvers,
    section 2), with the answer as their dual: y is their x, s = Ax + b their z.

    They are of linear programs; Q enters the gradient and both objectives. The third is 0, as s is computed; the fifth
    is without its sign; the sixth is of y and s in their cones, as it is defined. Norms are of rows as they are given.
    """
    s, p, b, (xQx, px, by) = a.Ax + a.b, 1.0 + max_abs(a.p), 1.0 + max_abs(a.b), a.products
    second, fourth = _outside(a.K.dual(), a.y) / p, _outside(a.K, s) / b
    scale = 1.0 + abs(0.5 * xQx + px) + abs(0.5 * xQx + by)
    errors = [norm(a.Qx + a.p - a.Aty) / p, second, 0.0, fourth, abs(xQx + px + by) / scale]
    errors += [abs(float(a.y @ s)) / scale] if second == fourth == 0.0 else []
    return {f"dimacs_{k}": error for k, error in enumerate(errors, 1)}


def _outside(K: ProductCone, x: Vector) -> float:
    """Return by how much x lacks a least eigenvalue of 0: ‖x_T‖ − μx_N of a second-order cone, else the distance."""
    worst = max_abs(x - K.project(x))
    for kind, rows, mu, _ in K.groups:
        if kind is Cone.SECOND_ORDER:
            lacks = np.where(np.isinf(mu), 0.0, row_norms(x[rows[:, 1:]]) - mu * x[rows[:, 0]])
            worst = max(worst, float(lacks.max(initial=0.0)))
    return worst


def highs(P: Any, point: Any) -> dict[str, float]:
    """Return what HiGHS calls relative: violations over 1 + the largest active bound, wrong signs of multipliers and
    the gradient over 1 + the largest cost with a multiplier near 0, and the gap over 1 + both objectives.

    A cost is an entry of Qz + p. A bound or a cost that is not among these counts for its own violation, too.
    """
    (value, low, high, dual), Qz = rows_of(P, point), P.Q @ point.z
    free, lower, cost = np.isinf(low) & np.isinf(high), value < 0.5 * (low + high), Qz + P.p
    side = np.where(free, 0.0, np.where(lower, low, high))
    at_low, at_high = ((value - bound) ** 2 <= NEAR for bound in (low, high))
    active = max_abs(np.where(at_low, low, np.where(at_high, high, 0.0)))
    bound = np.maximum(active, np.where(at_low | at_high, 0.0, np.abs(side)))
    costs = max_abs(cost[point.nu**2 < NEAR])
    priced = np.maximum(costs, np.append(np.abs(cost), np.zeros(dual.size - cost.size)))
    wrong = np.where(free, np.abs(dual), np.maximum(np.where(lower, -dual, dual), 0.0)) * ((high - low) ** 2 > NEAR)
    primal, other = (float(x) for x in (point.z @ (0.5 * Qz + P.p), side @ dual - 0.5 * point.z @ Qz))
    return {
        "highs_primal": max_abs(np.maximum(np.maximum(low - value, value - high), 0.0) / (1.0 + bound)),
        "highs_dual": max_abs(wrong / (1.0 + priced)),
        "highs_gradient": max_abs(cost - force(P, dual)) / (1.0 + costs),
        "highs_gap": abs(primal - other) / (1.0 + abs(primal) + abs(other)),
    }


def osqp(P: Any, point: Any) -> dict[str, float]:
    """Return the least ε = ε_abs = ε_rel at which OSQP's ‖Ez − s‖∞ and ‖Qz + p + Eᵀy‖∞ pass; E has the rows with sides.

    In OSQP s is an iterate with y in the normal cone of [l, u] at s; of an answer it is the projection of Ez + y, as
    for ρ = 1, so that a multiplier of an idle row counts.
    """
    value, low, high, dual = rows_of(P, point)
    some = np.isfinite(low) | np.isfinite(high)
    Ez, s = value[some], np.minimum(np.maximum(value - dual, low), high)[some]
    Qz, Ey = P.Q @ point.z, -force(P, np.where(some, dual, 0.0))
    return {
        "osqp_primal": max_abs(Ez - s) / (1.0 + max(max_abs(Ez), max_abs(s))),
        "osqp_dual": max_abs(Qz + P.p + Ey) / (1.0 + max(map(max_abs, (Qz, Ey, P.p)))),
    }


def _contacts(P: Any, point: Any) -> tuple[Dense, Dense, Dense]:
    """Return the rows (nc, d) of r, u and û."""
    r, u = point.r.reshape(-1, P.dimension), P.slacks(point)["u"].reshape(-1, P.dimension)
    return r, u, u + np.outer(P.mu * row_norms(u[:, 1:]), np.eye(P.dimension)[0])


def contactbench(P: Any, point: Any) -> dict[str, float]:
    """Return the four criteria of Le Lidec et al., Contact models in robotics: a comparative analysis (2024).

    By contact, and the largest counts: Signorini complementarity |r_N u_N|, contact complementarity |rᵀû|, dual
    feasibility ‖û − P_K*(û)‖∞, and the gap of the maximum dissipation principle, |μ|r_N| − ‖r_T‖| ‖u‖∞ as their program
    has it: it does not see in which direction friction points.
    """
    r, u, hat = _contacts(P, point)
    short = np.abs(P.mu * np.abs(r[:, 0]) - row_norms(r[:, 1:]))
    lacking = project(Cone.SECOND_ORDER, -hat, P.mu, np.zeros_like(P.mu))  # Moreau: P_K*(û) − û
    return {
        "contactbench_signorini [J]": max_abs(r[:, 0] * u[:, 0]),
        "contactbench_complementarity [J]": max_abs(np.einsum("ci,ci->c", r, hat)),
        "contactbench_dual_feasibility [m/s]": max_abs(lacking.ravel()),
        "contactbench_dissipation [J]": max_abs(short * np.abs(u).max(axis=1, initial=0.0)),
    }


def _natural(P: Any, point: Any, rho: Vector) -> float:
    """Return ‖r − P_K(r − ρû)‖∞, one ρ a contact."""
    r, _, hat = _contacts(P, point)
    return max_abs((r - project(Cone.SECOND_ORDER, r - rho[:, None] * hat, P.mu, np.zeros_like(P.mu))).ravel())


def kamino(P: Any, point: Any) -> dict[str, float]:
    """Return the natural map of the contacts with ρ = 1 in the units of the problem."""
    return {"kamino_natural_map": _natural(P, point, np.ones(P.nc))}


def dimensionless(P: Any, point: Any) -> dict[str, float]:
    """Return the natural map with ρ = 1/‖W_cc‖₂ over the reaction ‖q‖∞/‖W‖∞ (1 for a norm of 0)."""
    sizes = np.linalg.norm(P.diagonal_blocks, ord=2, axis=(1, 2))
    reaction = (max_abs(P.q) or 1.0) / (float(np.max(abs(P.W).sum(axis=1), initial=0.0)) or 1.0)
    return {"dimensionless": _natural(P, point, 1.0 / np.where(sizes > 0, sizes, 1.0)) / reaction}


def path_norms(problem: Any, point: Any) -> dict[str, float]:
    """Return four of the norms that PATH prints, in the ∞-norm, of a point that is moved into its bounds as there:
    those of complementarity, the normal map, the minimum map and the Fischer function.

    Ferris and Munson name them (PATH 4.7, solution log). The functions are in Billups, Dirkse and Ferris, A comparison
    of large scale mixed complementarity problem solvers (1997), and in Ferris, Kanzow and Munson, Feasible descent
    algorithms for mixed complementarity problems (1999); that complementarity is divided by 1 + |bound| is how PATH
    5.2.01 prints it. Its fifth norm, the gradient of a merit function, is 0 at answers that solve nothing.

    Complementarity is (z − ℓ)F⁺/(1 + |ℓ|) and (u − z)F⁻/(1 + |u|), |F| where there is no bound on that side. The normal
    map is the distance of −F(z) to the normal cone of the box at z: an answer off its bound by any amount has all of F
    there. The Fischer function is φ(z − ℓ, −φ(u − z, −F)), φ(a, b) = a + b − √(a² + b²), φ(∞, b) = b. What is fixed
    is no unknown.
    """
    given = np.concatenate([np.zeros(0), *point.arrays().values()])
    lb, ub = (np.broadcast_to(bound, given.shape) for bound in BOUNDS[problem.node](problem))
    lb, ub = np.where(lb <= -sets.INFINITE, -np.inf, lb), np.where(ub >= sets.INFINITE, np.inf, ub)
    z = np.minimum(np.maximum(given, lb), ub)
    F = _map(problem, z)
    bound = np.where(F > 0, lb, ub)
    room = np.divide(np.abs(z - bound), 1.0 + np.abs(bound), out=np.ones_like(z), where=np.isfinite(bound))
    held = np.where(z == lb, np.minimum(F, 0.0), F)
    values = {
        "path_complementarity": room * F,
        "path_normal_map": np.where(z == ub, np.maximum(held, 0.0), held),
        "path_minimum_map": np.maximum(np.minimum(F, z - lb), z - ub),
        "path_fischer": _fischer(z - lb, -_fischer(ub - z, -F)),
    }
    return {name: max(max_abs(np.where(lb == ub, 0.0, x)), max_abs(given - z)) for name, x in values.items()}


def _map(P: Any, z: Vector) -> Vector:
    """Return F(z)."""
    if P.node == "mlcp":
        u, v = z[: P.a.size], z[P.a.size :]
        return np.concatenate([P.A @ u + P.C @ v + P.a, P.D @ u + P.B @ v + P.b])
    return P.M @ z + P.q if hasattr(P, "M") else P.F(z)


def _fischer(a: Vector, b: Vector) -> Vector:
    """Return φ(a, b) without cancellation, b where a is infinite."""
    finite = np.where(np.isfinite(a), a, 1.0)
    size, total = np.hypot(finite, b), finite + b
    stable = np.divide(2.0 * finite * b, total + size, out=total - size, where=total > 0)
    return np.where(np.isfinite(a), stable, b)


class Family(NamedTuple):
    """Measures that are computed together: of which formulations, by whom, how of (problem, point), and what the
    largest of them is called where a solver stops by all of them."""

    nodes: Collection[str]
    source: str
    of: Callable[[Any, Any], dict[str, float]]
    whole: str = ""


PROGRAMS = ("qp", "coneqp")
FAMILIES: tuple[Family, ...] = (
    Family(BOUNDS, "PATH (Ferris and Munson; Billups, Dirkse and Ferris 1997)", path_norms),
    Family(PROGRAMS, "Clarabel (Goulart and Chen 2024)", lambda P, x: clarabel(conic(P, x)), "clarabel"),
    Family(PROGRAMS, "SCS (manual, termination criteria)", lambda P, x: scs(conic(P, x)), "scs"),
    Family(PROGRAMS, "DIMACS (Mittelmann 2003)", lambda P, x: dimacs(conic(P, x, moved=False)), "dimacs"),
    Family(("qp",), "HiGHS (manual, feasibility and optimality; pull requests 2346 and 2815)", highs, "highs"),
    Family(("qp",), "OSQP (Stellato, Banjac, Goulart, Bemporad and Boyd 2020, section 3.4)", osqp, "osqp"),
    Family(CONTACT, "ContactBench (Le Lidec et al. 2024)", contactbench),
    Family(CONTACT, "Kamino (Tsounis, Grandia and Bächer 2025; NVIDIA Newton, r_vi_natmap)", kamino),
    Family(("fc",), "Björkegren 2026 (dimensionless stop, with contact-scene-v1)", dimensionless),
)


def all_measures(problem: Problem, point: Any, tolerance: float) -> list[PublishedMeasure]:
    """Return every measure of one answer: the verdict's own number, those of its residuals that solvers stop by, that
    have a source or are angles, and the published ones. None of an answer that is not finite."""
    if not point.finite:
        return []
    rows = [PublishedMeasure("backward", verification.judge(problem, point, tolerance).error, VERDICT)]
    residuals = problem.residuals(point, tolerance)
    for name, value in {**residuals.parts, **residuals.measured}.items():
        stops = "cpbench (by which its solvers stop)" if name in residuals.measured else ""
        source = SOURCES.get((problem.node, name), stops)
        if name.endswith("[deg]"):
            rows.append(PublishedMeasure(name, value, "cpbench (no tolerance is for angles)", bounded=False))
        elif source:
            rows.append(PublishedMeasure(name, value, source))
    return rows + published(problem, point)


def published(problem: Problem, point: Any) -> list[PublishedMeasure]:
    """Return what the literature measures beside the numbers of `Problem.residuals`, of an answer it has accepted; NaN
    is ∞. Of a coneqp with factors that are no cones there are none."""
    rows: list[PublishedMeasure] = []
    K: ProductCone | None = getattr(problem, "K", None)
    for family in FAMILIES if K is None or K.conical else ():
        if problem.node in family.nodes:
            with np.errstate(all="ignore"):
                numbers = {name: math.inf if math.isnan(x) else x for name, x in family.of(problem, point).items()}
            whole = {family.whole: max(numbers.values())} if family.whole else {}
            rows += [PublishedMeasure(name, x, family.source) for name, x in {**whole, **numbers}.items()]
    return rows
