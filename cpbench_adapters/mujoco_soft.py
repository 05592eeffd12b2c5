"""MuJoCo's constraint solver on strictly convex quadratic programs over friction cones.

MuJoCo's contact forces solve  min ½fᵀ(JM⁻¹Jᵀ + R)f + (Ja₀ − a_ref)ᵀf  over elliptic cones, with a regularisation R > 0
that is one number a contact (Todorov 2014). Every program with A = I, b = 0 and Q ≻ 0 is of that form: with D the mean
of Q's diagonal over each factor, R = θD with the largest θ of 10⁻¹, 10⁻², … for which Q − R = JJᵀ ⪰ 0, and M = I.

MuJoCo knows scenes, not matrices. It gets one of n coordinates with unit mass and, by `mj_addContact` and
`mj_makeConstraint`, one contact a factor; then the rows of J, R and a_ref = −p are written where it keeps its own, and
`mj_fwdConstraint` runs the solver it would run on them. Nothing else of a scene takes part: no gravity, no collision,
no islands, impratio 1. The problem is scaled first, Q to mean diagonal 1 and p to max|p| = 1.

Tolerance ε: MuJoCo stops when the gradient or the gain of a step, over n, is below its own. A gain is the square of an
error, in forces for PGS, which gets (ε/10)²/n; Newton and CG gain in accelerations, from which forces are 1/R away:
they get (θε/10)²/n. The claim is that it stopped before the last iteration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.errors import NotApplicable
from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Dense, Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping, no_looser

WIDTH = {1: 1, 2: 3, 3: 3, 4: 4, 5: 6, 6: 6}
"""Rows of the contact that a factor becomes: MuJoCo knows 1, 3, 4 and 6, and what is too much gets rows of zeros."""
DECADES = 8
"""R is not less than 10⁻⁸ D."""
LARGEST = 6_000
"""Unknowns up to which J and the matrices of its size that MuJoCo makes (290 MB each) are kept."""


@dataclass(frozen=True)
class MuJoCoOptions:
    """Options of mujoco-soft. `method` : newton, cg or pgs. `max_iterations` : the most."""

    method: str = "newton"
    max_iterations: int = 1_000


@dataclass(frozen=True)
class _Scene:
    """MuJoCo's scene of a problem. `model`, `data` : MuJoCo's. `J` : JJᵀ = Q − R, scaled. `active` : the unknowns of
    its rows. `row` : where those are among MuJoCo's constraints. `unit` : x = unit·f. `theta` : R = θD."""

    problem: ConeQP
    model: Any
    data: Any
    J: Dense
    active: NDArray[np.intp]
    row: NDArray[np.intp]
    unit: float
    theta: float


@register
class MuJoCoSoft(Solver):
    """Newton on the primal (accelerations), conjugate gradients, or Gauss–Seidel on the dual (forces)."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="mujoco-soft",
        node="coneqp",
        summary="MuJoCo's constraint solver on strictly convex programs over friction cones",
        method="Newton",
        citation="Todorov, ICRA 2014: Convex and analytically-invertible dynamics with contacts and constraints",
        requires=("mujoco",),
        install="pip install mujoco",
        licence="Apache-2.0",
        traits=frozenset({Trait.WARM_START, Trait.DETERMINISTIC}),
        options=MuJoCoOptions,
    )

    def obstacle(self, problem: ConeQP) -> str | None:
        n = problem.p.size
        if n > LARGEST:
            return f"has {n} unknowns > {LARGEST}: MuJoCo would make dense matrices of {8e-9 * n * n:.1f} GB"
        for kind, rows, mu, _ in problem.K.groups:
            size = rows.shape[1]
            if kind not in (Cone.ZERO, Cone.NONNEGATIVE, Cone.SECOND_ORDER):
                return f"has a factor {kind.name}; MuJoCo knows half lines and friction cones"
            if kind == Cone.SECOND_ORDER and (size not in WIDTH or not np.isfinite(mu).all()):
                return f"has a cone of {size} components, mu = {mu.max():g}; MuJoCo's have at most 6, and a finite mu"
        if problem.b.any() or not _is_identity(problem):
            return "has Ax + b in a cone; MuJoCo's forces are in cones themselves: A = I, b = 0"
        contacts = _contacts(problem.K)
        if not contacts:
            return "has no unknown that may be other than 0: there is nothing to minimise"
        Q, D, _ = _scaled(problem, contacts)
        if not (D > 0).all() or _factor(Q, D, 10.0**-DECADES) is None:
            return f"Q - 1e-{DECADES:02d} diag Q is not positive definite; on contacts take fc-coneqp-compliant"
        return None

    def setup(self, problem: ConeQP, budget: Budget, options: MuJoCoOptions) -> _Scene:
        contacts = _contacts(problem.K)
        Q, D, w = _scaled(problem, contacts)
        theta, J = _split(Q, D)
        active = np.concatenate([rows for rows, _ in contacts])
        s = matrices.max_abs(problem.p[active]) or 1.0
        model, data = _scene(active.size, [(WIDTH[rows.size], mu) for rows, mu in contacts])
        address = np.array(data.contact.efc_address)
        row = np.concatenate([a + np.arange(rows.size) for a, (rows, _) in zip(address, contacts, strict=True)])
        whole = np.zeros((data.nefc, active.size))
        whole[row] = J
        data.efc_J[:] = whole.ravel()
        first = np.cumsum([0, *(rows.size for rows, _ in contacts)])[:-1]
        R = theta * np.repeat(D[first], [WIDTH[rows.size] for rows, _ in contacts])
        data.efc_R[:], data.efc_D[:] = R, 1.0 / R
        reference = np.zeros(data.nefc)
        reference[row] = -problem.p[active] / s
        data.efc_aref[:] = reference
        return _Scene(problem, model, data, J, active, row, s / w, theta)

    def solve(
        self,
        prepared: _Scene,
        budget: Budget,
        options: MuJoCoOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        import mujoco

        model, data, problem = prepared.model, prepared.data, prepared.problem
        limit = budget.iterations or options.max_iterations
        model.opt.solver = getattr(mujoco.mjtSolver, f"mjSOL_{options.method.upper()}")
        theta = 1.0 if options.method == "pgs" else prepared.theta
        model.opt.iterations = limit
        model.opt.tolerance = self.stopping(budget.tolerance * theta, problem).settings["tolerance"]
        force = np.zeros(prepared.active.size) if start is None else start.x[prepared.active] / prepared.unit
        data.qacc_warmstart[:] = prepared.J.T @ force
        if options.method == "pgs":
            mujoco.mj_projectConstraint(model, data)
        mujoco.mj_fwdConstraint(model, data)
        iterations = int(data.solver_niter[0])
        x = np.zeros(problem.p.size)
        x[prepared.active] = prepared.unit * data.efc_force[prepared.row]
        counters = {"iterations": iterations}
        if not np.isfinite(x).all():
            return SolverOutput(claim=Claim.FAILED, counters=counters, message="not finite")
        return SolverOutput(
            claim=Claim.SOLVED if iterations < limit else Claim.MAX_ITER,
            point=ConeQPPoint(x=x, y=problem.Q @ x + problem.p),
            counters=counters,
            message=f"R = {prepared.theta:.0e} of Q's diagonal",
        )

    def stopping(self, tolerance: float, problem: ConeQP | None = None) -> Stopping:
        n, defaults = 1 if problem is None else max(problem.p.size, 1), {"tolerance": 1e-8}
        settings = no_looser({"tolerance": (0.1 * tolerance) ** 2 / n}, defaults)
        return Stopping(test="gradient or gain of a step, over n, of scaled data", settings=settings, defaults=defaults)

    def warmup(self) -> None:
        K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.5))
        self.run(ConeQP.over(np.eye(3), -np.ones(3), K))


def _contacts(K: ProductCone) -> list[tuple[NDArray[np.intp], float]]:
    """Return the unknowns and μ of every contact that K becomes; unknowns that K keeps at 0 are in none."""
    result: list[tuple[NDArray[np.intp], float]] = []
    for kind, rows, mu, _ in K.groups:
        if kind == Cone.NONNEGATIVE:
            result += [(np.array([i]), 1.0) for i in rows.ravel()]
        elif kind == Cone.SECOND_ORDER:
            result += [(r if m > 0 else r[:1], float(m) or 1.0) for r, m in zip(rows, mu, strict=True)]
    return result


def _is_identity(problem: ConeQP) -> bool:
    n = problem.p.size
    return problem.A.shape == (n, n) and matrices.max_abs(problem.A - sp.eye_array(n)) == 0.0


def _scaled(problem: ConeQP, contacts: list[tuple[NDArray[np.intp], float]]) -> tuple[Dense, Vector, float]:
    """Return Q of the active unknowns over w, the mean of its diagonal; D, its mean over each contact; w."""
    active = np.concatenate([rows for rows, _ in contacts])
    Q = matrices.dense(problem.Q)[np.ix_(active, active)]
    w = float(Q.diagonal().mean())
    w = w if w > 0 else 1.0
    Q = Q / w
    last = np.cumsum([rows.size for rows, _ in contacts])
    D = np.concatenate([np.full(d.size, d.mean()) for d in np.split(Q.diagonal(), last[:-1])])
    return Q, D, w


def _factor(Q: Dense, D: Vector, theta: float) -> Dense | None:
    """Return J with JJᵀ = Q − θD, lower triangular, or None."""
    root = np.sqrt(D)
    S = Q / np.outer(root, root)
    S[np.diag_indices_from(S)] -= theta
    try:
        return root[:, None] * la.cholesky(S, lower=True, overwrite_a=True, check_finite=False)
    except la.LinAlgError:
        return None


def _split(Q: Dense, D: Vector) -> tuple[float, Dense]:
    """Return the largest θ = 10⁻¹, 10⁻², … that leaves Q − θD a factor, and the factor."""
    for k in range(1, DECADES + 1):
        J = _factor(Q, D, 10.0**-k)
        if J is not None:
            return 10.0**-k, J
    raise NotApplicable("mujoco-soft", "Q is not positive definite")


def _scene(n: int, contacts: list[tuple[int, float]]) -> tuple[Any, Any]:
    """Return a scene of n unit masses on rails, and a contact of so many rows and that μ for each of `contacts`."""
    import mujoco

    spec = mujoco.MjSpec()
    spec.memory = int(40 * n * n + 20_000 * (n + len(contacts))) + 2**24
    option = spec.option
    option.gravity = np.zeros(3)
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 1.0
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    ball = {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [0.1, 0.0, 0.0], "contype": 0, "conaffinity": 0}
    spec.worldbody.add_geom(**ball)
    for first in range(0, n, 3):
        body = spec.worldbody.add_body(mass=1.0, inertia=np.ones(3), explicitinertial=True)
        for axis in np.eye(3)[: n - first]:
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        body.add_geom(**ball)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)  # the factor of M = I
    contact = mujoco.MjContact()
    contact.geom1, contact.geom2, contact.geom = 0, 1, [0, 1]  # the fixed ball and the first that moves
    contact.flex = contact.elem = contact.vert = [-1, -1]
    contact.frame, contact.dist = np.eye(3).ravel(), -1.0
    contact.solref, contact.solimp = [0.02, 1.0], [0.9, 0.95, 0.001, 0.5, 2.0]  # R is written over
    for rows, mu in contacts:
        contact.dim, contact.friction = rows, np.full(5, mu)
        mujoco.mj_addContact(model, data, contact)
    mujoco.mj_makeConstraint(model, data)
    data.qacc_smooth[:] = 0.0
    return model, data
