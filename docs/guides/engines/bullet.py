"""Bullet (PyBullet) as a plugin of `cpbench audit`: free rigid bodies, contacts with the implicit friction cone.

    cpbench --plugin bullet.py audit bullet pile --steps 200

A step of Bullet's sequential impulses is, with J the rows N, T₁, T₂ of the contacts, W = JM⁻¹Jᵀ and v' = v + dt M⁻¹τ:

    u = Wr + Jv' + w,   w_N = erp p/dt where p ≤ 0, else p/dt,   p = distance + slop

with Signorini's law between u_N and r_N, and in each sweep r_T = P(r_T − D⁻¹u_T), P the projection on the disk of
radius μ r_N, D the diagonal of W: friction is against D⁻¹u_T, which is Coulomb's law where both tangents have one
mobility. So the own law is an `fc` with W and q = Jv' + w times D⁻¹ in rows of tangents. τ is gravity and −ω × Iω; μ
the product of both coefficients. That v⁺ = v' + M⁻¹Jᵀr holds to rounding and is not judged.

Bullet tells v, r, J and the distances; it tells neither rows nor impulses of joints, limits and motors, so that a scene
with joints is refused. erp and slop are set to its defaults, because it does not tell them. Damping is set to 0.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.errors import NotApplicable, UnknownName
from cpbench.formulations.local_contact import FrictionContact
from cpbench_lab.audit.engine import Engine, EngineStep, engines, package, under_coulomb

DEFAULTS = {"dt": 0.002, "numSolverIterations": 50, "solverResidualThreshold": 1e-7, "contactERP": 0.08}
SLOP, GRAVITY = 1e-5, np.array([0.0, 0.0, -9.81])


@engines.register("bullet")
class Bullet(Engine):
    """Bullet with a scene in MJCF, as far as its reader understands it."""

    package = "pybullet"
    law = "sequential impulses with erp and the implicit friction cone, friction against D⁻¹u"

    def __init__(self, scene: Path, options: Mapping[str, str]) -> None:
        if unknown := [name for name in options if name not in DEFAULTS]:
            raise UnknownName("option of Bullet", unknown[0], DEFAULTS)
        given = self.given = {**DEFAULTS, **{name: float(value) for name, value in options.items()}}
        with _quiet():
            p: Any = package("pybullet")
            p.resetSimulation() if p.isConnected() else p.connect(p.DIRECT)
            bodies = p.loadMJCF(str(scene))
        if any(p.getNumJoints(b) for b in bodies) or 'type="ball"' in scene.read_text():
            raise NotApplicable(str(scene), "has joints, of whose rows and impulses Bullet tells nothing")
        self.p, self.dt, self.version = p, given["dt"], str(p.getAPIVersion())
        sweeps = int(given["numSolverIterations"])
        settings = {key: given[key] for key in ("solverResidualThreshold", "contactERP")}
        p.setGravity(*GRAVITY)
        p.setTimeStep(self.dt)
        p.setPhysicsEngineParameter(
            reportSolverAnalytics=1, enableConeFriction=1, contactSlop=SLOP, numSolverIterations=sweeps, **settings
        )
        self.info = {b: p.getDynamicsInfo(b, -1) for b in bodies}  # mass, friction, inertia, its place and axes, ...
        for b in bodies:
            p.changeDynamics(b, -1, linearDamping=0.0, angularDamping=0.0)
        self.at = {b: 6 * k for k, b in enumerate(b for b in bodies if self.info[b][0] > 0.0)}
        self.names = [p.getBodyInfo(b)[0].decode() for b in bodies]

    def step(self) -> EngineStep:
        v, M, places = self._state()
        reports = self.p.stepSimulation() or ()
        after, contacts = self._state()[0], self.p.getContactPoints()
        J, r, mu = np.zeros((3 * len(contacts), v.size)), np.zeros(3 * len(contacts)), np.zeros(len(contacts))
        for c, contact in enumerate(contacts):
            rows, frame = slice(3 * c, 3 * c + 3), np.array([contact[7], contact[11], contact[13]])
            for body, point, sign in ((contact[1], contact[5], 1.0), (contact[2], contact[6], -1.0)):
                if body in self.at:
                    k = self.at[body]
                    J[rows, k : k + 3] += sign * frame
                    J[rows, k + 3 : k + 6] += sign * np.cross(np.array(point) - places[body], frame)
            r[rows] = self.dt * np.array([contact[9], contact[10], contact[12]])
            mu[c] = self.info[contact[1]][1] * self.info[contact[2]][1]
        force = np.zeros(v.size)
        for b, k in self.at.items():
            force[k : k + 3] = self.info[b][0] * GRAVITY
            force[k + 3 : k + 6] = -np.cross(v[k + 3 : k + 6], M[k + 3 : k + 6, k + 3 : k + 6] @ v[k + 3 : k + 6])
        depth = np.array([contact[8] for contact in contacts]) + SLOP
        q = J @ (v + self.dt * np.linalg.solve(M, force))
        q[::3] += np.where(depth > 0.0, 1.0, self.given["contactERP"]) * depth / self.dt
        rigid, reactions = under_coulomb(M, J, after, r, mu, np.maximum(depth - SLOP, 0.0) / self.dt)
        D = np.asarray(rigid.W).diagonal().reshape(-1, 3).copy()
        D = (np.column_stack([D[:, 0], D[:, 1:].mean(axis=1), D[:, 1:].mean(axis=1)]) / D).ravel()
        problem = FrictionContact(W=D[:, None] * rigid.W, q=D * q, mu=mu)
        sweeps = max((int(report["numIterationsUsed"]) for report in reports), default=0)
        converged = sweeps < self.given["numSolverIterations"]
        return EngineStep(problem, reactions, converged, sweeps, rigid, reactions, np.arange(r.size) // 3)

    def _state(self) -> tuple[Any, Any, dict[int, Any]]:
        """Return the velocities, the mass matrix about centres of mass in the axes of the world, and these centres."""
        n = 6 * len(self.at)
        v, M, places = np.zeros(n), np.zeros((n, n)), {}
        for b, k in self.at.items():
            place, turn = self.p.getBasePositionAndOrientation(b)
            v[k : k + 6] = np.concatenate(self.p.getBaseVelocity(b))
            axes = [np.reshape(self.p.getMatrixFromQuaternion(q), (3, 3)) for q in (turn, self.info[b][4])]
            R, places[b] = axes[0] @ axes[1], np.array(place)
            M[k : k + 3, k : k + 3] = self.info[b][0] * np.eye(3)
            M[k + 3 : k + 6, k + 3 : k + 6] = R @ np.diag(self.info[b][2]) @ R.T
        return v, M, places


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Send what Bullet prints of files to where errors go: the place of the results is another."""
    kept = os.dup(1)
    os.dup2(2, 1)
    yield
    ctypes.CDLL(None).fflush(None)
    os.dup2(kept, 1)
