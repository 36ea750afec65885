# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The URDF parser: the elements that it reads or ignores.

The URDF for Pinocchio contains the values that the parser checked, and no limits. Gear ratios are
those of the transmissions.
"""

import math
import re

import numpy.testing as npt
from one_joint_urdf import INERTIA, INERTIAL, JOINT, joint_of, link_of, LINKS, mimics, robot
import pinocchio as pin
import pytest
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.urdf.parser import Mimic, parse_urdf, resolve_mimic, UrdfJoint
from robots import robot_urdf


def test_a_joint_is_read():
    parsed = parse_urdf(joint_of(
        '<dynamics damping="0.5" friction="0.25"/><axis xyz="0 0 1"/>'
        '<origin xyz="1 2 3" rpy="0 0 1"/>'))
    assert (parsed.name, parsed.root_link, parsed.link_names) == ('bot', 'base', ('base', 'arm'))
    assert parsed.joints == (UrdfJoint(
        'turn', 'revolute', 'base', 'arm', -1.0, 2.0, 3.0, 4.0, 0.5, 0.25, None),)
    assert parsed.joint('turn') is parsed.joints[0]
    assert parsed.joints[0].moves


def test_what_is_left_out_has_the_defaults_of_urdf():
    joint = parse_urdf(joint_of('', limit='<limit/>')).joints[0]
    assert (joint.lower, joint.upper) == (0.0, 0.0)
    assert (joint.velocity_limit, joint.effort_limit) == (math.inf, math.inf)
    assert (joint.viscous_friction, joint.coulomb_friction) == (0.0, 0.0)
    mimic = parse_urdf(mimics('<mimic joint="turn"/>')).joint('other').mimic
    assert mimic == Mimic('turn', 1.0, 0.0)


def test_a_continuous_joint_has_no_range_and_needs_no_limit():
    open_range = joint_of('', limit='<limit lower="-inf" upper="inf" effort="4"/>')
    for xml in (joint_of('', 'continuous', ''), joint_of('', 'continuous'), open_range):
        joint = parse_urdf(xml).joints[0]
        assert (joint.lower, joint.upper) == (-math.inf, math.inf)
    assert joint.effort_limit == 4.0


def test_a_fixed_joint_mimics_nothing_and_may_have_any_axis():
    without = parse_urdf(joint_of('', 'fixed'))
    assert [joint.kind for joint in without.joints] == ['fixed']
    for inside in ('<axis xyz="0 0 0"/>', '<axis xyz="none"/>', '<mimic joint="missing"/>'):
        assert parse_urdf(joint_of(inside, 'fixed')) == without


def test_other_elements_are_passed_over():
    noise = (
        '<material name="red"/><gazebo reference="arm"><sensor name="s"/></gazebo>'
        '<transmission name="t"><joint name="turn"/><actuator name="m"/></transmission>'
        '<ros2_control name="c"><joint name="turn"><command_interface name="effort"/></joint>'
        '</ros2_control><!-- <link name="hidden"/> -->')
    parsed = parse_urdf(robot(noise + LINKS + JOINT + noise))
    assert parsed.link_names == ('base', 'arm')
    assert len(parsed.joints) == 1


@pytest.mark.parametrize('prefix', [
    '\n\n  ', '<?xml version="1.0"?>', '<?xml version="1.0" encoding="utf-8"?>\n',
    '<!-- made by hand -->'])
def test_text_before_the_robot_element_is_ignored(prefix):
    assert parse_urdf(prefix + robot(LINKS + JOINT)).link_names == ('base', 'arm')


def test_a_default_namespace_is_passed_over():
    parsed = parse_urdf(robot(
        LINKS + JOINT, 'name="bot" xmlns="http://example.org/urdf" '
        'xmlns:xacro="http://www.ros.org/wiki/xacro"'))  # declared but unused: no xacro file
    assert (parsed.name, parsed.link_names) == ('bot', ('base', 'arm'))
    assert pin.buildModelFromXML(parsed.pinocchio_xml).nv == 1


@pytest.mark.parametrize('length', [2**16 + 1, 200_000])
def test_a_text_of_any_length_is_read_as_a_whole(length):
    name = 'ü' * (length // 2) + 'x' * (length % 2)
    assert parse_urdf(joint_of('').replace('name="bot"', f'name="{name}"')).name == name


def test_relations_compose_along_the_chain():
    parsed = parse_urdf(mimics(
        '<mimic joint="turn" multiplier="2" offset="0.5"/>',
        '<mimic joint="other" multiplier="-3" offset="0.25"/>',
        '<mimic joint="third" multiplier="0.5" offset="-1"/>'))
    # q2 = 2 q + 0.5, q3 = −3 q2 + 0.25, q4 = 0.5 q3 − 1
    assert resolve_mimic(parsed.joint('other'), parsed.joints) == Mimic('turn', 2.0, 0.5)
    assert resolve_mimic(parsed.joint('third'), parsed.joints) == Mimic('turn', -6.0, -1.25)
    assert resolve_mimic(parsed.joint('fourth'), parsed.joints) == Mimic('turn', -3.0, -1.625)


def pinocchio_inertia(xml):
    return pin.buildModelFromXML(parse_urdf(xml).pinocchio_xml).inertias[1]


@pytest.mark.parametrize(('plain', 'unusual'), [
    ('value="1.5"', 'value="\t+15e-1 "'), ('ixx="1"', 'ixx="1\n"'),
    ('xyz="0.1 0.2 0.3"', 'xyz="  0.1\t0.2\n.3 "'), ('rpy="0 0 1"', 'rpy="0\n0\n1"'),
])
def test_numbers_with_unusual_space_reach_pinocchio(plain, unusual):
    # The parser of Pinocchio would silently ignore the whole inertia of the link.
    xml = link_of(
        '<inertial><origin xyz="0.1 0.2 0.3" rpy="0 0 1"/><mass value="1.5"/>'
        f'{INERTIA}</inertial>')
    assert plain in xml
    ours, expected = pinocchio_inertia(xml.replace(plain, unusual)), pinocchio_inertia(xml)
    assert ours.mass == expected.mass == 1.5
    npt.assert_array_equal(ours.lever, expected.lever)
    npt.assert_array_equal(ours.inertia, expected.inertia)


def test_pinocchio_sees_no_limits_no_mimics_and_one_coordinate_per_joint():
    second = '<inertial><mass value="heavy"/></inertial>'  # only the first one was checked
    assert pinocchio_inertia(link_of(INERTIAL + second)).mass == 1.5
    parsed = parse_urdf(mimics('<mimic joint="turn" multiplier="2"/>', kind='continuous'))
    model = pin.buildModelFromXML(parsed.pinocchio_xml)
    assert (model.nq, model.nv) == (2, 2)
    assert 'mimic' not in parsed.pinocchio_xml
    assert (model.upperPositionLimit > 1e29).all()
    assert (model.lowerPositionLimit < -1e29).all()


@pytest.mark.parametrize('name', [
    'ur5', 'panda', 'talos_left_arm', 'tiago_no_hand', 'talos_full_v2', 'pr2'])
def test_pinocchio_reads_the_same_bodies_from_real_robots(name):
    urdf = robot_urdf(name)
    ours = pin.buildModelFromXML(parse_urdf(urdf).pinocchio_xml)
    plain = pin.buildModelFromXML(urdf)
    assert list(ours.names) == list(plain.names)
    for joint, other in zip(ours.inertias, plain.inertias):
        npt.assert_allclose(joint.toDynamicParameters(), other.toDynamicParameters(), rtol=0)
    for placement, other in zip(ours.jointPlacements, plain.jointPlacements):
        npt.assert_array_equal(placement.homogeneous, other.homogeneous)


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


@pytest.mark.parametrize(('texts', 'words'), [
    *(([text], f"transmission of joint 'joint1': mechanicalReduction is {text!r}, expected")
      for text in ('fifty', '', '0.0', 'nan')),
    ([60, 50], "joint 'joint1' state the reductions [50.0, 60.0]")])  # two motors with own gears
def test_invalid_reductions_are_rejected_by_joint_and_text(texts, words):
    arm = arm_with(''.join(transmission(
        f'{JOINT1}<actuator name="m">{reduction(text)}</actuator>') for text in texts))
    with pytest.raises(ModelError, match=re.escape(words)):
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
