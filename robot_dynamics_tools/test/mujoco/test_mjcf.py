# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The exported MJCF, loaded by MuJoCo, against the arm: inverse dynamics, frames, fields."""

from typing import Any

import numpy as np
import one_joint_arm
from optional_library import library
import pinocchio as pin
import pytest
from robot_dynamics.exceptions import ModelError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.commands.export_mjcf import main
from robot_dynamics_tools.mujoco.mjcf import arm_to_mjcf
from robots import robot_urdf

TOLERANCE = 1e-9


def arm_of(name: str, gravity: tuple[float, float, float] = (1.0, -2.0, -9.0)) -> ArmModel:
    """Return an arm with rotors, viscous friction and a payload."""
    urdf = default_arm_urdf() if name == 'default' else robot_urdf(name)
    arm = load_arm(urdf, gravity=gravity)
    names, n = arm.joint_names, arm.joint_count
    random = np.random.default_rng(n)
    arm = arm.with_friction(make_friction(names, random.uniform(0.1, 5.0, n).tolist()))
    motors = make_actuators(
        names, [0.1], random.uniform(-120.0, 120.0, n).tolist(),
        rotor_inertia=random.uniform(1e-6, 1e-4, n).tolist())
    return arm.with_actuators(motors).with_payloads(
        [make_payload(arm.link_names[-1], 0.7, (0.05, 0.0, 0.1))])


class Exported:
    """MuJoCo's model of an exported arm, with its constraint solver off."""

    def __init__(self, arm: ArmModel) -> None:
        self.mj: Any = library('mujoco')
        self.model = self.mj.MjModel.from_xml_string(arm_to_mjcf(arm))
        self.data = self.mj.MjData(self.model)
        self.model.opt.disableflags |= self.mj.mjtDisableBit.mjDSBL_CONSTRAINT
        self.names = [
            name for name in arm.pinocchio_model.names[1:]
            if self.mj.mj_name2id(self.model, self.mj.mjtObj.mjOBJ_JOINT, name) >= 0]
        rows = [arm.pinocchio_model.joints[arm.pinocchio_model.getJointId(name)].idx_v
                for name in self.names]
        self.G, self.q0 = arm.coordinates.G[rows], arm.coordinates.q0[rows]
        self.index = [self.model.joint(name).dofadr[0] for name in self.names]

    def inverse_dynamics(self, q: Any, v: Any, a: Any) -> Any:
        """Return the efforts of `mj_inverse` at the actuated joints."""
        data = self.data
        data.qpos[self.index] = self.G @ q + self.q0
        data.qvel[self.index], data.qacc[self.index] = self.G @ v, self.G @ a
        self.mj.mj_inverse(self.model, data)
        return self.G.T @ data.qfrc_inverse[self.index]


def check_inverse_dynamics(arm: ArmModel, exported: Exported) -> None:
    dynamics = ArmDynamics(arm)
    for q, v, a in np.random.default_rng(1).uniform(-2.0, 2.0, (20, 3, arm.joint_count)):
        tau = dynamics.inverse_dynamics(q, v, a)
        difference = exported.inverse_dynamics(q, v, a) - tau
        assert np.abs(difference).max() <= TOLERANCE * np.abs(tau).max()


@pytest.mark.parametrize('name', ['default', 'panda', 'kinova', *(
    pytest.param(name, marks=pytest.mark.soak) for name in (
        'ur10', 'xarm7', 'talos_full_v2', 'pr2'))])
def test_mujoco_computes_the_same_efforts(name):
    """Rigid bodies with a payload, oblique gravity, rotors and viscous friction."""
    arm = arm_of(name)
    check_inverse_dynamics(arm, Exported(arm))


def test_a_reflected_inertia_is_armature():
    urdf = default_arm_urdf().replace('effort="150.0"', 'effort="0"')
    arm = load_arm(urdf).with_reflected_inertia([0.3, 0.1])
    exported = Exported(arm)
    assert exported.model.dof_armature[exported.index].tolist() == [0.3, 0.1]
    # continuous joints and those without an effort limit have no range
    assert not exported.model.joint('joint1').limited
    assert not exported.model.actuator('joint1').ctrllimited
    assert exported.model.actuator_ctrlrange[1, 1] == 60.0
    check_inverse_dynamics(arm, exported)


def test_locked_joints_become_fixed_bodies():
    urdf = robot_urdf('so100')  # a link has the name of a joint
    arm = load_arm(urdf, load_arm(urdf).joint_names[1:4:2])
    exported = Exported(arm)
    assert set(exported.names) == set(arm.joint_names)
    check_inverse_dynamics(arm, exported)


def test_sites_are_the_frames_of_the_links():
    arm = arm_of('panda')
    exported = Exported(arm)
    q = np.random.default_rng(2).uniform(-1.0, 1.0, arm.joint_count)
    zero = np.zeros(arm.joint_count)
    exported.inverse_dynamics(q, zero, zero)
    model = arm.pinocchio_model
    data = model.createData()
    pin.framesForwardKinematics(model, data, arm.coordinates.position(q))
    for link in arm.link_names:
        placement = data.oMf[model.getFrameId(link, pin.FrameType.BODY)]
        is_site = exported.mj.mj_name2id(exported.model, exported.mj.mjtObj.mjOBJ_SITE, link) >= 0
        found = exported.data.site(link) if is_site else exported.data.body(link)
        np.testing.assert_allclose(found.xpos, placement.translation, atol=1e-12)
        np.testing.assert_allclose(found.xmat.reshape(3, 3), placement.rotation, atol=1e-12)


def test_limits_friction_and_gravity_are_fields():
    arm = load_arm(robot_urdf('xarm7'), gravity=(0.1, 0.2, -9.7))
    coulomb, sigmoid = np.linspace(1.0, 2.0, 7), np.linspace(0.3, 0.1, 7)
    viscous = np.linspace(3.0, 0.2, 7)
    arm = arm.with_friction(make_friction(
        arm.joint_names, viscous.tolist(), coulomb.tolist(), sigmoid=sigmoid.tolist()))
    model = Exported(arm).model
    for i, name in enumerate(arm.joint_names):
        joint, motor = model.joint(name), model.actuator(name)
        assert joint.frictionloss == pytest.approx([coulomb[i] + sigmoid[i]], rel=1e-15)
        assert joint.damping[0] == viscous[i]
        assert joint.range.tolist() == [arm.limits.lower[i], arm.limits.upper[i]]
        assert joint.limited
        assert motor.ctrlrange.tolist() == [-arm.limits.effort[i], arm.limits.effort[i]]
        assert motor.gear[0] == 1.0
    assert model.opt.gravity.tolist() == [0.1, 0.2, -9.7]
    assert model.opt.timestep == 0.001


def test_motors_reach_the_effort_limits_through_their_gears():
    arm = arm_of('ur10')
    exported = Exported(arm)
    mj, model, data = exported.mj, exported.model, exported.data
    data.ctrl[:] = model.actuator_ctrlrange[:, 1]
    mj.mj_forward(model, data)
    signs = np.sign(arm.actuators.gear_ratio)
    assert set(signs.tolist()) == {-1.0, 1.0}
    np.testing.assert_allclose(
        data.qfrc_actuator[exported.index], signs * arm.limits.effort, rtol=1e-12)


def test_mimic_joints_are_equality_constraints():
    arm = load_arm(robot_urdf('panda'))
    model = Exported(arm).model
    found = {
        model.joint(first).name: (model.joint(second).name, *data[:3])
        for first, second, data in zip(model.eq_obj1id, model.eq_obj2id, model.eq_data)}
    assert found == {
        mimic.name: (mimic.leader, mimic.offset, mimic.multiplier, 0.0)
        for mimic in arm.mimic_joints}


@pytest.mark.parametrize(('moments', 'words'), [
    ((0.0, 0.0, 0.0), r"body 'arm' has .* expected both above 1e-15"),
    ((0.01, 0.01, 0.03), r"largest .* of body 'arm' is 0.03 kg·m², .* the others, 0.02"),
])
def test_bodies_that_mujoco_refuses_are_named(moments, words):
    arm = load_arm(one_joint_arm.arm_of(one_joint_arm.inertial(moments=moments)))
    with pytest.raises(ModelError, match=words):
        arm_to_mjcf(arm)


# ------------------------------------------------------------------------------------------ tool

def test_the_tool_writes_the_arm_of_urdf_and_parameters(tmp_path, capsys):
    urdf, parameters, output = (tmp_path / name for name in ('a.urdf', 'a.yaml', 'a.xml'))
    urdf.write_text(default_arm_urdf(), encoding='utf-8')
    parameters.write_text(
        '/**:\n  ros__parameters:\n    joints: [joint1, joint2]\n    friction:\n'
        '      coulomb: [2.0, 1.0]\n      load_coefficient: [0.1, 0.0]\n', encoding='utf-8')
    arguments = ['--urdf', str(urdf), '--parameters', str(parameters)]
    assert main([*arguments, '--output', str(output)]) == 0
    assert capsys.readouterr() == (
        '', 'export_mjcf: MuJoCo has no counterpart of the load-dependent friction\n')
    model = library('mujoco').MjModel.from_xml_path(str(output))
    assert model.dof_frictionloss.tolist() == [2.0, 1.0]
    assert main(arguments) == 0
    assert capsys.readouterr().out == output.read_text(encoding='utf-8')
    assert main(['--urdf', str(tmp_path / 'no.urdf')]) == 2
    line, = capsys.readouterr().err.splitlines()
    assert line.startswith('export_mjcf: ')
