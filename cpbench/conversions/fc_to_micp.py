"""Frictional contact → mixed complementarity problem (equation (49)).

Source  u = Wr + q,  0 ≤ u_N ⟂ r_N ≥ 0,  −u_T ∈ N_D(μ r_N)(r_T).
Target  z = (x_N, x_T, ξ) a contact, in units of the problem with r_N = D x_N, r_T = μD x_T and y the velocities
        that go with them (`contact_maps`), so that μ is 1:

            0 ≤ x_N ⟂ y_N ≥ 0,   x_N y_T + ξ x_T = 0 (x_T free),   0 ≤ ξ ⟂ x_N² − ‖x_T‖² ≥ 0.

        (49) itself has ‖r_T‖u_T + ξ r_T = 0 and 0 ≤ ξ ⟂ μr_N − ‖r_T‖ ≥ 0 for the last two rows. With ‖r_T‖ in place of
        μr_N the middle one lets r_T = 0, r_N > 0, u_T ≠ 0, ξ = 0 through, which is no friction; squares in the last one
        are smooth at r_T = 0. The solutions are those of the law, which are those of (49) but for what it lets through.
        Where x_N = 0 these rows are singular: ξ may be anything, and x_T is known to the root of the error. The
        `regular` form, which is the default, has in place of the last two

            x_N y_T + (ξ + y_N) x_T = 0,   0 ≤ ξ ⟂ x_N − ‖x_T‖ + y_N ≥ 0,

        the same where x_N > 0, for then y_N = 0; where x_N = 0 < y_N they say x_T = 0, ξ = 0, and are regular (were
        ‖x_T‖ = y_N, the first would say x_T = 0); and x_T is as exact as x_N. Where μ = 0: 0 ≤ x_N ⟂ y_N ≥ 0, x_T = 0,
        ξ = 0.
Lift    r = Dx, its x_T shortened to x_N where the last row leaves it longer.
Push    x = D⁻¹r, ξ = ‖y_T‖; in the regular form ξ = 0 where y_N > 0.
Kind    equivalent in r, in both forms. Singular where x_N = 0 < μ, in the regular form only where y_N = 0 too;
        `singular` tells these contacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.conversions import contact_maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.conversions.contact_maps import Units
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.micp import MiCP, MiCPPoint
from cpbench.foundation.matrices import Dense, max_abs

FORMS = ("regular", "lecture")
NOTHING = 1e-8
"""x_N (y_N) at most this times the largest component of x (y) counts as 0."""


@conversions.register("fc-micp")
@dataclass(frozen=True)
class FCtoMiCP(Conversion):
    """Coulomb's law by a multiplier ξ = μ‖u_T‖ of the disk. `form`: `regular`, or `lecture` for (49) mended.
    Trace: `unit`, `size`, `mu`, and `W`, `q` for the velocities."""

    name = "fc-micp"
    source = "fc"
    target = "micp"
    equation = "(49)"
    kind = Kind.EQUIVALENT
    cost = 4.0

    form: str = "regular"

    @property
    def _regular(self) -> bool:
        return self.form == "regular"

    def obstacle(self, problem: FrictionContact) -> str | None:
        return None if self.form in FORMS else f"form = '{self.form}' is none of (49); use {' or '.join(FORMS)}"

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for three digits more: the middle row is a product, small where x_N is whatever y_T may be."""
        return 1e-3 * tolerance

    def apply(self, problem: FrictionContact) -> tuple[MiCP, Trace]:
        """Convert, with the result of a few projections as start (`contact_maps.approached`): at 0 the derivative is
        singular.
        """
        self.require(problem)
        nc, d = problem.nc, problem.dimension
        chosen = _units(problem)
        trace = {**chosen.trace, "mu": problem.mu, "W": problem.W, "q": problem.q}
        lb = np.full((nc, d + 1), -np.inf)
        lb[:, [0, d]] = 0.0
        start = self.push(contact_maps.approached(problem, contact_maps.units(problem)), trace)
        F = _map(problem, chosen, self._regular)
        return MiCP(F=F, lb=lb.ravel(), ub=np.full(lb.size, np.inf), start=start.z), trace

    def lift(self, point: MiCPPoint, trace: Trace) -> FCPoint:
        chosen, mu = Units.of_trace(trace), np.asarray(trace["mu"])
        x = contact_maps.by_contact(point.z, mu.size)[:, :-1]
        return chosen.reactions(contact_maps.clipped(x, np.where(mu > 0, 1.0, 0.0)).ravel())

    def push(self, point: FCPoint, trace: Trace) -> MiCPPoint:
        mu = np.asarray(trace["mu"])
        x, y = _states(point, trace)
        slides = (mu > 0) & ((x[:, 0] > 0) | (y[:, 0] <= 0) | (not self._regular))
        xi = np.where(slides, np.linalg.norm(y[:, 1:], axis=1), 0.0)
        return MiCPPoint(z=np.column_stack([x, xi]).ravel() if mu.size else np.zeros(0))

    def remark(self, point: MiCPPoint, trace: Trace) -> str:
        contacts = self.singular(point, trace)
        if not contacts.size:
            return ""
        first = ", ".join(map(str, contacts[:5])) + (", ..." if contacts.size > 5 else "")
        return (
            f"(49) is singular at {contacts.size} of {np.asarray(trace['mu']).size} contacts ({first}): there its "
            "error bounds that of the reactions by a root only"
        )

    def singular(self, point: MiCPPoint, trace: Trace) -> NDArray[np.intp]:
        """Return contacts at which the rows are singular in this answer: friction, but nothing to carry it."""
        x, y = _states(self.lift(point, trace), trace)
        still = np.asarray(trace["mu"]) > 0
        for part, matters in ((x, True), (y, self._regular)):
            if matters:
                still = still & (part[:, 0] <= NOTHING * max_abs(part))
        return np.flatnonzero(still)


def _states(point: FCPoint, trace: Trace) -> tuple[Dense, Dense]:
    """Return x and y, a row a contact."""
    chosen, nc = Units.of_trace(trace), np.asarray(trace["mu"]).size
    y = chosen.unit * (trace["W"] @ point.r + trace["q"]) / chosen.size**2
    return contact_maps.by_contact(chosen.own(point), nc), contact_maps.by_contact(y, nc)


def _units(problem: FrictionContact) -> Units:
    """Return units as `contact_maps.units`, with μ among the tangential ones where it is positive."""
    chosen = contact_maps.units(problem)
    factor = np.ones((problem.nc, problem.dimension))
    factor[:, 1:] = np.where(problem.mu > 0, problem.mu, 1.0)[:, None]
    return Units(chosen.unit * factor.ravel(), chosen.size)


def _map(problem: FrictionContact, chosen: Units, regular: bool) -> Map:
    nc, d = problem.nc, problem.dimension
    record = MapRecorder((d + 1) * nc)
    Z = record.z.reshape(nc, d + 1)
    x, xi = Z[:, :d], Z[:, d]
    y = contact_maps.velocities(problem, chosen, x.ravel())
    rows: list[Any] = []
    for c in range(nc):
        xn, xt, gap = x[c, 0], x[c, 1:], y[c, 0] if regular else 0.0
        room = xn - contact_maps.row_norms(xt) + gap if regular else xn * xn - (xt * xt).sum()
        rubs = [xn * y[c, 1:] + (xi[c] + gap) * xt, room]
        rows += [y[c, 0], *(rubs if problem.mu[c] > 0 else [xt, xi[c]])]
    return record.map(*rows)
