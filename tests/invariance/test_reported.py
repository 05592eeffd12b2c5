"""Verdicts that were wrong once, with their numbers: idle sides, units, multipliers that cancel, stiffness."""

from __future__ import annotations

import dataclasses
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from planted_nonlinear import graph

from cpbench.formulations import (
    LCP,
    MLCP,
    QP,
    FCPoint,
    FrictionContact,
    GFCPoint,
    GlobalFrictionContact,
    LCPPoint,
    MiCP,
    MiCPPoint,
    MLCPPoint,
    QPPoint,
)
from cpbench.verification import judge

TOLERANCES = (1e-4, 1e-6, 1e-8)
INF = np.inf
ZERO2 = QPPoint(z=np.zeros(2), lam=[], mu=[], nu=np.zeros(2))


def _never(problem: Any, point: Any, *tolerances: float) -> None:
    for tolerance in tolerances or TOLERANCES:
        verdict = judge(problem, point, tolerance)
        assert not verdict.solved, f"solved at {tolerance:g}, error {verdict.error:.1e}, {dict(verdict.judged)}"


def _always(problem: Any, point: Any, *tolerances: float) -> None:
    for tolerance in tolerances or TOLERANCES:
        verdict = judge(problem, point, tolerance)
        assert verdict.solved, f"not solved at {tolerance:g}, error {verdict.error:.1e}, {dict(verdict.judged)}"


def _known_or_unresolvable(problem: Any, point: Any, *tolerances: float) -> None:
    """An exact answer, rounded: solved, or flagged where rounding of its terms is more than the tolerance."""
    for tolerance in tolerances or TOLERANCES:
        verdict = judge(problem, point, tolerance)
        said = f"not solved at {tolerance:g}, error {verdict.error:.1e}, {verdict.flags}"
        assert verdict.solved or "unresolvable" in verdict.flags, said


@pytest.mark.parametrize("bound", [0.0, 1e-8, 1e-6, 1e-3])
def test_the_size_of_f_at_a_bound_is_no_scale(bound: float) -> None:
    """F = z − 1/z is 1/bound there; at 2 it is 1.5, and 0 at 1."""
    problem = MiCP(F=graph(1, lambda z: z - 1.0 / z), lb=[bound], ub=[INF], start=np.ones(1))
    _never(problem, MiCPPoint(z=[2.0]))
    _always(problem, MiCPPoint(z=[1.0]))


def _squeezed(reaction: list[float], stress: float) -> tuple[FrictionContact, FCPoint]:
    """A body between two contacts that press with any force, beside a contact on a mass of 1."""
    h = np.array([[1.0, 0, 0, -1, 0, 0], [0, 1, 0, 0, 1, 0], [0, 0, 1, 0, 0, 1]])
    W = np.block([[h.T @ h, np.zeros((6, 3))], [np.zeros((3, 6)), np.eye(3)]])
    q = np.concatenate([np.zeros(6), [-1.0, 0.3, 0.0]])
    r = np.concatenate([[stress, 0, 0, stress, 0, 0], reaction])
    return FrictionContact(W=W, q=q, mu=np.full(3, 0.5), dimension=3), FCPoint(r=r)


@pytest.mark.parametrize("stress", [0.0, 1.0, 1e3, 1e6, 1e8])
def test_self_stress_hides_no_wrong_contact(stress: float) -> None:
    """Terms of a stress of 1e8 add up to 2e8 in each wall: 8 roundings are 3.6e-7 of the free velocity, above 1e-8."""
    right = _squeezed([1.0, -0.3, 0.0], stress)
    _always(*right, *(tolerance for tolerance in TOLERANCES if tolerance > 8.0 * 2.0**-52 * 2.0 * stress))
    _known_or_unresolvable(*right)
    _never(*_squeezed([5.0, 0.3, 0.0], stress))


@pytest.mark.parametrize("stress", [1.0, 1e3, 1e6])
def test_self_stress_of_a_joint_hides_no_wrong_motion(stress: float) -> None:
    """A body that is pinned and pressed, and another that falls with 1.02 of its speed."""
    M, H, G = np.eye(6), np.vstack([np.eye(3), np.zeros((3, 3))]), np.eye(6)[:, :1]
    f, v = np.array([-1.0, 0, 0, -1, 0, 0]), np.array([0.0, 0, 0, -1, 0, 0])
    problem = GlobalFrictionContact(M=M, H=H, G=G, f=f, w=np.zeros(3), b=np.zeros(1), mu=[0.5], dimension=3)
    answer = GFCPoint(v=v, r=[stress, 0.0, 0.0], lam=[1.0 - stress])
    _always(problem, answer)
    _never(problem, dataclasses.replace(answer, v=v * 1.02))


@pytest.mark.parametrize("unit", [1.0, 2.0**-40])
@pytest.mark.parametrize("stiffness", [1e6, 1e8, 1e10, 1e12, 1e14])
def test_the_exact_solution_rounded_to_doubles_is_solved(stiffness: float, unit: float) -> None:
    """M = [[k, −k], [−k, k + 1]]: no double near the solution has residuals within 1e-6 at k = 1e12, nor within 1e-8 at
    k = 1e8. With k = 1e6 the residuals are 1e-10, and the answer is solved."""
    M, q = unit * np.array([[stiffness, -stiffness], [-stiffness, stiffness + 1.0]]), unit * np.array([-1.0, -0.3])
    a, b, c, d = (Fraction(float(m)) for m in M.ravel())
    e, f = (-Fraction(float(x)) for x in q)
    z = np.array([float((d * e - b * f) / (a * d - b * c)), float((a * f - c * e) / (a * d - b * c))])
    mixed = MLCP(A=M, B=np.zeros((0, 0)), C=np.zeros((2, 0)), D=np.zeros((0, 2)), a=q, b=[])
    for problem, answer in (
        (LCP(M=M, q=q), lambda z: LCPPoint(z=z)),
        (mixed, lambda z: MLCPPoint(u=z, v=[])),
        (QP.build(M, q), lambda z: dataclasses.replace(ZERO2, z=z)),
        (FrictionContact(W=M, q=q, mu=[2.0], dimension=2), lambda z: FCPoint(r=z)),
    ):
        (_always if stiffness == 1e6 else _known_or_unresolvable)(problem, answer(z), 1e-6, 1e-8)
        _never(problem, answer(z * [1.5, 1.0]))


def test_a_slack_that_is_rounding_is_zero() -> None:
    """b = 0 and w = Du + Bv is rounding, as in circuits of resistors, capacitors and diodes: w has no size of its own
    that it could be measured by."""
    rng = np.random.default_rng(4)
    A, C = rng.standard_normal((3, 3)) + 3.0 * np.eye(3), rng.standard_normal((3, 2))
    v = np.array([0.7, 0.3])
    u = np.linalg.solve(A, np.ones(3) - C @ v)
    D = rng.standard_normal((2, 3))
    D -= np.outer(D @ u, u) / (u @ u)  # so that w is rounding with B = 0,
    D[:, 0] += 4e-15 / u[0]  # but not 0, however the sums are rounded
    problem = MLCP(A=A, B=np.zeros((2, 2)), C=C, D=D, a=-np.ones(3), b=np.zeros(2))
    w = D @ u
    assert 0.0 < np.abs(w).max() < 1e-14
    _always(problem, MLCPPoint(u=u, v=v))
    _never(problem, MLCPPoint(u=2.0 * u, v=v))
    _never(problem, MLCPPoint(u=u, v=2.0 * v))
