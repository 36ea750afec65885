# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Gear ratios from the transmissions of a URDF."""

import re

import pytest
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robots import robot_urdf


def arm_with(transmissions: str) -> ArmModel:
    return load_arm(default_arm_urdf().replace('</robot>', f'{transmissions}</robot>'))


def transmission(inside: str) -> str:
    return f'<transmission name="t"><type>Simple</type>{inside}</transmission>'


def reduction(text: object) -> str:
    return f'<mechanicalReduction>{text}</mechanicalReduction>'


JOINT1 = '<joint name="joint1"><hardwareInterface>EffortJointInterface</hardwareInterface></joint>'


@pytest.mark.parametrize('inside', [
    f'{JOINT1}<actuator name="m">{reduction(50)}</actuator>',
    f'<actuator name="m"/><joint name="joint1">{reduction(" 50.0 ")}</joint>',
    f'{JOINT1}<actuator name="m"/>{reduction("5e1")}',

    f'<joint name="joint1">{reduction(50)}</joint><actuator name="m">{reduction(50)}</actuator>',
])
def test_a_reduction_is_found_wherever_it_stands(inside):
    assert arm_with(transmission(inside)).gear_ratios == {'joint1': 50.0}


def test_that_of_ros2_control_is_found_too():
    inside = (
        '<plugin>transmission_interface/SimpleTransmission</plugin>'
        '<actuator name="m" role="actuator1"/>'
        '<joint name="joint2"><mechanical_reduction>-80</mechanical_reduction></joint>')
    arm = arm_with(f'<ros2_control name="r" type="system">{transmission(inside)}</ros2_control>')
    assert arm.gear_ratios == {'joint2': -80.0}


@pytest.mark.parametrize('inside', [
    f'{JOINT1}<joint name="joint2"/><actuator name="m">{reduction(50)}</actuator>',  # coupled
    f'<joint name="elsewhere"/><actuator name="m">{reduction(50)}</actuator>',
    f'<joint name="tool0_joint"/><actuator name="m">{reduction(50)}</actuator>',  # a fixed joint
    f'<joint/><actuator name="m">{reduction(50)}</actuator>',
    f'<actuator name="m">{reduction(50)}</actuator>',
    f'{JOINT1}<actuator name="m"/>',
])
def test_transmissions_without_a_ratio_of_one_joint_are_ignored(inside):
    assert arm_with(transmission(inside)).gear_ratios == {}


@pytest.mark.parametrize('text', ['fifty', '', '0.0', 'nan'])
def test_an_invalid_reduction_is_rejected_by_joint_and_text(text):
    arm = arm_with(transmission(f'{JOINT1}<actuator name="m">{reduction(text)}</actuator>'))
    with pytest.raises(ModelError, match=re.escape(
            f"transmission of joint 'joint1': mechanicalReduction is {text!r}, expected")):
        _ = arm.gear_ratios


def test_two_motors_with_gears_of_their_own_are_refused():
    arm = arm_with(''.join(
        transmission(f'{JOINT1}<actuator name="m">{reduction(n)}</actuator>') for n in (60, 50)))
    with pytest.raises(ModelError, match=r"joint 'joint1' state the reductions \[50.0, 60.0\]"):
        _ = arm.gear_ratios


def test_only_joints_of_the_arm_are_asked():
    bad = transmission(f'{JOINT1}<actuator name="m">{reduction("fifty")}</actuator>')
    good = transmission(f'<joint name="joint2"/>{reduction(30)}')
    urdf = default_arm_urdf().replace('</robot>', f'{bad}{good}</robot>')
    assert load_arm(urdf, ['joint2']).gear_ratios == {'joint2': 30.0}


def test_real_robots():
    arm = load_arm(robot_urdf('xarm7'))
    assert arm.gear_ratios == dict.fromkeys(arm.joint_names, 100.0)
    tiago = load_arm(robot_urdf('tiago')).gear_ratios
    assert {'arm_1_joint', 'arm_5_joint'} <= set(tiago)
    assert not {'arm_6_joint', 'arm_7_joint'} & set(tiago)  # driven by a differential
