"""Measures of answers that others have published: one answer under all of them, each with whose it is.

None of them gives a verdict unless it is named: most change with the units of a problem, and each has few formulations.
What `Problem.residuals` has measured already is read from there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.base import Problem
from cpbench.foundation.matrices import max_abs
from cpbench.foundation.product_cones import Cone
from cpbench.verification import sets
from cpbench.verification.merit_functions import BOUNDS, path_norms
from cpbench.verification.projections import project, row_norms

PATH = "PATH (Ferris and Munson; Billups, Dirkse and Ferris 1997)"
OSQP = "OSQP (Stellato, Banjac, Goulart, Bemporad and Boyd 2020, section 3.4)"
QPBENCHMARK = "qpbenchmark (Caron et al.)"
CONTACTBENCH = "ContactBench (Le Lidec et al. 2024)"
FCLIB2018 = "FCLIB (Acary, Brémond and Huber 2018)"
CPBENCH = "cpbench (by which its solvers stop)"
VERDICT = "cpbench (backward gives the verdict)"
ANGLE = "cpbench (no tolerance is for angles)"
CONTACT = ("fc", "fcm", "gfc", "nfc")
"""Formulations of Coulomb's law with one coefficient a contact."""

SOURCES: Mapping[tuple[str, str], str] = {
    ("lcp", "natural"): "Siconos (lcp_compute_error)",
    ("mlcp", "siconos_mlcp"): "Siconos (mlcp_compute_error)",
    ("relay", "natural"): "Siconos (relay_compute_error)",
    ("ncp", "natural_absolute"): "Siconos (ncp_compute_error)",
    ("fc", "natural"): "Siconos (fc2d_compute_error, fc3d_compute_error)",
    ("rfc", "natural"): "Siconos (rolling_fc2d_compute_error, rolling_fc3d_compute_error)",
} | {(node, "fclib2018"): FCLIB2018 for node in (*CONTACT, "rfc", "afc", "grfc")}
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


@dataclass(frozen=True)
class Family:
    """Measures that are computed together: of which formulations, by whom, and how of (problem, point, residuals)."""

    nodes: Collection[str]
    source: str
    of: Callable[[Any, Any, Mapping[str, float]], dict[str, float]]


def osqp(problem: Any, point: Any, known: Mapping[str, float]) -> dict[str, float]:
    """Return the least ε = ε_abs = ε_rel at which OSQP's two residuals pass, of Qz + p + Eᵀy = 0 and l ≤ Ez ≤ u.

    E holds the rows A, C and those of the unknowns with a bound. The primal residual is ‖Ez − s‖∞ against
    ε_abs + ε_rel max(‖Ez‖∞, ‖s‖∞), the dual one ‖Qz + p + Eᵀy‖∞ against ε_abs + ε_rel max(‖Qz‖∞, ‖Eᵀy‖∞, ‖p‖∞). In
    OSQP s is an iterate with y in the normal cone of [l, u] at s; of an answer it is the projection of Ez + y, as for
    ρ = 1, so that a multiplier of an idle row counts.
    """
    P, z, nu = problem, point.z, point.nu
    free = (P.lb <= -sets.INFINITE) & (P.ub >= sets.INFINITE)
    Ez = np.concatenate([P.A @ z, P.C @ z, z[~free]])
    y = -np.concatenate([point.lam, point.mu, nu[~free]])
    low = np.concatenate([P.b, P.d, P.lb[~free]])
    high = np.concatenate([np.full(P.b.size, np.inf), P.d, P.ub[~free]])
    s = np.minimum(np.maximum(Ez + y, low), high)
    Qz, Ey = P.Q @ z, -(P.A.T @ point.lam + P.C.T @ point.mu + np.where(free, 0.0, nu))
    return {
        "osqp_primal": max_abs(Ez - s) / (1.0 + max(max_abs(Ez), max_abs(s))),
        "osqp_dual": max_abs(Qz + P.p + Ey) / (1.0 + max(max_abs(Qz), max_abs(Ey), max_abs(P.p))),
    }


def qpbenchmark(problem: Any, point: Any, known: Mapping[str, float]) -> dict[str, float]:
    """Return the three absolute numbers of qpbenchmark and qpsolvers (Caron et al., qpbenchmark, since 2022), in the
    ∞-norm.

    The signs of multipliers are not among them.
    """
    names = {"primal": "primal", "dual": "stationarity", "gap": "gap"}
    return {f"qpbenchmark_{theirs}": known[f"{ours}_absolute"] for theirs, ours in names.items()}


def contactbench(problem: Any, point: Any, known: Mapping[str, float]) -> dict[str, float]:
    """Return the four criteria of Le Lidec et al., Contact models in robotics: a comparative analysis (2024).

    By contact, and the largest counts: Signorini complementarity |r_N u_N|, contact complementarity |rᵀû|, dual
    feasibility ‖û − P_K*(û)‖∞, and the gap of the maximum dissipation principle, |μ|r_N| − ‖r_T‖| ‖u‖∞ as their program
    has it: it does not see in which direction friction points.
    """
    d = problem.dimension
    u, mu = problem.slacks(point)["u"].reshape(-1, d), problem.mu
    r = point.r.reshape(-1, d)
    hat = u.copy()
    hat[:, 0] += mu * row_norms(u[:, 1:])
    short = np.abs(mu * np.abs(r[:, 0]) - row_norms(r[:, 1:]))
    lacking = project(Cone.SECOND_ORDER, -hat, mu, np.zeros_like(mu))  # Moreau: P_K*(û) − û
    return {
        "contactbench_signorini [J]": max_abs(r[:, 0] * u[:, 0]),
        "contactbench_complementarity [J]": max_abs(np.einsum("ci,ci->c", r, hat)),
        "contactbench_dual_feasibility [m/s]": max_abs(lacking.ravel()),
        "contactbench_dissipation [J]": max_abs(short * np.abs(u).max(axis=1, initial=0.0)),
    }


FAMILIES: tuple[Family, ...] = (
    Family(BOUNDS, PATH, lambda problem, point, known: path_norms(problem, point)),
    Family(("qp",), OSQP, osqp),
    Family(("qp",), QPBENCHMARK, qpbenchmark),
    Family(CONTACT, CONTACTBENCH, contactbench),
)


def published(problem: Problem, point: Any, known: Mapping[str, float]) -> list[PublishedMeasure]:
    """Return what the literature measures beside `known`, the numbers of `Problem.residuals`, of an answer it has
    accepted."""
    found: list[PublishedMeasure] = []
    with np.errstate(all="ignore"):
        for family in FAMILIES:
            if problem.node in family.nodes:
                numbers = family.of(problem, point, known).items()
                found += [
                    PublishedMeasure(name, math.inf if math.isnan(value) else float(value), family.source)
                    for name, value in numbers
                ]
    return found


def named(numbers: Mapping[str, float]) -> dict[str, float]:
    """Return the numbers of an answer by what a user calls them: without their units."""
    return {name.split(" [")[0]: value for name, value in numbers.items()}


def all_measures(
    problem: Problem, point: Any, backward: float, measured: Iterable[str], known: Mapping[str, float]
) -> list[PublishedMeasure]:
    """Return every measure of one answer: the verdict's own number, those of `known` that solvers stop by
    (`measured`), that have a source or are angles, and the published ones."""
    rows = [PublishedMeasure("backward", backward, VERDICT)]
    stops = set(measured)
    for name, value in known.items():
        source = SOURCES.get((problem.node, name), CPBENCH if name in stops else "")
        if name.endswith("[deg]"):
            rows.append(PublishedMeasure(name, value, ANGLE, bounded=False))
        elif source:
            rows.append(PublishedMeasure(name, value, source))
    return rows + published(problem, point, known)
