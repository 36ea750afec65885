# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""An arm in MuJoCo behind the interface of `ArmSimulation`: against it, and its own laws."""

from typing import Any

import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics_tools.mujoco.mjcf import arm_to_mjcf

pytest.importorskip('mujoco')
from robot_dynamics_tools.mujoco.mujoco_simulation import (  # noqa: E402
    load_mjcf,
    model_of_mjcf,
    MujocoSimulation,
)

START = [0.4, 0.3]
ARM = """
<mujoco model="lever"><option timestep="0.002"/><worldbody>
  <body name="lever"><joint name="hinge" axis="0 1 0" armature="0.1" {joint}/>
    <inertial pos="0.5 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>
    <geom type="box" size="0.5 0.1 0.02" pos="0.5 0 0"/>
    <body name="jaw" pos="1 0 0"><joint name="jaw" type="slide" axis="0 0 1" range="0 0.1"/>
      <inertial pos="0 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/></body></body>{objects}
</worldbody>{rest}</mujoco>"""
SERVO = '<position name="servo" joint="hinge" kp="1000" forcerange="-30 30"/>'
TENDON = ('<tendon><fixed name="grip"><joint joint="jaw" coef="1"/></fixed></tendon>'
          '<actuator>{0}<position name="grip" tendon="grip" kp="100" kv="5"/></actuator>'
          '<keyframe><key qpos="0.2 0.05" ctrl="{1}"/></keyframe>')


def lever(joint: str = '', objects: str = '', rest: str = '', **more: Any) -> MujocoSimulation:
    return MujocoSimulation(
        model_of_mjcf(ARM.format(joint=joint, objects=objects, rest=rest)), **more)


def pair() -> tuple[ArmSimulation, MujocoSimulation]:
    arm = load_arm(default_arm_urdf())
    arm = arm.with_friction(make_friction(arm.joint_names, viscous=[0.5, 0.2]))
    ours = ArmSimulation(arm, START)
    mujoco = MujocoSimulation(model_of_mjcf(arm_to_mjcf(arm)), position=START)
    for simulation in (ours, mujoco):
        simulation.release()
    return ours, mujoco


@pytest.mark.parametrize('wrenches', [
    [], [ExternalWrench('link2', np.array([30.0, 0.0, -20.0]), np.array([0.0, 5.0, 0.0]))]])
def test_the_motion_is_that_of_our_simulation(wrenches):
    ours, mujoco = pair()
    assert mujoco.arm.joint_names == ours.arm.joint_names
    assert mujoco.arm.effort_limit == pytest.approx(ours.arm.limits.effort)
    tau = np.array([-40.0, -10.0])
    for _ in range(100):
        expected, found = (each.step(tau, 0.002, wrenches) for each in (ours, mujoco))
    assert np.abs(expected.position - START).max() > 0.03
    assert found.position == pytest.approx(expected.position, abs=5e-3)
    assert found.velocity == pytest.approx(expected.velocity, abs=0.05)


def test_actuators_of_driven_joints_are_off_and_their_limits_known():
    plain, driven = lever(), lever(rest=f'<actuator>{SERVO}</actuator>')
    assert plain.arm.joint_names == ('hinge', 'jaw')  # no actuator: all joints
    assert driven.arm.joint_names == ('hinge',)
    assert driven.arm.effort_limit.tolist() == [30.0]
    servo = lever(rest=f'<actuator>{SERVO}</actuator>', joints=['jaw'])  # not the driven joint
    ends = []
    for each in (driven, servo):
        each.release()
        each.step(np.zeros(1), 1.0)
        ends.append(float(each.data.joint('hinge').qpos[0]))
    assert ends[0] > 1.0  # falls
    assert abs(ends[1]) < 0.1  # held by its servo
    own = lever('actuatorfrcrange="-7 5"', rest=f'<actuator>{SERVO}</actuator>')
    assert own.arm.effort_limit.tolist() == [7.0]


def test_a_gripper_keeps_the_control_of_the_first_keyframe():
    for control in (0.0, 0.08):
        gripper = lever(rest=TENDON.format(SERVO, f'0 {control}'))
        assert gripper.arm.joint_names == ('hinge',)
        assert gripper.state.position.tolist() == [0.2]
        gripper.wait(2.0)
        assert float(gripper.data.joint('jaw').qpos[0]) == pytest.approx(control, abs=0.015)


BALL = ('<body name="ball" pos="0.5 0 0.2"><freejoint/>'
        '<geom type="sphere" size="0.05" mass="3"/></body>')


def test_brakes_hold_exactly_and_carry_what_falls_on_the_arm():
    arm = lever(objects=BALL, rest=f'<actuator>{SERVO}</actuator>')
    assert arm.arm.joint_names == ('hinge',)
    with pytest.raises(InvalidInputError, match=r'the brakes hold the simulated arm.*release'):
        arm.step(np.array([50.0]), 2.0)
    arm.wait(2.0)
    assert arm.state.position.tolist() == [0.0]
    assert arm.effort.tolist() == [0.0]
    assert arm.data.body('ball').xpos[2] == pytest.approx(0.07, abs=2e-3)
    arm.release()
    arm.step(np.zeros(1), 0.2)
    assert arm.state.position[0] > 0.02
    before = arm.state.position
    arm.brake()
    arm.wait(0.5)
    assert arm.state.position.tolist() == before.tolist()
    arm.reset()
    assert arm.state.position.tolist() == [0.0]
    assert arm.data.body('ball').xpos[2] == 0.2


def test_gravity_changes_and_names_are_those_given():
    arm = lever(joints=['hinge'], names=['elbow'], position=[0.1])
    for _ in range(30):  # periods that are no multiple of the time step
        arm.wait(1.0 / 300.0)
    assert arm.data.time == pytest.approx(0.1)
    assert arm.model.opt.timestep <= 0.002
    assert (arm.arm.name, arm.arm.joint_names) == ('lever', ('elbow',))
    arm.set_gravity(np.zeros(3))
    arm.release()
    arm.step(np.zeros(1), 1.0)
    assert arm.state.position == pytest.approx([0.1], abs=1e-3)
    assert arm.arm.gravity.tolist() == [0.0, 0.0, 0.0]


def test_a_diverging_motion_is_an_error_and_reset_recovers():
    arm = lever(joints=['hinge'])
    arm.release()
    with pytest.raises(RobotDynamicsError, match='diverges in MuJoCo'):
        arm.step(np.array([1e9]), 0.1)
    arm.reset()
    arm.wait(0.002)
    assert arm.state.position.tolist() == [0.0]


@pytest.mark.parametrize(('make', 'words'), [
    (lambda: lever(joints=['elbow']), "mjcf_joints[0] is 'elbow', expected the name"),
    (lambda: lever(joints=['hinge', 'hinge']), "mjcf_joints has 'hinge' twice"),
    (lambda: lever(names=['elbow']), 'joints has 1 names, expected 2, one for each of'),
    (lambda: lever(position=[0.1]), 'initial_position has 1 values, expected 2'),
    (lambda: model_of_mjcf('<mujoco><worldbody>'), 'MuJoCo rejects the MJCF'),
    (lambda: load_mjcf('no/such.xml'), "mjcf is 'no/such.xml', which is no such file"),
    (lambda: load_mjcf(__file__), 'mjcf: MuJoCo rejects '),
    (lambda: MujocoSimulation(model_of_mjcf('<mujoco/>')), 'no hinge or slide joint'),
    (lambda: lever().check_body('arm', 'frame'),
     "frame is 'arm', expected a body of the MJCF: ['world', 'lever', 'jaw']"),
])
def test_invalid_input_is_named(make, words):
    with pytest.raises(RobotDynamicsError) as caught:
        make()
    assert words in str(caught.value)
