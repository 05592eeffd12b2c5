"""Small problems of the chapters on contact, friction and what lies beyond it."""

from __future__ import annotations

import dataclasses

import numpy as np

from cpbench import (
    AnisotropicFrictionContact,
    FrictionContact,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    RollingFrictionContact,
)

GRAVITY, STEP = 9.81, 0.01
"""Acceleration [m/s²] and time step [s] of the dumbbell."""


def sliding() -> FrictionContact:
    """One contact that slides fast, away from the vertices of a square and an octagon."""
    W = np.array([[1.0, 0.2, 0.1], [0.2, 1.2, 0.0], [0.1, 0.0, 0.9]])
    return FrictionContact(W=W, q=np.array([-1.0, 3.0, 1.6]), mu=np.array([0.6]))


def plane() -> FrictionContact:
    """Two contacts in the plane under one body: one slides, one opens."""
    W = np.array([[1.5, 0.2, 0.5, 0.1], [0.2, 1.0, -0.1, 0.8], [0.5, -0.1, 1.5, -0.2], [0.1, 0.8, -0.2, 1.0]])
    return FrictionContact(W=W, q=np.array([-1.0, 0.8, 1.0, 0.8]), mu=np.array([0.5, 0.5]), dimension=2)


def dumbbell() -> GlobalFrictionContact:
    """Two balls on a floor joined by a rigid rod along x, one of which is pushed.

    Velocities (x, y, z) of both; a contact has the rows (N, T1, T2) = (z, x, y). The joint keeps the distance.
    """
    masses = np.repeat([1.0, 3.0], 3)
    before = np.array([1.2, 0.9, 0.0, 1.2, 0.0, 0.0])
    force = np.array([0.0, 20.0, 0.0, 0.0, 0.0, 0.0]) - GRAVITY * masses * np.tile([0.0, 0.0, 1.0], 2)
    contact = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    return GlobalFrictionContact(
        M=np.diag(masses),
        H=np.kron(np.eye(2), contact),
        G=np.array([[1.0], [0.0], [0.0], [-1.0], [0.0], [0.0]]),
        f=masses * before + STEP * force,
        w=np.zeros(6),
        b=np.zeros(1),
        mu=np.array([0.3, 0.6]),
    )


def frictionless() -> GlobalFrictionContact:
    """The dumbbell on ice."""
    return dataclasses.replace(dumbbell(), mu=np.zeros(2))


def frictionless_local() -> FrictionContact:
    """The plane contacts without friction."""
    return dataclasses.replace(plane(), mu=np.zeros(2))


def anisotropic() -> AnisotropicFrictionContact:
    """A skate: it slides five times as easily along as across."""
    return AnisotropicFrictionContact(W=np.eye(3), q=np.array([-1.0, 1.2, 0.9]), mu=np.array([[0.1, 0.5]]))


def rolling() -> RollingFrictionContact:
    """One contact that slides and rolls: rows (N, T1, T2, M1, M2)."""
    W = np.diag([1.0, 1.0, 1.0, 2.0, 2.0])
    return RollingFrictionContact(
        W=W, q=np.array([-1.0, 1.2, 0.9, 0.8, -0.5]), mu=np.array([0.5]), mu_r=np.array([0.1])
    )


def rolling_plane() -> RollingFrictionContact:
    """The same in the plane: rows (N, T, M)."""
    return RollingFrictionContact(
        W=np.diag([1.0, 1.0, 2.0]), q=np.array([-1.0, 1.2, 0.8]), mu=np.array([0.5]), mu_r=np.array([0.1]), dimension=3
    )


def rolling_global() -> GlobalRollingFrictionContact:
    """A disk of mass 1 and inertia ½ that rolls in the plane: velocities (x, z, ω), rows (N, T, M)."""
    H = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]])
    return GlobalRollingFrictionContact(
        M=np.diag([1.0, 1.0, 0.5]),
        H=H,
        f=np.array([1.0, -GRAVITY * STEP, -0.2]),
        w=np.zeros(3),
        mu=np.array([0.5]),
        mu_r=np.array([0.05]),
        dimension=3,
    )
