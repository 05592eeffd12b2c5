"""Small problems of the chapters on cones and on variational inequalities."""

from __future__ import annotations

import numpy as np

from cpbench import AVI, SOCLCP, Cone, ConeQP, ProductCone, Relay
from cpbench.formulations.conic import cone_fields


def over_cone() -> SOCLCP:
    """One second-order cone in three dimensions."""
    K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0))
    M = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.25], [0.0, 0.25, 1.5]])
    return SOCLCP(M=M, q=np.array([-1.0, 1.5, -0.5]), **cone_fields(K))  # pyright: ignore[reportArgumentType]


def program_over_cone() -> ConeQP:
    """The same data as a program: its gradient is the affine map."""
    problem = over_cone()
    return ConeQP.over(problem.M, problem.q, problem.K)


def triangle() -> AVI:
    """A rotation plus a spring over a triangle: M is not symmetric, no objective has this gradient."""
    return AVI(
        M=np.array([[1.0, -1.0], [1.0, 1.0]]),
        q=np.array([-3.0, -1.5]),
        A=np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]]),
        b=np.array([0.0, 0.0, -2.0]),
    )


def box() -> AVI:
    """A symmetric map over a rectangle."""
    return AVI(
        M=np.array([[2.0, -1.0], [-1.0, 2.0]]),
        q=np.array([-3.0, 0.5]),
        lb=np.array([0.0, -1.0]),
        ub=np.array([1.0, 1.0]),
    )


def relay() -> Relay:
    """Two switches between −1 and 1; the second one holds in between."""
    return Relay(
        M=np.array([[1.0, 0.5], [-0.5, 1.0]]), q=np.array([-2.0, 0.25]), lb=np.full(2, -1.0), ub=np.full(2, 1.0)
    )
