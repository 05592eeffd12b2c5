"""Data for Pinocchio's constraint solvers: a Delassus operator, free velocities and one friction cone a contact.

Pinocchio orders a contact (T1, T2, N). Its stopping criteria are absolute lengths in which forces, velocities and their
products stand side by side, and PGS bounds diagonals from below by 1e-12, so that the problem is scaled first: with
w = mean diag W and s = max|q|, r = (s/w) x turns u = Wr + q into u/s = (W/w) x + q/s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.solvers.stopping import Stopping, no_looser

SYMMETRY_LIMIT = 1e-8
"""Asymmetry up to which a Delassus matrix counts as symmetric (assembled ones are not to rounding)."""
FINEST = 1e-14
"""The least criterion that is asked for, with data of size 1."""


@dataclass(frozen=True)
class PinocchioContacts:
    """A problem as Pinocchio takes it. `G`, `g` : W/w and q/s in Pinocchio's order. `order` : their components in
    ours. `unit` : s/w, a force.

    `models`, `data` : std::vectors of the contacts' cones.
    """

    problem: FrictionContact
    G: Matrix
    g: Vector
    order: NDArray[np.intp]
    unit: float
    models: Any
    data: Any

    def guess(self, r: Vector) -> Vector:
        """Return reactions in Pinocchio's order and unit."""
        return np.ascontiguousarray(r[self.order] / self.unit)

    def reactions(self, x: Vector) -> Vector:
        """Return the way back."""
        r = np.empty_like(x)
        r[self.order] = x * self.unit
        return r


def obstacle(problem: FrictionContact) -> str | None:
    """Return what keeps a problem from either solver."""
    if problem.dimension != 3:
        return f"has contacts of dimension {problem.dimension}; Pinocchio's friction cones have 3"
    asymmetry = matrices.asymmetry(problem.W)
    if asymmetry > SYMMETRY_LIMIT:
        return (
            f"needs W symmetric, asymmetry = {asymmetry:.1e} > {SYMMETRY_LIMIT:.0e}: Pinocchio reads one "
            "triangle or the symmetric part and would answer another problem; use nsgs"
        )
    return None


def contacts(problem: FrictionContact) -> PinocchioContacts:
    """Return the problem as Pinocchio takes it; W stays sparse if it is."""
    import pinocchio as pin

    mean = float(problem.W.diagonal().mean()) if problem.nc else 0.0
    w, s = mean if mean > 0 else 1.0, matrices.max_abs(problem.q) or 1.0
    order = (3 * np.arange(problem.nc)[:, None] + np.array([1, 2, 0])).ravel()
    if sp.issparse(problem.W):
        G = sp.csc_matrix(sp.csr_array(problem.W)[order][:, order] / w)
        G.indices, G.indptr = G.indices.astype(np.int32), G.indptr.astype(np.int32)  # its binding knows no other
    else:
        G = np.asfortranarray(problem.W[np.ix_(order, order)] / w)
    world = pin.Model()
    models, data = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
    for mu in problem.mu:
        cone = pin.PointContactConstraintModel(world, 0)
        cone.setFriction(float(mu))
        model = pin.ConstraintModel(cone)
        models.append(model)
        data.append(model.createData())
    return PinocchioContacts(problem, G, problem.q[order] / s, order, s / w, models, data)


def stopping(test: str, tolerance: float, differs: str = "", factor: float = 1.0) -> Stopping:
    """Return the criteria that both solvers have, for data of size 1.

    The relative ones end a run where an iterate hardly moves, which is not a sign of a solution: they are off.
    """
    kinds = ("feasibility", "complementarity")
    settings = {f"absolute_{kind}_tol": max(tolerance, FINEST) for kind in kinds}
    settings |= {f"relative_{kind}_tol": 0.0 for kind in kinds}
    defaults = dict.fromkeys(settings, 1e-6)
    settings = no_looser(settings, defaults)
    return Stopping(test=test, settings=settings, defaults=defaults, differs=differs, factor=factor)


def set_tolerances(settings: Any, stopping: Stopping) -> None:
    """Write the criteria into a solver's settings."""
    settings.solve_ncp = True
    for name, value in stopping.settings.items():
        setattr(settings, name, value)
