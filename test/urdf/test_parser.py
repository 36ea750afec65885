# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The URDF parser: the elements that it reads or ignores."""

import math

from one_joint_urdf import JOINT, joint_of, LINKS, mimics, robot
import pinocchio as pin
import pytest
from robot_dynamics.urdf.parser import Mimic, parse_urdf, resolve_mimic, UrdfJoint


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
