"""When an answer to a global contact problem is good enough: as the verdict has it, without the verdict.

The law at the contacts is measured as velocities over the free velocities of the part (`kernels.part_error`). Where it
is within the tolerance, what v lacks of what the forces make it counts as well: as velocities of contacts, and of
bodies and joints as the root of an energy. Rounding of the terms of u that exceeds the tolerance hides every error.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench.formulations.global_contact import GFCPoint
from cpbench.foundation.matrices import EPS, Vector, transpose
from cpbench.solvers.base import Claim, SolverOutput
from cpbench_solvers.contact.parts import NO_ROLLING, ROUNDINGS
from cpbench_solvers.kernels import part_error


def moving_labels(problem: Any) -> tuple[Any, Any, Any]:
    """Return the number of the connected part of every contact, body's velocity and joint, by M, H and G."""
    nc, n, p, d = problem.nc, problem.f.size, problem.b.size, problem.dimension
    ends = []
    for A, row, column, width in ((problem.H, nc, 0, d), (problem.M, nc, nc, 1), (problem.G, nc, nc + n, 1)):
        entries: Any = sp.coo_array(A)
        some = entries.data != 0
        ends.append(np.stack([row + entries.coords[0][some], column + entries.coords[1][some] // width]))
    i, j = np.concatenate(ends, axis=1)
    label = connected_components(sp.coo_array((np.ones(i.size), (i, j)), shape=(nc + n + p,) * 2), directed=False)[1]
    return label[:nc], label[nc : nc + n], label[nc + n :]


class DynamicsError:
    """Error of answers to one problem; infinite where it is not a number.

    Attributes
    ----------
    floor : what rounding may make of the last answer, where that hides its error at the tolerance; else 0.
    """

    def __init__(self, problem: Any, tolerance: float, data: Any = None) -> None:
        """Prepare; `data` : the problem whose free velocities and masses count, by default the same."""
        self._problem, self._tolerance, self.floor, data = problem, tolerance, 0.0, data or problem
        self._lengths, self._law, self._data = problem.lengths.ravel(), part_error.velocity_error, data
        self._free, self._label = data.free_velocity * self._lengths, moving_labels(problem)
        count = 1 + max((int(x.max(initial=-1)) for x in self._label), default=-1)
        self._sizes, self._errors = np.empty(count), np.empty(count)
        mu_r = problem.mu_r / problem.lengths[:, -1] if hasattr(problem, "mu_r") else NO_ROLLING
        self._coefficients = problem.mu, mu_r, data.rho, problem.dimension, self._label[0].astype(np.int64)

    def _of_law(self, point: GFCPoint, off: Vector) -> float:
        u = (transpose(self._problem.at_hand[1]) @ point.v + self._problem.w) * self._lengths
        self._law(u, off, point.r / self._lengths, self._free, *self._coefficients, self._sizes, self._errors)
        return float(self._errors.max(initial=0.0))

    def __call__(self, point: GFCPoint) -> float:
        """Measure an answer."""
        error, self.floor = self._of_law(point, np.zeros(point.r.size)), 0.0
        if error <= self._tolerance:
            with np.errstate(all="ignore"):
                error = self._of_all(point)
        return error if math.isfinite(error) else math.inf

    def _of_all(self, point: GFCPoint) -> float:
        P, (v, r, lam) = self._problem, (point.v, point.r, point.lam)
        M, H, G = P.at_hand
        force, joints, masses = M @ v - H @ r - G @ lam - P.f, G.T @ v + P.b, np.abs(M.diagonal())
        lightness = np.divide(1.0, masses, out=np.zeros(masses.size), where=masses > 0)
        moved = off = lightness * force if P.factorization.singular else P.factorization.solve(force)
        if joints.size and not P.saddle.singular:
            off = P.saddle.solve(np.concatenate([force, joints]))[: v.size]
        error = self._of_law(point, (H.T @ off) * self._lengths)

        # bodies and joints, by the root of the energy that the data give their part
        data, (contacts, bodies, ties) = self._data, self._label
        stiff = (G * G).T @ lightness
        stiff = np.divide(1.0, stiff, out=np.zeros(stiff.size), where=stiff > 0)
        every = np.concatenate([np.repeat(contacts, P.dimension), bodies, ties])
        given = data.effective_mass * data.free_velocity**2, masses * data.free_motion**2, stiff * P.b**2
        energy = np.bincount(every, np.concatenate(given), self._sizes.size).astype(float)
        energy = np.where(energy > 2.0**-80 * energy.max(initial=0.0), energy, energy.max(initial=0.0))
        unit = np.divide(1.0, np.sqrt(energy), out=np.ones(energy.size), where=energy > 0)
        weights, away = np.concatenate([masses, stiff]), np.abs(np.concatenate([moved, joints]))
        own = np.concatenate([np.abs(v) + np.abs(moved), abs(G).T @ np.abs(v) + np.abs(P.b)])
        alone = np.divide(away, own, out=np.zeros(own.size), where=own > 0)  # of what nothing moves with
        shares = np.where(weights > 0, np.sqrt(weights) * away * unit[every[P.w.size :]], alone)
        error = max(error, float(shares.max(initial=0.0)), P.residuals(point, self._tolerance).error)

        impulses = abs(M) @ np.abs(v) + abs(H) @ np.abs(r) + abs(G) @ np.abs(lam) + np.abs(P.f)
        sums = abs(H).T @ (np.abs(v) + lightness * impulses) + np.abs(P.w)
        noise = ROUNDINGS * EPS * np.linalg.norm((sums * self._lengths).reshape(-1, P.dimension), axis=1)
        floor = float((noise / self._sizes[contacts]).max(initial=0.0))
        self.floor = floor if max(error, self._tolerance) <= floor else 0.0
        return error

    def claimed(self, output: SolverOutput) -> SolverOutput:
        """Return the output whose answer was measured last, `inaccurate` where rounding hides its error."""
        if not self.floor or output.claim is not Claim.SOLVED:
            return output
        message = f"rounding makes errors up to {self.floor:.1e}"
        return replace(output, claim=Claim.INACCURATE, message=message)
