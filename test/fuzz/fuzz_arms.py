# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The arms of the fuzz tests: one with everything that a URDF can have, and one with many joints.

`EVERYTHING` has joints of all kinds, one mimic joint, one locked joint, friction with the Stribeck
effect, and motors. `CROWD` has as many joints and links as a humanoid, with names of the same
length: messages that list the names must stay readable.
"""

from robot_dynamics.joints import make_actuators, make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf

PLANAR_URDF = default_arm_urdf()
EVERYTHING_JOINTS = ('elbow', 'shoulder', 'slide')
MIMIC_JOINT, MIMIC_LEADER, MIMIC_MULTIPLIER, MIMIC_OFFSET = 'finger', 'slide', -0.5, 0.1
LOCKED_JOINT = 'wrist'
_CROWD_SIZE = 60


def _link(name: str, mass: float = 1.0) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="0.01 0 0.2" rpy="0.1 0 0"/>'
        f'<mass value="{mass}"/>'
        '<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial>'
        '<collision><origin xyz="0 0 0.2"/><geometry><box size="0.2 0.2 0.6"/></geometry>'
        '</collision></link>')


def _joint(name: str, kind: str, parent: str, child: str, more: str = '') -> str:
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="0 0 0.4" rpy="0 0.2 0"/>'
        f'<parent link="{parent}"/><child link="{child}"/><axis xyz="0 1 0"/>'
        f'<limit lower="-2" upper="2" effort="80" velocity="5"/>{more}</joint>')


def _everything() -> str:
    transmissions = ''.join(
        f'<transmission name="{name}_gear"><joint name="{name}"/><actuator name="{name}_motor">'
        '<mechanicalReduction>100</mechanicalReduction></actuator></transmission>'
        for name in EVERYTHING_JOINTS)
    return (
        '<?xml version="1.0"?>\n<robot name="everything">'
        + _link('base') + _link('upper', 5.0) + _link('lower', 3.0) + _link('carriage')
        + _link('fingertip', 0.1) + _link('hand', 0.5) + '<link name="tool"/>'
        + _joint('shoulder', 'continuous', 'base', 'upper',
                 '<dynamics damping="0.5" friction="1.0"/>')
        + _joint('elbow', 'revolute', 'upper', 'lower', '<dynamics damping="0.2"/>')
        + _joint('slide', 'prismatic', 'lower', 'carriage')
        + _joint(MIMIC_JOINT, 'prismatic', 'carriage', 'fingertip',
                 f'<mimic joint="{MIMIC_LEADER}" multiplier="{MIMIC_MULTIPLIER}" '
                 f'offset="{MIMIC_OFFSET}"/>')
        + _joint(LOCKED_JOINT, 'revolute', 'carriage', 'hand')
        + _joint('flange', 'fixed', 'hand', 'tool')
        + transmissions + '</robot>')


def _crowd() -> str:
    links = ''.join(
        f'<link name="left_hand_of_the_second_torso_segment_{i:02}"/>'
        for i in range(_CROWD_SIZE + 1))
    return '<robot name="crowd">' + links + ''.join(
        _joint(f'joint_of_the_left_hand_finger_segment_{i:02}', 'revolute',
               f'left_hand_of_the_second_torso_segment_{i:02}',
               f'left_hand_of_the_second_torso_segment_{i + 1:02}')
        for i in range(_CROWD_SIZE)) + '</robot>'


def _with_motors(arm: ArmModel) -> ArmModel:
    names = arm.joint_names
    friction = make_friction(names, [0.5], [1.0], [2.0], [0.1], [0.3])
    return arm.with_friction(friction).with_actuators(make_actuators(
        names, [0.1], [100.0], resistance=[0.5], inductance=[1e-3], rotor_inertia=[1e-4],
        efficiency=[0.8], current_limit=[20.0], voltage_limit=[48.0], backlash=[0.002, 0.0, 0.001],
        restitution=[0.3]))


EVERYTHING_URDF = _everything()
PLANAR = load_arm(PLANAR_URDF)
EVERYTHING = _with_motors(load_arm(EVERYTHING_URDF, EVERYTHING_JOINTS))
CROWD = load_arm(_crowd())
ARMS = (PLANAR, EVERYTHING)
"""The arms that whole requests are made for."""
ARM = {arm.name: arm for arm in (*ARMS, CROWD)}
