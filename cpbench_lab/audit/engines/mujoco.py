"""MuJoCo: each step is a convex program over accelerations, of which `data.efc_*` has the numbers.

With constraint forces f, accelerations a, R > 0 and a_ref of `efc_R` and `efc_aref` (Todorov 2014):

    min ½aᵀMa − τᵀa + ½fᵀRf + ηᵀ(t⁺ + t⁻)   subject to   Ja − a_ref + Rf (+ t⁺ − t⁻ in rows of joint friction) ∈ K*

Its multipliers are the forces themselves: in ℝ for equalities, |f| ≤ η for friction of joints (`efc_frictionloss`),
f ≥ 0 for limits, contacts without friction and edges of pyramids, and ‖f_i/μ_i‖ ≤ f_N in elliptic cones. The answer is
`qacc` and `efc_force`; a wrong factor breaks Ma = τ + Jᵀf.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from cpbench.errors import CpbenchError, NotApplicable, UnknownName
from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Dense, Vector
from cpbench_lab.audit.engine import Engine, EngineStep, engines, package, under_coulomb

EQUALITY, FRICTION_TENDON, FRICTIONLESS, PYRAMIDAL, ELLIPTIC = 0, 2, 5, 6, 7
"""Numbers of `mjtConstraint`; those up to FRICTION_TENDON, but for equalities, are boxes."""
CHOICES = {"cone": "mjtCone", "solver": "mjtSolver", "integrator": "mjtIntegrator", "jacobian": "mjtJacobian"}


@engines.register("mujoco")
class MuJoCo(Engine):
    """MuJoCo with a scene in MJCF, from its first keyframe where it has one."""

    package: ClassVar[str] = "mujoco"
    law: ClassVar[str] = "min over accelerations with R and a_ref, elliptic or pyramidal cones (data.efc_*)"

    def __init__(self, scene: Path, options: Mapping[str, str]) -> None:
        mujoco = self.mujoco = package("mujoco", "'cpbench[mujoco]'")
        try:
            model = self.model = mujoco.MjModel.from_xml_path(str(scene))
        except ValueError as cause:
            raise NotApplicable(str(scene), f"MuJoCo does not read it: {' '.join(str(cause).split())}") from None
        for name, value in options.items():
            _set(mujoco, model.opt, name, value)
        kinds, flags = mujoco.mjtIntegrator, int(model.opt.enableflags)
        integrators = (kinds.mjINT_EULER, kinds.mjINT_IMPLICIT, kinds.mjINT_IMPLICITFAST)
        if model.opt.integrator not in map(int, integrators):
            raise NotApplicable(str(scene), "steps of RK4 and discrete are several problems: set integrator=Euler")
        unlike = [name for name in ("SLEEP", "IPC") if flags & int(getattr(mujoco.mjtEnableBit, f"mjENBL_{name}", 0))]
        if unlike or model.opt.noslip_iterations:
            raise NotApplicable(str(scene), f"has {', '.join(unlike) or 'noslip_iterations'}: R is not the law then")
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, self.data, 0)
        self.version, self.dt = mujoco.__version__, float(model.opt.timestep)
        self.names = [model.body(b).name or f"{b}" for b in range(model.nbody)]

    def step(self) -> EngineStep:
        model, data = self.model, self.data
        self.mujoco.mj_step1(model, data)
        self.mujoco.mj_step2(model, data)
        M, J = np.zeros((model.nv, model.nv)), self._jacobian()
        if hasattr(data, "qM"):  # of older versions
            self.mujoco.mj_fullM(model, M, data.qM)
        else:
            self.mujoco.mj_fullM(model, data, M)
        return captured(model, data, M, J, bool((data.solver_niter[: data.nisland] < model.opt.iterations).all()))

    def _jacobian(self) -> Dense:
        """Return the rows of all constraints, (nefc, nv)."""
        model, data, J = self.model, self.data, np.zeros((self.data.nefc, self.model.nv))
        if self.mujoco.mj_isSparse(model):
            self.mujoco.mju_sparse2dense(J, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
        elif J.size:
            J[:] = np.reshape(data.efc_J, J.shape)
        return J


def _set(mujoco: Any, option: Any, name: str, value: str) -> None:
    """Set one of `mjOption`; raises CpbenchError on a value, UnknownName."""
    known = [other for other in dir(option) if not other.startswith("_") and np.ndim(getattr(option, other)) == 0]
    if name not in known:
        raise UnknownName("option of MuJoCo", name, known)
    choices = {key.split("_", 1)[1].lower(): int(v) for key, v in _members(mujoco, name).items()}
    try:
        number = float(choices.get(value.lower(), value))
        setattr(option, name, int(number) if isinstance(getattr(option, name), int) or choices else number)
    except (ValueError, TypeError):
        expected = ", ".join(choices) if choices else "a number"
        raise CpbenchError(f"--engine-option {name}={value}: expected {expected}") from None


def _members(mujoco: Any, name: str) -> Mapping[str, Any]:
    return getattr(mujoco, CHOICES[name]).__members__ if name in CHOICES else {}


def captured(model: Any, data: Any, M: Dense, J: Dense, converged: bool) -> EngineStep:
    """Return the step that MuJoCo's data have after it was taken; M (nv, nv), J (nefc, nv) of before it."""
    nv, n, contact = model.nv, int(data.nefc), data.contact
    kind, R = np.array(data.efc_type[:n], dtype=int), np.array(data.efc_R[:n])
    scale, size = np.ones(n), np.ones(n, dtype=int)
    cone = np.where(kind <= FRICTION_TENDON, Cone.ZERO, Cone.NONNEGATIVE)
    of = np.full(n, -1)
    address, dims, friction = (np.array(getattr(contact, part)) for part in ("efc_address", "dim", "friction"))
    active = np.flatnonzero(address >= 0)
    for k in active:
        first, dim = address[k], dims[k]
        rows = slice(first, first + (2 * (dim - 1) if kind[first] == PYRAMIDAL else dim))
        of[rows] = k
        if kind[first] == ELLIPTIC:
            scale[first + 1 : first + dim] = friction[k, : dim - 1]
            cone[first], size[first], size[first + 1 : first + dim] = Cone.SECOND_ORDER, dim, 0
    box = np.flatnonzero((kind > EQUALITY) & (kind <= FRICTION_TENDON))
    eta, b = np.array(data.efc_frictionloss[:n])[box], box.size
    f, a, reference = (np.array(x, dtype=float) for x in (data.efc_force[:n], data.qacc, data.efc_aref[:n]))
    split = np.zeros((n, 2 * b))
    split[box, np.arange(b)], split[box, b + np.arange(b)] = 1.0, -1.0
    off = (J @ a - reference + R * f)[box]
    t = np.concatenate([np.maximum(-off, 0.0), np.maximum(off, 0.0)])
    rows = sp.csr_array(np.hstack([scale[:, None] * J, np.diag(scale * R), split]))
    some = size > 0
    factors = np.concatenate([cone[some], np.full(2 * b, Cone.NONNEGATIVE)])
    problem = ConeQP(
        Q=sp.csr_array(la.block_diag(M, np.diag(R), np.zeros((2 * b, 2 * b)))),
        p=np.concatenate([-np.array(data.qfrc_smooth), np.zeros(n), eta, eta]),
        A=sp.vstack([rows, sp.eye_array(2 * b, nv + n + 2 * b, k=nv + n)]) if b else rows,
        b=np.concatenate([-scale * reference, np.zeros(2 * b)]),
        cone_kind=factors,
        cone_size=np.concatenate([size[some], np.ones(2 * b)]),
        cone_mu=np.ones(factors.size),
    )
    answer = ConeQPPoint(x=np.concatenate([a, f, t]), y=np.concatenate([f / scale, eta - f[box], eta + f[box]]))
    body = np.array(model.dof_bodyid)
    main = np.abs(J).argmax(axis=1) if J.size else np.zeros(n, dtype=int)
    of = np.where(of >= 0, of, -1 - body[main])
    both = np.concatenate([of, np.tile(of[box], 2)])
    owners = np.concatenate([-1 - body, both, both])
    iterations = int(np.max(data.solver_niter, initial=0))
    rigid = [np.zeros((0, nv)), np.zeros(0)]
    for first, dim, mu in zip(address[active], dims[active], friction[active], strict=True):
        rigid = [np.concatenate(both) for both in zip(rigid, _rigid(J, f, first, dim, mu, kind[first]), strict=True)]
    alike = (friction[active, 0] == friction[active, 1]) | (dims[active] == 1)
    slide = np.where(dims[active] > 1, friction[active, 0], 0.0)
    dt, gap = model.opt.timestep, np.maximum(np.array(contact.dist)[active], 0.0)
    contacts, r = under_coulomb(M, rigid[0], np.array(data.qvel), dt * rigid[1], slide, gap / dt)
    return EngineStep(problem, answer, converged, iterations, contacts if alike.all() else None, r, owners)


def _rigid(J: Dense, f: Vector, first: int, dim: int, mu: Vector, kind: int) -> tuple[Dense, Vector]:
    """Return the rows N, T₁, T₂ of a contact and the forces along them; rows of 0 where it has no tangents."""
    rows, forces = np.zeros((3, J.shape[1])), np.zeros(3)
    if kind != PYRAMIDAL:
        count = min(dim, 3)
        rows[:count], forces[:count] = J[first : first + count], f[first : first + count]
        return rows, forces
    forces[0] = f[first : first + 2 * (dim - 1)].sum()
    for t in (1, 2):
        one, other = first + 2 * t - 2, first + 2 * t - 1  # the edges N + μT and N − μT
        rows[0], rows[t] = 0.5 * (J[one] + J[other]), (J[one] - J[other]) / (2.0 * mu[t - 1])
        forces[t] = mu[t - 1] * (f[one] - f[other])
    return rows, forces
