"""Small problems of the chapters on quadratic programs and on linear complementarity."""

from __future__ import annotations

import numpy as np

from cpbench import LCP, MLCP, QP


def quadratic() -> QP:
    """Two unknowns, two inequalities of which one is active, one equality."""
    return QP.build(
        np.array([[3.0, 1.0], [1.0, 2.0]]),
        np.array([-6.0, -5.0]),
        np.array([[-1.0, -1.0], [1.0, 0.0]]),
        np.array([-2.0, 0.0]),
        np.array([[1.0, -0.5]]),
        np.array([0.25]),
    )


def repeated_row() -> QP:
    """The same, its active inequality written twice: A has not full rank."""
    qp = quadratic()
    return QP.build(qp.Q, qp.p, np.array([[-1.0, -1.0], [-1.0, -1.0]]), np.array([-2.0, -2.0]), qp.C, qp.d)


def symmetric() -> LCP:
    """M symmetric positive definite; one of Cottle, Pang and Stone's first examples."""
    return LCP(M=np.array([[2.0, 1.0], [1.0, 2.0]]), q=np.array([-5.0, -6.0]))


def nonsymmetric() -> LCP:
    """M positive definite, not symmetric."""
    return LCP(M=np.array([[2.0, -1.0], [3.0, 2.0]]), q=np.array([-2.0, 1.0]))


def three_solutions() -> LCP:
    """M symmetric, copositive and no P-matrix: det M < 0."""
    return LCP(M=np.array([[1.0, 2.0], [2.0, 1.0]]), q=np.array([-1.0, -1.0]))


def mixed() -> MLCP:
    """Two free unknowns, two complementary ones, A nonsingular."""
    return MLCP(
        A=np.array([[2.0, 1.0], [-1.0, 2.0]]),
        B=np.array([[3.0, 0.0], [1.0, 2.0]]),
        C=np.array([[-1.0, 0.0], [0.0, 1.0]]),
        D=np.array([[1.0, 0.0], [0.0, -1.0]]),
        a=np.array([-1.0, 2.0]),
        b=np.array([-4.0, 1.0]),
    )


def singular() -> MLCP:
    """A resistor between two nodes, a diode from the first one to ground, a current source at each.

    u are the potentials, v the current of the diode, which conducts at 0.7 V. Without the diode nothing fixes the
    potentials: A is singular.
    """
    return MLCP(
        A=np.array([[1.0, -1.0], [-1.0, 1.0]]),
        B=np.zeros((1, 1)),
        C=np.array([[1.0], [0.0]]),
        D=np.array([[-1.0, 0.0]]),
        a=np.array([-0.25, -1.0]),
        b=np.array([0.7]),
    )
