"""Friction laws with one of their terms frozen, which makes them convex: what the relaxing edges share.

De Saxcé's shift μ‖u_T‖ (or μ‖u_T‖ + μ_r‖ω‖) of every contact is held at a given number s_c, 0 by default: a contact
is then the cone complementarity K* ∋ u + s e_N ⟂ r ∈ K. s = 0 is the convex relaxation of Anitescu and Tasora (2010),
in which sliding contacts dilate; the fixed point s_c = μ_c‖u_Tc‖ is the law itself (Acary and Cadoux 2013).
"""

from __future__ import annotations

import numpy as np

from cpbench.formulations.contact import ContactProblem, DelassusContact
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector


def per_contact(values: tuple[float, ...], nc: int) -> Vector:
    """Return the frozen numbers as a vector, zeros when there are none."""
    return np.array(values, dtype=float) if values else np.zeros(nc)


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


def shifted(q: Vector, d: int, slip: Vector) -> Vector:
    """Return q + s e_N."""
    result = q.copy()
    result[::d] += slip
    return result


def velocity(problem: DelassusContact, slip: Vector) -> Vector:
    """Return q + s e_N of a local problem."""
    return shifted(problem.q, problem.dimension, slip)
