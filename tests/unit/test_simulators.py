"""Contacts of MuJoCo and Pinocchio as problems: matrices by hand, and what weight and friction have to be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cpbench
from cpbench.errors import ProblemError

DT, MASS, MU, GRAVITY = 0.01, 2.0, 0.6, 9.81


def mujoco_state(body: str = "", more: str = "", friction: str = "0.6", speed: float = 0.0, condim: int = 3) -> Any:
    """A box of side 0.2 on a plane, sunk by a millimetre; returns model and data."""
    mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install mujoco")
    kind = f'friction="{friction}" condim="{condim}"'
    text = f"""<mujoco><option timestep="{DT}" gravity="0 0 -{GRAVITY}"/><worldbody>
      <geom type="plane" size="5 5 0.1" {kind}/>
      <body pos="0 0 0.099"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="{MASS}" {kind}/></body>{body}
    </worldbody>{more}</mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[0] = speed
    mujoco.mj_forward(model, data)
    return model, data


def by_hand(problem: Any, centre: Any, inertia: float, free: Any) -> tuple[Any, Any]:
    """W and q of one body of this mass and central inertia, from the frames and positions of its contacts."""
    rows = []
    for frame, position in zip(problem.contacts.frame, problem.contacts.position, strict=True):
        rows += [np.concatenate([axis, np.cross(position - centre, axis)]) for axis in frame]
    J = np.array(rows)
    return J @ np.diag(1.0 / np.array([MASS] * 3 + [inertia] * 3)) @ J.T, J @ free


def test_a_box_in_mujoco() -> None:
    """The inertia of a cube of side a is ma²/6; v' has the speed and gravity's DT·g."""
    problem = cpbench.from_mujoco(*mujoco_state(speed=1.0))
    W, q = by_hand(problem, [0.0, 0.0, 0.099], MASS * 0.04 / 6, [1.0, 0.0, -GRAVITY * DT, 0.0, 0.0, 0.0])
    assert problem.nc == 4
    assert pytest.approx(W, abs=1e-12) == problem.W
    assert problem.q == pytest.approx(q, abs=1e-12)
    assert problem.mu.tolist() == [MU] * 4
    assert len(set(problem.contacts.id.tolist())) == 4
    assert problem.contacts.bodies.tolist() == [[0, 1]] * 4


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(("speed", "sliding"), [(0.01, False), (1.0, True)])
def test_the_plane_carries_the_weight_and_brakes_by_friction(speed: float, sliding: bool) -> None:
    """Normal impulses m g dt; braking μ m g dt while it slides, else m·speed."""
    problem = cpbench.from_mujoco(*mujoco_state(speed=speed))
    r = cpbench.solve(problem, tolerance=1e-10).point.r.reshape(-1, 3)
    total = sum(frame.T @ force for frame, force in zip(problem.contacts.frame, r, strict=True))
    weight = MASS * GRAVITY * DT
    brake = MU * weight if sliding else MASS * speed
    assert total == pytest.approx([-brake, 0.0, weight], rel=1e-6, abs=1e-7)


def test_a_sequence_in_two_calls_keeps_its_ids(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="needs MuJoCo: pip install mujoco")
    model, data = mujoco_state()
    recorder = cpbench.Recorder("rest", dt=DT)
    for _ in range(3):
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        recorder.add(cpbench.from_mujoco(model, data))
    recorder.save(tmp_path / "rest.h5")
    first, last = (cpbench.load(f"{tmp_path}/rest.h5::step-00{k}") for k in (0, 2))
    assert first.contacts.id.tolist() == last.contacts.id.tolist()
    assert last.sequence.step == 2


def test_laws_are_those_of_the_state_or_left_out_by_name() -> None:
    spun = cpbench.from_mujoco(*mujoco_state(condim=4))
    assert (spun.node, spun.info.properties["left_out"]) == (
        "fc",
        "torsional friction of 4 contacts: [4096, 4097, 4098, 4099]",
    )
    rolling = cpbench.from_mujoco(*mujoco_state(condim=6, friction="0.6 0.005 0.001"))
    assert (rolling.node, rolling.mu_r.tolist()) == ("rfc", [0.001] * 4)
    assert cpbench.from_mujoco(*mujoco_state(condim=1)).mu.tolist() == [0.0] * 4
    model, data = mujoco_state()
    data.contact.friction[0] = [0.6, 0.0, 0.0, 0.0, 0.0]
    assert cpbench.from_mujoco(model, data).mu.tolist() == [[0.6, 0.0], *[[0.6, 0.6]] * 3]
    model, data = mujoco_state(condim=6)
    data.contact.friction[0] = [0.6, 0.3, 0.0, 0.1, 0.1]
    with pytest.raises(ProblemError, match=r"coefficients 0\.6 and 0\.3 at contact 0 beside rolling"):
        cpbench.from_mujoco(model, data)


ARM = """<body pos="1 0 1"><joint name="elbow" type="hinge" axis="0 1 0" {}/>
  <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.01" mass="0.3" contype="0" conaffinity="0"/></body>"""


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("loss", [0.6, 0.1])
@pytest.mark.parametrize("condim", [3, 6])
def test_friction_of_a_joint_holds_an_arm_or_brakes_it(loss: float, condim: int) -> None:
    """The weight's moment is m g L/2 = 0.2943 N m."""
    model, data = mujoco_state(body=ARM.format(f'frictionloss="{loss}"'), condim=condim)
    problem = cpbench.from_mujoco(model, data)
    assert problem.info.properties["joints"] == f"contact {problem.contacts.id[4]}: friction of joint elbow"
    r = cpbench.solve(problem, tolerance=1e-10).point.r.reshape(5, -1)[4]
    assert r[0] == pytest.approx(loss * DT)
    assert abs(r[1]) == pytest.approx(min(0.3 * GRAVITY * 0.1, loss) * DT, rel=1e-6)
    assert r[2:] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.needs("cpbench_solvers")
def test_a_limit_carries_what_falls_on_it() -> None:
    problem = cpbench.from_mujoco(*mujoco_state(body=ARM.format('limited="true" range="-60 0" margin="0.01"')))
    assert problem.info.properties["joints"] == f"contact {problem.contacts.id[4]}: limit of joint elbow"
    assert problem.mu.tolist() == [MU] * 4 + [0.0]
    assert cpbench.solve(problem, tolerance=1e-10).point.r[12:] == pytest.approx(
        [0.3 * GRAVITY * 0.1 * DT, 0, 0], rel=1e-5
    )


def test_equality_constraints_are_refused() -> None:
    tied = mujoco_state(body=ARM.format(""), more='<equality><joint joint1="elbow"/></equality>')
    with pytest.raises(ProblemError, match=r"has 1 row of equality constraints .* contacts_alone=True"):
        cpbench.from_mujoco(*tied)
    assert cpbench.from_mujoco(*tied, contacts_alone=True).nc == 4


def pinocchio_state(height: float) -> Any:
    """A ball of radius 0.1 over a floor; returns model, data, geometry model and its data, q."""
    pin = pytest.importorskip("pinocchio", reason="needs Pinocchio: pip install pin")
    coal = pytest.importorskip("coal", reason="needs Pinocchio: pip install pin")
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(MASS, 0.1), pin.SE3.Identity())
    geometry = pin.GeometryModel()
    floor = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5]))
    geometry.addGeometryObject(pin.GeometryObject("floor", 0, floor, coal.Box(10, 10, 1)))
    geometry.addGeometryObject(pin.GeometryObject("ball", joint, pin.SE3.Identity(), coal.Sphere(0.1)))
    geometry.addCollisionPair(pin.CollisionPair(0, 1))
    data, found = model.createData(), geometry.createData()
    for request in found.collisionRequests:
        request.enable_contact = True
    q = pin.neutral(model)
    q[2] = height
    pin.updateGeometryPlacements(model, data, geometry, found, q)
    pin.computeCollisions(geometry, found, False)
    return model, data, geometry, found, q


@pytest.mark.needs("cpbench_solvers")
def test_a_ball_in_pinocchio() -> None:
    """The inertia of a ball is 2mr²/5; velocities of a free flyer are those of its own axes, here the world's."""
    model, data, geometry, found, q = pinocchio_state(0.0999)
    v = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    problem = cpbench.from_pinocchio(model, data, geometry, found, q, v, mu=MU, dt=DT)
    assert problem.nc == 1
    assert problem.contacts.frame[0, 0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    free = [1.0, 0.0, -GRAVITY * DT, 0.0, 0.0, 0.0]
    W, expected = by_hand(problem, [0.0, 0.0, 0.0999], 0.4 * MASS * 0.01, free)
    assert pytest.approx(W, abs=1e-9) == problem.W
    assert problem.q == pytest.approx(expected, abs=1e-9)
    r = cpbench.solve(problem, tolerance=1e-10).point.r
    force = problem.contacts.frame[0].T @ r
    assert force == pytest.approx([-MU * MASS * GRAVITY * DT, 0.0, MASS * GRAVITY * DT], rel=1e-5, abs=1e-6)


def test_sizes_of_pinocchio_are_checked() -> None:
    model, data, geometry, found, q = pinocchio_state(0.0999)
    with pytest.raises(ProblemError, match=r"pinocchio\.v: has shape \(5,\), expected \(6,\)"):
        cpbench.from_pinocchio(model, data, geometry, found, q, np.zeros(5), mu=MU, dt=DT)


@pytest.mark.needs("cpbench_solvers")
def test_a_wheel_that_rolls_freely_one_way_is_held_the_other() -> None:
    """A block on a plane of 20°, free along x and held along y, slides along x; friction along x is no answer."""
    fall = GRAVITY * DT * np.sin(np.deg2rad(20)) * np.array([np.cos(0.5), np.sin(0.5)])
    q = np.array([-GRAVITY * DT * np.cos(np.deg2rad(20)), *fall])
    problem = cpbench.formulations.AnisotropicFrictionContact(W=np.eye(3) / MASS, q=q, mu=np.array([[0.0, 0.8]]))
    r = cpbench.solve(problem, tolerance=1e-10).point.r
    assert r == pytest.approx([-MASS * q[0], 0.0, -MASS * fall[1]])
    assert r[1] == 0.0
    assert cpbench.verify(problem, r - np.array([0.0, 1e-9, 0.0])).error > 1e-3
