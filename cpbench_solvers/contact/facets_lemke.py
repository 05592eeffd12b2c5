"""Polygons for Coulomb's disk, and the linear complementarity problem that results by Lemke's method.

In unknowns (r_N, β, λ) a contact, r_T = Dβ with the ν vertices D of a polygon around the disk,

    0 ≤ r_N ⟂ u_N ≥ 0,   0 ≤ β ⟂ λe + Dᵀu_T ≥ 0,   0 ≤ λ ⟂ μ r_N − eᵀβ ≥ 0

(Stewart and Trinkle 1996, Anitescu and Potra 1997). M is copositive for W ⪰ 0, so that Lemke's method with a rule
against cycling ends. In two dimensions D = [1, −1] is the disk. In three the answer is right where contacts stick or
slide along a vertex, and up to 180°/ν off in direction elsewhere. Then every contact gets its own polygon, with
three vertices within an angle of the direction against its velocity that is halved in every round.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.base import Kind
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.lcp import LCP
from cpbench.foundation.matrices import Dense, Vector, dense
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput, SolverSpec, Trait, register
from cpbench_solvers.contact.by_parts import SolverByParts
from cpbench_solvers.contact.sweeps import ScaledContacts, conclude
from cpbench_solvers.lcp.claims import size_obstacle
from cpbench_solvers.lcp.lemke import Lemke

PIVOTED = 1e-10
"""Error that Lemke's answers to the LCP are asked for."""


@dataclass(frozen=True)
class FacetsOptions:
    """Options of facets-lemke. `facets` : ν of the first polygons, even. `outer` : these are around the disk, else
    within it. `rounds` : LCPs after the first one, each with finer polygons; 0 leaves the plain method."""

    facets: int = 8
    outer: bool = True
    rounds: int = 30


@register
class FacetsLemke(SolverByParts):
    """Faceted friction cones, as an LCP by complementary pivoting. Solved is claimed by the error of the whole law.

    A start is returned where it is right, and otherwise not used.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="facets-lemke",
        node="fc",
        summary="friction cones with facets, turned against the sliding, by Lemke's method",
        method="pivoting",
        citation="Stewart and Trinkle 1996, IJNME 39:2673; Anitescu and Potra 1997, Nonlinear Dyn. 14:231",
        kind=Kind.APPROXIMATE,
        traits=frozenset({Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=FacetsOptions,
        by_default=False,
    )

    def obstacle(self, problem: FrictionContact) -> str | None:
        return size_obstacle(problem.nc * (FacetsOptions().facets + 2 if problem.dimension == 3 else 4), "nsgs")

    def warmup(self) -> None:
        Lemke().warmup()
        super().warmup()

    def solve_part(
        self, prepared: ScaledContacts, budget: Budget, options: FacetsOptions, start: Any, record: Record | None
    ) -> SolverOutput:
        rows, problem = prepared.rows, prepared.rows.problem
        if problem.dimension == 3 and (options.facets < 4 or options.facets % 2):
            message = f"facets = {options.facets}: directions come in opposite pairs, use an even number from 4 on"
            return SolverOutput(claim=Claim.FAILED, message=message)
        best = np.zeros(problem.q.size) if start is None else np.array(start.r)
        least, deadline = rows.judged_error(best), time.monotonic() + budget.seconds
        if record is not None:
            record(0, least, lambda: FCPoint(best))
        counters = {"iterations": 0, "pivots": 0}
        claim, message = Claim.INACCURATE, "facets stand for the cones"
        vertices = _regular(problem.nc, problem.dimension, options.facets, outer=options.outer)
        spread = math.pi / options.facets
        limit = min(budget.iterations or options.rounds + 1, options.rounds + 1 if problem.dimension == 3 else 1)
        while not least <= budget.tolerance and counters["iterations"] < limit:
            left = Budget(tolerance=PIVOTED, seconds=max(deadline - time.monotonic(), 1e-3))
            output = Lemke().run(_lcp(prepared, vertices), left)
            counters["iterations"] += 1
            counters["pivots"] += output.counters.get("pivots", 0)
            if output.point is None or not output.point.finite:
                claim, message = Claim.FAILED, f"Lemke: {output.message or output.claim}"
                break
            x = _reactions(output.point.z, vertices)
            r, u = prepared.s * x.ravel(), (prepared.W @ x.ravel() + prepared.q).reshape(x.shape)
            error = rows.judged_error(r)
            if error < least:
                best, least = r, error
                if record is not None:
                    record(counters["iterations"], error, lambda now=r: FCPoint(now))
            if output.claim not in (Claim.SOLVED, Claim.INACCURATE):
                claim, message = Claim.FAILED, f"Lemke: {output.message or output.claim}"
                break
            if time.monotonic() > deadline:
                claim, message = Claim.FAILED, f"out of time after {counters['iterations']} rounds"
                break
            if problem.dimension == 3:
                vertices = _fine(np.arctan2(-u[:, 2], -u[:, 1]), spread)
                spread *= 0.5
        return conclude(problem, best, least, budget, claim, message, counters)


def _regular(nc: int, d: int, facets: int, *, outer: bool) -> Dense:
    """Return vertices of a regular polygon for every contact, shape (nc, d − 1, ν); [1, −1] for d = 2."""
    if d == 2:
        return np.tile([[1.0, -1.0]], (nc, 1, 1))
    theta = 2.0 * math.pi / facets * np.arange(facets)
    size = 1.0 / math.cos(math.pi / facets) if outer else 1.0
    return np.tile(size * np.stack([np.cos(theta), np.sin(theta)]), (nc, 1, 1))


def _fine(angle: Vector, spread: float) -> Dense:
    """Return vertices on the circle: at the angle of each contact, at ±`spread` from it, and five around the rest."""
    offset = np.array([0.0, spread, 0.4 * math.pi, 0.8 * math.pi, math.pi, -0.8 * math.pi, -0.4 * math.pi, -spread])
    theta = angle[:, None] + offset
    return np.stack([np.cos(theta), np.sin(theta)], axis=1)


def _lcp(contacts: ScaledContacts, D: Dense) -> LCP:
    """Return M = EᵀWE + K and q = Eᵀq of the scaled problem; the unknowns of a contact are consecutive."""
    nc, t, count = D.shape
    E = np.zeros((nc, t + 1, count + 2))
    E[:, 0, 0] = 1.0
    E[:, 1:, 1:-1] = D
    W = dense(contacts.W).reshape(nc, t + 1, nc, t + 1)
    half = np.einsum("cidj,djb->cidb", W, E, optimize=True)
    M = np.einsum("cia,cidb->cadb", E, half, optimize=True)
    c = np.arange(nc)
    K = np.zeros((nc, count + 2, count + 2))
    K[:, 1:-1, -1], K[:, -1, 1:-1] = 1.0, -1.0
    K[:, -1, 0] = contacts.rows.problem.mu
    M[c, :, c, :] += K
    n = nc * (count + 2)
    return LCP(M=M.reshape(n, n), q=np.einsum("cia,ci->ca", E, contacts.q.reshape(nc, t + 1)).ravel())


def _reactions(z: Vector, D: Dense) -> Dense:
    """Return x = (r_N, Dβ) by contacts, with βs of a sum of at most μ r_N up to rounding."""
    nc, _, count = D.shape
    Z = z.reshape(nc, count + 2)
    return np.column_stack([Z[:, 0], np.einsum("cij,cj->ci", D, Z[:, 1:-1])])
