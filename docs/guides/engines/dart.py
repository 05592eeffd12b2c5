"""DART (dartpy) as a plugin of `cpbench audit`: contacts of trees of bodies, by its boxed LCP and Dantzig's method.

    cpbench --plugin dart.py audit dart pile --steps 200

A step has, with J the rows N, T₁, T₂ of the contacts, W = JM⁻¹Jᵀ, v' = v + dt M⁻¹τ and A = W with 10⁻⁵ more on its
diagonal, Ar = b + w with b = −Jv', and in normal rows erp · depth/dt more: 1 mm/s at most, and 0.1 m/s where three or
more trees touch one another, as the steps themselves show. Friction is a box, and its bounds are taken once: μ times
the normal impulses that solve the rows of normals alone. μ is the lesser of both coefficients. dartpy hands out contact
forces, but neither A nor the impulses of limits: scenes with limits or damped joints are refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

import cpbench
from cpbench.errors import NotApplicable, UnknownName
from cpbench_lab.audit.engine import Engine, EngineStep, engines, package, under_coulomb

CFM, ERP, FEW, MANY = 1e-5, 0.01, 1e-3, 0.1


@engines.register("dart")
class Dart(Engine):
    """DART with a scene in MJCF, its default LCP solver, and ODE's collision detection, which knows capsules."""

    package = "dartpy"
    law = "boxed LCP, bounds of friction taken once from the normal impulses without friction (Dantzig)"

    def __init__(self, scene: Path, options: Mapping[str, str]) -> None:
        dart: Any = package("dartpy")
        if unknown := [name for name in options if name != "dt"]:
            raise UnknownName("option of DART", unknown[0], ["dt"])
        world = self.world = dart.utils.MjcfParser.readWorld(str(scene))
        if world is None:
            raise NotApplicable(str(scene), "DART does not read it")
        trees = self.trees = [world.getSkeleton(k) for k in range(world.getNumSkeletons())]
        joints = [tree.getJoint(k) for tree in trees for k in range(tree.getNumJoints())]
        if any(j.areLimitsEnforced() or any(j.getDampingCoefficient(k) for k in range(j.getNumDofs())) for j in joints):
            raise NotApplicable(str(scene), "has limits or damping of joints, of which dartpy hands out no impulses")
        world.setTimeStep(float(options.get("dt", 0.002)))
        world.getConstraintSolver().setCollisionDetector(dart.collision.OdeCollisionDetector())
        self.version, self.dt = dart.__version__, world.getTimeStep()
        ends = np.cumsum([tree.getNumDofs() for tree in trees])
        self.at = {t.getName(): slice(end - t.getNumDofs(), end) for t, end in zip(trees, ends, strict=True)}
        self.n, self.names = int(ends[-1]), [tree.getName() for tree in trees]

    def step(self) -> EngineStep:
        M, v, tau = np.zeros((self.n, self.n)), np.zeros(self.n), np.zeros(self.n)
        moving = [tree for tree in self.trees if tree.getNumDofs()]
        for tree in moving:
            at = self.at[tree.getName()]
            M[at, at], v[at] = tree.getMassMatrix(), tree.getVelocities()
            tau[at] = tree.getForces() + tree.getExternalForces() - tree.getCoriolisAndGravityForces()
        before = [np.array(tree.getPositions()) for tree in moving]
        self.world.step()
        ended = [(np.array(tree.getPositions()), np.array(tree.getVelocities())) for tree in moving]
        contacts = self.world.getLastCollisionResult().getContacts()
        for tree, places in zip(moving, before, strict=True):  # the rows are those of the positions before
            tree.setPositions(places)
        J, r, mu = np.zeros((3 * len(contacts), self.n)), np.zeros(3 * len(contacts)), np.zeros(len(contacts))
        depth, numbers, touched = np.zeros(len(contacts)), dict[str, int](), list[tuple[int, int]]()
        for c, contact in enumerate(contacts):
            rows, frame = slice(3 * c, 3 * c + 3), _frame(np.ravel(contact.normal))
            shapes = [one.getShapeFrame().asShapeNode() for one in (contact.collisionObject1, contact.collisionObject2)]
            for shape, sign in zip(shapes, (1.0, -1.0), strict=True):
                body = shape.getBodyNode()
                tree = body.getSkeleton()
                if tree.getNumDofs():
                    touched.append((c, numbers.setdefault(tree.getName(), len(numbers))))
                    place = body.getWorldTransform().inverse().multiply(np.ravel(contact.point))
                    J[rows, self.at[tree.getName()]] += sign * frame @ tree.getLinearJacobian(body, place)
            r[rows], depth[c] = self.dt * frame @ np.ravel(contact.force), contact.penetrationDepth
            mu[c] = min(shape.getDynamicsAspect().getFrictionCoeff() for shape in shapes)
        after = np.zeros(self.n)
        for tree, (places, velocities) in zip(moving, ended, strict=True):
            tree.setPositions(places)
            tree.setVelocities(velocities)
            after[self.at[tree.getName()]] = velocities
        rigid, reactions = under_coulomb(M, J, after, r, mu, np.zeros(len(contacts)))
        A = np.asarray(rigid.W) * (1.0 + CFM * np.eye(3 * len(contacts)))
        b = -J @ (v + self.dt * np.linalg.solve(M, tau))
        b[::3] += np.minimum(ERP * depth / self.dt, np.where(_together(touched, len(contacts)) >= 3, MANY, FEW))
        normals = np.arange(b.size) % 3 == 0
        bound = np.zeros(b.size)
        if b.size:  # the normal impulses of the rows of normals alone
            alone = cpbench.solve(cpbench.LCP(M=A[::3, ::3], q=-b[::3]), "lemke", tolerance=1e-12)
            bound = np.repeat(mu * alone.point.z, 3)
        law = cpbench.from_boxed_lcp(A, b, np.where(normals, 0.0, -bound), np.where(normals, np.inf, bound))
        answer = law.problem.point_from_vector(
            np.concatenate([r, np.zeros(sum(law.problem.point_sizes.values()) - r.size)])
        )
        return EngineStep(law.problem, answer, None, 0, rigid, reactions, np.arange(answer.vector.size) // 3)


def _together(touched: list[tuple[int, int]], count: int) -> Any:
    """Return how many trees touch one another at each of so many contacts; `touched` : contacts with their trees."""
    ends = np.reshape([(c, count + tree) for c, tree in touched], (-1, 2)).astype(int)
    n = count + len({tree for _, tree in touched})
    island = connected_components(sp.coo_array((np.ones(len(ends)), ends.T), shape=(n, n)), directed=False)[1]
    return np.bincount(island[count:], minlength=n)[island[:count]]


def _frame(normal: Any) -> Any:
    """Return the normal and DART's tangents as rows: across the normal and z, or x where these are parallel."""
    tangent = np.cross(normal, [0.0, 0.0, 1.0])
    if np.linalg.norm(tangent) < 1e-6:
        tangent = np.cross(normal, [1.0, 0.0, 0.0])
    tangent /= np.linalg.norm(tangent)
    return np.array([normal, tangent, np.cross(normal, tangent)])
