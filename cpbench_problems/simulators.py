"""The contacts of a step of MuJoCo or Pinocchio as a problem of frictional contact, for `Recorder.add`.

With J the velocities of body 2 against body 1 at the contacts, by the velocities of the joints, and v' the joints'
velocities after a step dt without contact forces: u = Wr + q with W = JM⁻¹Jᵀ and q = Jv', r the impulses [N s]. A
contact that is open by a distance g > 0 may close it within the step: q_N has g/dt more. Depths of penetration are left
alone.

What is no contact of MuJoCo's is one of the problem: a limit is a contact without friction; friction of a joint, |λ| ≤
f dt, is a tangent of a contact whose normal impulse is f dt, by a normal row that nothing else moves. Tangents that are
not there are rows that nothing moves either: their velocities and reactions are 0 in every solution.
"""

from __future__ import annotations

import importlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from cpbench.errors import ProblemError, Unavailable
from cpbench.formulations.base import Contacts
from cpbench.formulations.contact import LocalContact, without_motion
from cpbench.formulations.local_contact import AnisotropicFrictionContact, FrictionContact, RollingFrictionContact
from cpbench.foundation.matrices import Dense, Vector
from cpbench.foundation.text import counted

_Made = TypeVar("_Made", bound=LocalContact)
OF_PAIR = 4096
"""Numbers that each pair of geometries has for its contacts."""


@dataclass(frozen=True)
class _Row:
    """A contact: its rows J, those among them that nothing else moves, what q has more, and its coefficients.

    Attributes
    ----------
    J : (d, nv), 0 in `idle` rows. more : added to q where J is not 0; in an idle row over its mobility. mu : along both
    tangents. mu_r : of rolling. about : what it stands for where it is no contact of MuJoCo's.
    """

    J: Dense
    idle: tuple[int, ...] = ()
    more: float = 0.0
    mu: tuple[float, float] = (0.0, 0.0)
    mu_r: float = 0.0
    about: str = ""


def from_mujoco(model: Any, data: Any, *, contacts_alone: bool = False, name: str = "") -> LocalContact:
    """Return the contacts of MuJoCo's present state as a problem, with their ids, bodies, positions and frames.

    Call it after `mj_forward` or `mj_step1`; the rigid law is asked, not MuJoCo's soft one. v' = qvel + dt qacc_smooth.
    An id has the pair of geometries and the number of the contact among those of the pair. The problem is an `fc`, or
    an `afc` where a contact has two coefficients, or an `rfc` where one rolls (condim 6). Its property `joints` names
    the contacts that stand for limits and friction of joints and tendons, `left_out` what is not in it: torsional
    friction (condim 4 and 6), which no formulation has.

    Parameters
    ----------
    model, data : `mujoco.MjModel` and `mujoco.MjData`. contacts_alone : whether rows of equality constraints, limits
        and joint friction are left out of the problem; else a state with equality constraints is refused. name : of the
        problem.

    Raises ProblemError on these, on contacts of flexible bodies, and on two coefficients beside rolling.

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
    contacts, dt = data.contact, model.opt.timestep
    active = [k for k in range(data.ncon) if contacts.efc_address[k] >= 0]
    rolls = any(contacts.dim[k] == 6 and contacts.friction[k][3:].any() for k in active)
    elliptic = any(contacts.dim[k] > 1 and contacts.friction[k][0] != contacts.friction[k][1] for k in active)
    _require_law(contacts, active, rolls, elliptic)
    rows: list[_Row] = []
    for k in active:
        sides = []
        for geom in contacts.geom[k]:
            along, about = np.zeros((2, 3, model.nv))
            mujoco.mj_jac(model, data, along, about, contacts.pos[k], int(model.geom_bodyid[geom]))
            sides.append(np.vstack([along, about]))
        frame, (along, about) = contacts.frame[k].reshape(3, 3), np.vsplit(sides[1] - sides[0], 2)
        J = np.vstack([frame @ along, frame[1:] @ about]) if rolls else frame @ along
        first, second, _, rolling, _ = contacts.friction[k].tolist()
        mu = (first, second) if contacts.dim[k] > 1 else (0.0, 0.0)
        gap = max(float(contacts.dist[k]), 0.0) / dt
        rows.append(_Row(J, (), gap, mu, rolling if contacts.dim[k] == 6 else 0.0))
    others = [] if contacts_alone else _of_joints(model, data, 5 if rolls else 3)
    pairs = [(int(first), int(second)) for first, second in contacts.geom[active]]
    ids = _ids(pairs, model.ngeom)
    ids += [model.ngeom**2 * OF_PAIR + row for row, _ in others]
    nothing = np.zeros((len(others), 3))
    known = Contacts(
        id=np.array(ids, dtype=np.int64),
        bodies=np.vstack([model.geom_bodyid[contacts.geom[active]].reshape(-1, 2), nothing[:, :2]]).astype(np.int64),
        position=np.vstack([contacts.pos[active], nothing]),
        frame=np.concatenate([contacts.frame[active].reshape(-1, 3, 3), np.tile(np.eye(3), (len(others), 1, 1))]),
    )
    rows += [row for _, row in others]
    spins = [ids[k] for k, index in enumerate(active) if contacts.dim[index] > 3 and contacts.friction[index][2] > 0.0]
    properties = {
        "joints": "; ".join(f"contact {c}: {row.about}" for c, row in zip(ids, rows, strict=True) if row.about)
    }
    properties["left_out"] = f"torsional friction of {counted(len(spins), 'contact')}: {spins}" if spins else ""

    def moved(J: Dense) -> Dense:
        solved = np.zeros_like(J)
        if J.size:
            mujoco.mj_solveM(model, data, solved, J)
        return solved

    J = np.vstack([row.J for row in rows]) if rows else np.zeros((0, model.nv))
    W, q = _delassus(J, moved(J), data.qvel + dt * data.qacc_smooth, rows)
    shared: dict[str, Any] = {"W": W, "q": q, "contacts": known, "name": name}
    mu = np.array([row.mu for row in rows]).reshape(-1, 2)
    if elliptic:
        made: LocalContact = AnisotropicFrictionContact(mu=mu, **shared)
    elif rolls:
        made = RollingFrictionContact(mu=mu[:, 0], mu_r=np.array([row.mu_r for row in rows]), **shared)
    else:
        made = FrictionContact(mu=mu[:, 0], **shared)
    return _noted(made, properties)


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
    rows = [_Row(J[3 * k : 3 * k + 3], (), max(float(distance), 0.0) / dt) for k, distance in enumerate(gap)]
    W, made = _delassus(J, np.linalg.solve(M, J.T).T, free, rows)
    return _noted(FrictionContact(W=W, q=made, mu=np.full(len(contacts), mu), contacts=known, name=name), {})


def _package(name: str, distribution: str = "") -> Any:
    """Return a package; raises Unavailable where it is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise Unavailable("missing", f"{name} is not installed: pip install {distribution or name}") from None


def _require_law(contacts: Any, active: list[int], rolls: bool, elliptic: bool) -> None:
    """Raise ProblemError where no formulation has the laws of all contacts of a state of MuJoCo."""
    for k in active:
        if min(contacts.geom[k]) < 0:
            raise ProblemError("mujoco", f"has a flexible body at contact {k}, which has no Jacobian of a rigid one")
        if rolls and contacts.dim[k] == 6 and contacts.friction[k][3] != contacts.friction[k][4]:
            first, second = contacts.friction[k][3:]
            raise ProblemError(
                "mujoco", f"has the coefficients of rolling {first:g} and {second:g} at contact {k}, expected one"
            )
        if rolls and elliptic and contacts.dim[k] > 1 and contacts.friction[k][0] != contacts.friction[k][1]:
            first, second = contacts.friction[k][:2]
            text = f"has the coefficients {first:g} and {second:g} at contact {k} beside rolling (condim 6)"
            raise ProblemError("mujoco", f"{text}: afc has no rolling, rfc one coefficient")


def _of_joints(model: Any, data: Any, d: int) -> list[tuple[int, _Row]]:
    """Return the contacts that stand for limits and joint friction, with their rows among MuJoCo's constraints; raises
    ProblemError on equality constraints."""
    mujoco, kinds = _package("mujoco"), _package("mujoco").mjtConstraint
    count = data.nefc
    types = [int(kind) for kind in data.efc_type[:count]]
    if equal := types.count(int(kinds.mjCNSTR_EQUALITY)):
        text = f"has {counted(equal, 'row')} of equality constraints beside its contacts"
        raise ProblemError("mujoco", f"{text}: contacts_alone=True leaves them out, limits and joint friction too")
    J = np.zeros((count, model.nv))
    if mujoco.mj_isSparse(model):
        mujoco.mju_sparse2dense(J, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    elif count:
        J = np.asarray(data.efc_J).reshape(count, model.nv)
    rows: list[tuple[int, _Row]] = []
    for row, kind in enumerate(types):
        if kind >= int(kinds.mjCNSTR_CONTACT_FRICTIONLESS):
            continue
        at, limit = int(data.efc_id[row]), kind in (int(kinds.mjCNSTR_LIMIT_JOINT), int(kinds.mjCNSTR_LIMIT_TENDON))
        tendon = kind in (int(kinds.mjCNSTR_LIMIT_TENDON), int(kinds.mjCNSTR_FRICTION_TENDON))
        part = model.tendon(at) if tendon else model.joint(at if limit else int(model.dof_jntid[at]))
        about = f"{'limit' if limit else 'friction'} of {'tendon' if tendon else 'joint'} {part.name or part.id}"
        block = np.zeros((d, model.nv))
        block[0 if limit else 1] = J[row]
        idle = tuple(k for k in range(d) if k != (0 if limit else 1))
        dt, loss = model.opt.timestep, float(data.efc_frictionloss[row])
        more = max(float(data.efc_pos[row]), 0.0) / dt if limit else -loss * dt
        rows.append((row, _Row(block, idle, more, (0.0, 0.0) if limit else (1.0, 1.0), 0.0, about)))
    return rows


def _delassus(J: Dense, solved: Dense, free: Vector, rows: Sequence[_Row]) -> tuple[Dense, Vector]:
    """Return W and q; `solved` are the rows of JM⁻¹, `free` is v'. An idle row has the mobility of the others."""
    W, q = solved @ J.T, J @ free
    W, at = 0.5 * (W + W.T), 0
    for row in rows:
        size = len(row.J)
        mobility = float(W.diagonal()[at : at + size].max()) or 1.0
        for k in row.idle:
            W[at + k, at + k] = mobility
        q[at] += row.more * (mobility if 0 in row.idle else 1.0)
        at += size
    return W, q


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


def _noted(problem: _Made, properties: dict[str, str]) -> _Made:
    """Return the problem with those properties that have a text, and `fixed`, the contacts with W_NN = 0."""
    immobile = without_motion(problem)
    fixed = f"W_NN = 0 at contacts {immobile}: joints carry them" if immobile else ""
    kept = {key: text for key, text in {**properties, "fixed": fixed}.items() if text}
    return replace(problem, info=replace(problem.info, properties={**problem.info.properties, **kept}))
