"""The contacts of a step of MuJoCo or Pinocchio as a problem of frictional contact, for `Recorder.add`.

With J the velocities of body 2 against body 1 at the contacts, by the velocities of the joints, and v' the joints'
velocities after a step dt without contact forces: u = Wr + q with W = JM⁻¹Jᵀ and q = Jv', r the impulses [N s]. A
contact that is open by a distance g > 0 may close it within the step: q_N has g/dt more. Depths of penetration are left
alone.
"""

from __future__ import annotations

import importlib
from collections import Counter
from typing import Any

import numpy as np

from cpbench.errors import ProblemError, Unavailable
from cpbench.formulations.base import Contacts
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation.matrices import Dense, Vector
from cpbench.foundation.text import counted

OF_PAIR = 4096
"""Numbers that each pair of geometries has for its contacts."""


def from_mujoco(model: Any, data: Any, *, contacts_alone: bool = False, name: str = "") -> FrictionContact:
    """Return the contacts of MuJoCo's present state as a problem, with their ids, bodies, positions and frames.

    Call it after `mj_forward` or `mj_step1`; the rigid law is asked, not MuJoCo's soft one. v' = qvel + dt qacc_smooth.
    An id has the pair of geometries and the number of the contact among those of the pair.

    Parameters
    ----------
    model, data : `mujoco.MjModel` and `mujoco.MjData`. contacts_alone : whether rows of equality constraints, limits
        and joint friction are left out of the problem; else a state with any is refused. name : of the problem.

    Raises ProblemError on such rows, on torsional and rolling friction (condim 4 and 6), on two coefficients of
    friction at one contact, and on contacts of flexible bodies.

    >>> import cpbench, mujoco
    >>> floor, ball = '<geom type="plane" size="1 1 1"/>', '<freejoint/><geom type="sphere" size="0.1" mass="2"/>'
    >>> text = f'<mujoco><worldbody>{floor}<body pos="0 0 0.0999">{ball}</body></worldbody></mujoco>'
    >>> model = mujoco.MjModel.from_xml_string(text)
    >>> data = mujoco.MjData(model)
    >>> mujoco.mj_forward(model, data)
    >>> recorder = cpbench.Recorder("rest", dt=model.opt.timestep)
    >>> recorder.add(cpbench.from_mujoco(model, data))
    >>> round(float(cpbench.solve(recorder.steps[0]).x[0]), 6)  # the impulse that carries 2 kg for 2 ms
    0.03924
    """
    mujoco = _package("mujoco")
    contacts = data.contact
    active = [k for k in range(data.ncon) if contacts.efc_address[k] >= 0]
    _require_sliding(model, data, active, contacts_alone)
    J, gap = np.zeros((3 * len(active), model.nv)), np.zeros(len(active))
    for row, k in enumerate(active):
        velocities = []
        for geom in contacts.geom[k]:
            jacobian = np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, jacobian, None, contacts.pos[k], int(model.geom_bodyid[geom]))
            velocities.append(jacobian)
        J[3 * row : 3 * row + 3] = contacts.frame[k].reshape(3, 3) @ (velocities[1] - velocities[0])
        gap[row] = contacts.dist[k]
    solved = np.zeros_like(J)
    if active:
        mujoco.mj_solveM(model, data, solved, J)
    free = data.qvel + model.opt.timestep * data.qacc_smooth
    pairs = [(int(first), int(second)) for first, second in contacts.geom[active]]
    known = Contacts(
        id=np.array(_ids(pairs, model.ngeom), dtype=np.int64),
        bodies=model.geom_bodyid[contacts.geom[active]].reshape(-1, 2),
        position=contacts.pos[active],
        frame=contacts.frame[active].reshape(-1, 3, 3),
    )
    mu = np.array([contacts.friction[k][0] if contacts.dim[k] > 1 else 0.0 for k in active])
    return _problem(J, solved, free, gap, model.opt.timestep, mu, known, name)


def from_pinocchio(
    model: Any,
    data: Any,
    geometry_model: Any,
    geometry_data: Any,
    q: Vector,
    v: Vector,
    *,
    mu: float,
    dt: float,
    tau: Vector | None = None,
    name: str = "",
) -> FrictionContact:
    """Return the contacts that Pinocchio's collision detection found as a problem, with their ids, positions, frames,
    and joints as bodies.

    Call it after `pinocchio.computeCollisions` with requests that enable contacts; `data` is overwritten. v' = v + dt
    M⁻¹(tau − nle).

    Parameters
    ----------
    model, data, geometry_model, geometry_data : of Pinocchio. q, v, tau : (nq,), (nv,) and (nv,); tau None for 0.
    mu : coefficient of friction of all contacts. dt : step [s]. name : of the problem.

    Raises ProblemError where the sizes of q, v or tau are not those of the model.
    """
    pinocchio = _package("pinocchio", "pin")
    tau = np.zeros(model.nv) if tau is None else tau
    for label, given, size in (("q", q, model.nq), ("v", v, model.nv), ("tau", tau, model.nv)):
        if np.shape(given) != (size,):
            raise ProblemError(f"pinocchio.{label}", f"has shape {np.shape(given)}, expected ({size},)")
    pinocchio.computeJointJacobians(model, data, q)
    contacts: list[tuple[tuple[int, int], Any]] = []
    for pair, result in zip(geometry_model.collisionPairs, geometry_data.collisionResults, strict=True):
        contacts += [((int(pair.first), int(pair.second)), contact) for contact in result.getContacts()]
    J = np.zeros((3 * len(contacts), model.nv))
    frames, joints = np.zeros((len(contacts), 3, 3)), np.zeros((len(contacts), 2), np.int64)
    for row, (pair, contact) in enumerate(contacts):
        frames[row] = _frame(np.asarray(contact.normal, float))
        joints[row] = [geometry_model.geometryObjects[geometry].parentJoint for geometry in pair]
        first, second = (_velocity(model, data, int(joint), contact.pos) for joint in joints[row])
        J[3 * row : 3 * row + 3] = frames[row] @ (second - first)
    M = pinocchio.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    free = v + dt * np.linalg.solve(M, tau - pinocchio.nonLinearEffects(model, data, q, v))
    known = Contacts(
        id=np.array(_ids([pair for pair, _ in contacts], geometry_model.ngeoms), dtype=np.int64),
        bodies=joints,
        position=np.array([contact.pos for _, contact in contacts]).reshape(-1, 3),
        frame=frames,
    )
    gap = np.array([contact.penetration_depth for _, contact in contacts])  # negative inside, as a distance
    coefficients = np.full(len(contacts), mu)
    return _problem(J, np.linalg.solve(M, J.T).T, free, gap, dt, coefficients, known, name)


def _package(name: str, distribution: str = "") -> Any:
    """Return a package; raises Unavailable where it is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise Unavailable("missing", f"{name} is not installed: pip install {distribution or name}") from None


def _require_sliding(model: Any, data: Any, active: list[int], contacts_alone: bool) -> None:
    """Raise ProblemError where a state of MuJoCo has more than contacts with sliding friction."""
    contacts = data.contact
    for k in active:
        if min(contacts.geom[k]) < 0:
            raise ProblemError("mujoco", f"has a flexible body at contact {k}, which has no Jacobian of a rigid one")
        if contacts.dim[k] > 3:
            text = f"has condim {contacts.dim[k]} at contact {k}, torsional or rolling friction, expected 1 or 3"
            raise ProblemError("mujoco", text)
        first, second = contacts.friction[k][:2]
        if contacts.dim[k] == 3 and first != second:
            raise ProblemError("mujoco", f"has the coefficients {first:g} and {second:g} at contact {k}, expected one")
    types = Counter(int(kind) for kind in data.efc_type[: data.nefc])
    others = sum(count for kind, count in types.items() if kind < _first_contact_row())
    if others and not contacts_alone:
        text = f"has {counted(others, 'row')} of equality constraints, limits or joint friction beside its contacts"
        raise ProblemError("mujoco", f"{text}: contacts_alone=True leaves them out")


def _first_contact_row() -> int:
    return int(_package("mujoco").mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS)


def _ids(pairs: list[tuple[int, int]], geometries: int) -> list[int]:
    """Return a number for each contact, from its pair and its place among the contacts of the pair."""
    seen: Counter[tuple[int, int]] = Counter()
    ids = []
    for first, second in pairs:
        ids.append((first * geometries + second) * OF_PAIR + seen[first, second])
        seen[first, second] += 1
    return ids


def _frame(normal: Vector) -> Dense:
    """Return the normal and two tangents as rows."""
    axis = np.eye(3)[int(np.argmin(np.abs(normal)))]
    tangent: Any = np.cross(normal, axis)
    tangent = tangent / np.linalg.norm(tangent)
    return np.array([normal, tangent, np.cross(normal, tangent)], dtype=np.float64)


def _velocity(model: Any, data: Any, joint: int, position: Vector) -> Dense:
    """Return the velocity of a point of a body of Pinocchio, (3, nv); 0 of what is fixed."""
    if joint == 0:
        return np.zeros((3, model.nv))
    pinocchio = _package("pinocchio", "pin")
    world = pinocchio.getJointJacobian(model, data, joint, pinocchio.LOCAL_WORLD_ALIGNED)
    return world[:3] - pinocchio.skew(position - data.oMi[joint].translation) @ world[3:]


def _problem(
    J: Dense, solved: Dense, free: Vector, gap: Vector, dt: float, mu: Vector, contacts: Contacts, name: str
) -> FrictionContact:
    """Return the problem; `solved` are the rows of JM⁻¹, `free` is v'."""
    W, q = solved @ J.T, J @ free
    q[::3] += np.maximum(gap, 0.0) / dt
    return FrictionContact(W=0.5 * (W + W.T), q=q, mu=mu, contacts=contacts, name=name)
