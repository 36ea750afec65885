# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The URDF parser: the elements that it reads or ignores, and its error messages."""

import math
import re
from xml.etree import ElementTree

import numpy.testing as npt
import pinocchio as pin
import pytest
from robot_dynamics.exceptions import ModelError, RobotDynamicsError
from robot_dynamics.urdf.parser import (
    Mimic,
    MOST_LINKS,
    MOST_TAGS,
    parse_urdf,
    resolve_mimic,
    UrdfJoint,
)
from robots import robot_path, robot_urdf, ROBOTS

INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
INERTIAL = f'<inertial><mass value="1.5"/>{INERTIA}</inertial>'
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="4"/>'
ENDS = '<parent link="base"/><child link="arm"/>'
JOINT = f'<joint name="turn" type="revolute">{ENDS}{LIMIT}</joint>'
LINKS = f'<link name="base"/><link name="arm">{INERTIAL}</link>'


def robot(body, attributes='name="bot"'):
    return f'<robot {attributes}>{body}</robot>'


def joint_of(inside, kind='revolute', limit=LIMIT):
    """Return a robot with one joint that contains these elements."""
    return robot(f'{LINKS}<joint name="turn" type="{kind}">{ENDS}{limit}{inside}</joint>')


def link_of(inside):
    return robot(f'<link name="base"/><link name="arm">{inside}</link>{JOINT}')


def refusal(xml):
    with pytest.raises(ModelError) as caught:
        parse_urdf(xml)
    assert isinstance(caught.value, RobotDynamicsError)
    assert isinstance(caught.value, ValueError)
    return str(caught.value)


# --- elements that are read ----------------------------------------------------------------------

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
    for limit in ('', LIMIT):
        joint = parse_urdf(joint_of('', 'continuous', limit)).joints[0]
        assert (joint.lower, joint.upper) == (-math.inf, math.inf)
    assert joint.effort_limit == 4.0


def test_an_effort_or_velocity_limit_of_zero_is_not_known():
    zero = parse_urdf(joint_of('', limit='<limit velocity="0" effort="0.0"/>')).joints[0]
    assert (zero.velocity_limit, zero.effort_limit) == (math.inf, math.inf)


@pytest.mark.parametrize('kind', ['revolute', 'continuous', 'prismatic'])
@pytest.mark.parametrize('attribute', ['velocity', 'effort'])
def test_a_negative_effort_or_velocity_limit_is_refused(kind, attribute):
    for value, shown in (('-3', '-3'), ('-inf', '-inf'), ('-1e-300', '-1e-300')):
        assert refusal(joint_of('', kind, f'<limit {attribute}="{value}"/>')) == (
            f"robot_description: joint 'turn': {attribute}={shown}, expected >= 0 (0: unknown)")


def test_a_range_may_be_open():
    joint = parse_urdf(joint_of('', limit='<limit lower="-inf" upper="inf"/>')).joints[0]
    assert (joint.lower, joint.upper) == (-math.inf, math.inf)


def test_joints_are_in_the_order_of_the_document():
    body = LINKS + '<link name="tip"/>' + (
        f'<joint name="zz" type="fixed"><parent link="arm"/><child link="tip"/></joint>{JOINT}')
    parsed = parse_urdf(robot(body))
    assert [joint.name for joint in parsed.joints] == ['zz', 'turn']
    assert [joint.moves for joint in parsed.joints] == [False, True]


def test_a_fixed_joint_mimics_nothing():
    assert parse_urdf(joint_of('<mimic joint="missing"/>', 'fixed')).joints[0].mimic is None


def test_a_fixed_joint_may_have_any_axis():
    without = parse_urdf(joint_of('', 'fixed'))
    assert [joint.kind for joint in without.joints] == ['fixed']
    for xyz in ('0 0 0', 'none'):
        assert parse_urdf(joint_of(f'<axis xyz="{xyz}"/>', 'fixed')) == without


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
    parsed = parse_urdf(robot(LINKS + JOINT, 'name="bot" xmlns="http://example.org/urdf"'))
    assert (parsed.name, parsed.link_names) == ('bot', ('base', 'arm'))
    assert pin.buildModelFromXML(parsed.pinocchio_xml).nv == 1


def test_a_robot_may_be_without_a_name():
    assert parse_urdf(robot(LINKS + JOINT, '')).name == ''


# --- the URDF for Pinocchio ----------------------------------------------------------------------

def pinocchio_inertia(xml):
    return pin.buildModelFromXML(parse_urdf(xml).pinocchio_xml).inertias[1]


@pytest.mark.parametrize(('plain', 'unusual'), [
    ('value="1.5"', 'value="1.5 "'), ('value="1.5"', 'value="\t+15e-1"'),
    ('ixx="1"', 'ixx="1\n"'), ('xyz="0.1 0.2 0.3"', 'xyz="0.1\t0.2\n0.3"'),
    ('xyz="0.1 0.2 0.3"', 'xyz="  0.1  0.2 .3 "'), ('rpy="0 0 1"', 'rpy="0\n0\n1"'),
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


def test_pinocchio_reads_the_element_that_was_checked():
    second = '<inertial><mass value="heavy"/></inertial>'
    inertia = pinocchio_inertia(link_of(INERTIAL + second))
    assert inertia.mass == 1.5


def test_pinocchio_sees_no_limits_no_mimics_and_one_coordinate_a_joint():
    parsed = parse_urdf(mimics('<mimic joint="turn" multiplier="2"/>', kind='continuous'))
    model = pin.buildModelFromXML(parsed.pinocchio_xml)
    assert (model.nq, model.nv) == (2, 2)
    assert 'mimic' not in parsed.pinocchio_xml
    assert (model.upperPositionLimit > 1e29).all()
    assert (model.lowerPositionLimit < -1e29).all()


@pytest.mark.parametrize('name', ROBOTS)
def test_pinocchio_reads_the_same_bodies_from_real_robots(name):
    urdf = robot_urdf(name)
    ours = pin.buildModelFromXML(parse_urdf(urdf).pinocchio_xml)
    plain = pin.buildModelFromXML(urdf)
    assert list(ours.names) == list(plain.names)
    for joint, other in zip(ours.inertias, plain.inertias):
        npt.assert_allclose(joint.toDynamicParameters(), other.toDynamicParameters(), rtol=0)
    for placement, other in zip(ours.jointPlacements, plain.jointPlacements):
        npt.assert_array_equal(placement.homogeneous, other.homogeneous)


# --- mimic chains --------------------------------------------------------------------------------

def mimics(*relations, kind='revolute'):
    """Return a robot with the joint `turn` and other joints, each with its mimic relation."""
    names = ('other', 'third', 'fourth')
    body, parent = LINKS + JOINT, 'arm'
    for name, relation in zip(names, relations):
        body += (
            f'<link name="{name}_link"/><joint name="{name}" type="{kind}">'
            f'<parent link="{parent}"/><child link="{name}_link"/>{LIMIT}{relation}</joint>')
        parent = f'{name}_link'
    return robot(body)


def test_relations_compose_along_the_chain():
    parsed = parse_urdf(mimics(
        '<mimic joint="turn" multiplier="2" offset="0.5"/>',
        '<mimic joint="other" multiplier="-3" offset="0.25"/>',
        '<mimic joint="third" multiplier="0.5" offset="-1"/>'))
    # q2 = 2 q + 0.5, q3 = −3 q2 + 0.25, q4 = 0.5 q3 − 1
    assert resolve_mimic(parsed.joint('other'), parsed.joints) == Mimic('turn', 2.0, 0.5)
    assert resolve_mimic(parsed.joint('third'), parsed.joints) == Mimic('turn', -6.0, -1.25)
    assert resolve_mimic(parsed.joint('fourth'), parsed.joints) == Mimic('turn', -3.0, -1.625)


# --- rejections ----------------------------------------------------------------------------------

SECOND_JOINT = JOINT.replace('turn', 'back')
TIP = '<link name="tip"/>'


def joining(name, parent, child):
    return (f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
            '</joint>')


REFUSALS = {
    'nothing': ('', 'robot_description is empty, expected the XML of a URDF'),
    'blanks': (' \n ', 'robot_description is empty, expected the XML of a URDF'),
    'wrong root': (
        '<sdf version="1.6"/>', 'robot_description has the root element <sdf>, expected <robot>'),
    'no links': (
        robot(''), "robot_description: robot 'bot' has no links, expected at least two"),
    'link without a name': (robot('<link/>'), 'robot_description: a <link> has no name'),
    'joint without a name': (
        robot(LINKS + JOINT.replace('name="turn" ', '')),
        'robot_description: a <joint> has no name'),
    'two links of a name': (
        robot(LINKS + JOINT + '<link name="arm"/>'),
        "robot_description: two links are named 'arm'"),
    'two joints of a name': (
        robot(LINKS + JOINT + JOINT), "robot_description: two joints are named 'turn'"),
    'floating': (
        joint_of('', 'floating'),
        "robot_description: joint 'turn' is of type 'floating': an arm needs a fixed base, "
        "expected one of ['revolute', 'continuous', 'prismatic', 'fixed']"),
    'planar': (
        joint_of('', 'planar'),
        "robot_description: joint 'turn' is of type 'planar', "
        "expected one of ['revolute', 'continuous', 'prismatic', 'fixed']"),
    'no type': (
        robot(LINKS + JOINT.replace(' type="revolute"', '')),
        "robot_description: joint 'turn' is of type '', "
        "expected one of ['revolute', 'continuous', 'prismatic', 'fixed']"),
    'unknown parent': (
        robot(LINKS + JOINT.replace('"base"', '"floor"')),
        "robot_description: joint 'turn': parent link is 'floor', expected one of "
        "['base', 'arm']"),
    'unknown child': (
        robot(LINKS + JOINT.replace('"arm"', '"leg"')),
        "robot_description: joint 'turn': child link is 'leg', expected one of ['base', 'arm']"),
    'no child': (
        robot(LINKS + JOINT.replace('<child link="arm"/>', '')),
        "robot_description: joint 'turn': child link is None, expected one of ['base', 'arm']"),
    'two parents': (
        robot(LINKS + JOINT + SECOND_JOINT),
        "robot_description: link 'arm' is the child of two joints, 'turn' and 'back': "
        'a closed loop, expected a tree'),
    'two roots': (
        robot(LINKS + JOINT + TIP),
        "robot_description: links ['base', 'tip'] all have no parent, expected one root"),
    'loop without a root': (
        robot(LINKS + JOINT + joining('back', 'arm', 'base')),
        "robot_description: links ['base', 'arm'] form a closed loop that hangs on no root, "
        'expected a tree'),
    'loop next to the tree': (
        robot(LINKS + JOINT + TIP + '<link name="top"/>' + joining('up', 'tip', 'top')
              + joining('down', 'top', 'tip')),
        "robot_description: links ['tip', 'top'] form a closed loop that hangs on no root, "
        'expected a tree'),
    'link on itself': (
        robot(LINKS + JOINT + TIP + joining('self', 'tip', 'tip')),
        "robot_description: links ['tip'] form a closed loop that hangs on no root, "
        'expected a tree'),
    'revolute without limit': (
        joint_of('', limit=''),
        "robot_description: joint 'turn' is revolute and has no <limit>, which URDF requires"),
    'prismatic without limit': (
        joint_of('', 'prismatic', limit=''),
        "robot_description: joint 'turn' is prismatic and has no <limit>, which URDF requires"),
    'crossed limits': (
        joint_of('', limit='<limit lower="1.5" upper="-1"/>'),
        "robot_description: joint 'turn': lower=1.5 is above upper=-1"),
    'no finite position': (
        joint_of('', limit='<limit lower="inf" upper="inf"/>'),
        "robot_description: joint 'turn': lower=inf, upper=inf, expected a range that holds a "
        'position in [-1e+09, 1e+09]'),
    'limit as text': (
        joint_of('', limit='<limit lower="-pi" upper="2"/>'),
        "robot_description: joint 'turn': lower='-pi', expected a number"),
    'limit nan': (
        joint_of('', limit='<limit lower="0" upper="nan"/>'),
        "robot_description: joint 'turn': upper='nan', expected a number"),
    'velocity nan': (
        joint_of('', limit='<limit velocity="NaN"/>'),
        "robot_description: joint 'turn': velocity='NaN', expected a number"),
    'effort as text': (
        joint_of('', limit='<limit effort="a lot"/>'),
        "robot_description: joint 'turn': effort='a lot', expected a number"),
    'negative damping': (
        joint_of('<dynamics damping="-0.1"/>'),
        "robot_description: joint 'turn': damping=-0.1, expected a number >= 0"),
    'negative friction': (
        joint_of('<dynamics friction="-1"/>'),
        "robot_description: joint 'turn': friction=-1, expected a number >= 0"),
    'infinite damping': (
        joint_of('<dynamics damping="inf"/>'),
        "robot_description: joint 'turn': damping=inf, expected a number >= 0"),
    'damping as text': (
        joint_of('<dynamics damping="high"/>'),
        "robot_description: joint 'turn': damping='high', expected a number"),
    'zero axis': (
        joint_of('<axis xyz="0 0 0"/>'),
        "robot_description: joint 'turn': axis is zero, expected a direction"),
    'short axis': (
        joint_of('<axis xyz="0 1"/>'),
        "robot_description: joint 'turn': xyz='0 1', expected three numbers"),
    'joint origin': (
        joint_of('<origin xyz="0 nan 1"/>'),
        "robot_description: joint 'turn': origin: xyz='0 nan 1', expected three numbers"),
    'joint angles': (
        joint_of('<origin rpy="0,0,1"/>'),
        "robot_description: joint 'turn': origin: rpy='0,0,1', expected three numbers"),
    'mass nan': (
        link_of(f'<inertial><mass value="nan"/>{INERTIA}</inertial>'),
        "robot_description: link 'arm': inertial: value='nan', expected a number"),
    'mass as text': (
        link_of(f'<inertial><mass value="1 kg"/>{INERTIA}</inertial>'),
        "robot_description: link 'arm': inertial: value='1 kg', expected a number"),
    'mass missing': (
        link_of(f'<inertial>{INERTIA}</inertial>'),
        "robot_description: link 'arm': inertial: mass is nan, expected a number >= 0"),
    'mass negative': (
        link_of(f'<inertial><mass value="-2"/>{INERTIA}</inertial>'),
        "robot_description: link 'arm': inertial: mass is -2, expected a number >= 0"),
    'mass infinite': (
        link_of(f'<inertial><mass value="inf"/>{INERTIA}</inertial>'),
        "robot_description: link 'arm': inertial: mass is inf, expected a number >= 0"),
    'inertia missing': (
        link_of('<inertial><mass value="2"/></inertial>'),
        "robot_description: link 'arm': inertial: ixx is nan, expected a number"),
    'one entry missing': (
        link_of(INERTIAL.replace(' iyz="0"', '')),
        "robot_description: link 'arm': inertial: iyz is nan, expected a number"),
    'infinite entry': (
        link_of(INERTIAL.replace('izz="1"', 'izz="inf"')),
        "robot_description: link 'arm': inertial: izz is inf, expected a number"),
    'entry as text': (
        link_of(INERTIAL.replace('ixy="0"', 'ixy="${ixy}"')),
        "robot_description: link 'arm': inertial: ixy='${ixy}', expected a number"),
    'com': (
        link_of(f'<inertial><origin xyz="0 0"/><mass value="1"/>{INERTIA}</inertial>'),
        "robot_description: link 'arm': inertial: origin: xyz='0 0', expected three numbers"),
    'mimic of a missing joint': (
        mimics('<mimic joint="ghost"/>'),
        "robot_description: joint 'other' mimics 'ghost', expected one of ['turn', 'other']"),
    'mimic without a joint': (
        mimics('<mimic multiplier="2"/>'),
        "robot_description: joint 'other' mimics '', expected one of ['turn', 'other']"),
    'mimic of a fixed joint': (
        robot(LINKS + TIP + joining('weld', 'arm', 'tip')
              + JOINT.replace(LIMIT, f'{LIMIT}<mimic joint="weld"/>')),
        "robot_description: joint 'turn' mimics 'weld', expected one of ['turn']"),
    'mimic of itself': (
        mimics('<mimic joint="other"/>'),
        "robot_description: joint 'other' mimics itself, through 'other'"),
    'mimic in a circle': (
        mimics('<mimic joint="third"/>', '<mimic joint="other"/>'),
        "robot_description: joint 'other' mimics itself, through 'other'"),
    'mimic factor': (
        mimics('<mimic joint="turn" multiplier="double"/>'),
        "robot_description: joint 'other': multiplier='double', expected a number"),
    'mimic factor infinite': (
        mimics('<mimic joint="turn" multiplier="inf"/>'),
        "robot_description: joint 'other': multiplier=inf, expected a finite number"),
    'mimic offset infinite': (
        mimics('<mimic joint="turn" offset="-inf"/>'),
        "robot_description: joint 'other': offset=-inf, expected a finite number"),
    'xacro': (
        robot('<xacro:include filename="arm.xacro"/>', 'xmlns:xacro="http://www.ros.org/xacro"'),
        'robot_description is a xacro file, it has <xacro:include>, '
        'expected the URDF that the program xacro makes of it'),
    'xacro macro': (
        robot(f'{LINKS}{JOINT}<xacro:macro name="leg" params="side"/>',
              'name="bot" xmlns:xacro="http://wiki.ros.org/xacro"'),
        "robot_description is a xacro file, it has <xacro:macro name='leg'>, "
        'expected the URDF that the program xacro makes of it'),
    'xacro without a robot': (
        robot('', 'xmlns:xacro="http://wiki.ros.org/xacro"'),
        "robot_description: robot '' has no links, expected at least two: its text declares "
        'xmlns:xacro, is it a xacro file without its robot?'),
}


@pytest.mark.parametrize('case', REFUSALS)
def test_message_on(case):
    xml, message = REFUSALS[case]
    assert refusal(xml) == message


@pytest.mark.parametrize('text', [
    '/opt/robots/arm.urdf', '<robot name="bot"><link name="a"></robot>', '{"robot": "bot"}',
    '<robot name="bot"/><robot name="bot"/>', '<robot name="\x00"/>'])
def test_message_on_invalid_xml(text):
    message = refusal(text)
    assert message.startswith('robot_description is not well-formed XML (')
    assert message.endswith(f'), expected a URDF; it begins with {text[:40]!r}')


def test_the_text_in_a_message_is_short():
    assert len(refusal('x' * 100_000)) < 250


def test_as_many_links_as_may_be_are_read_and_no_more():
    def chain(links):
        body = ''.join(f'<link name="l{i}"/>' for i in range(links))
        return robot(body + ''.join(
            f'<joint name="j{i}" type="fixed"><parent link="l{i}"/>'
            f'<child link="l{i + 1}"/></joint>' for i in range(links - 1)))

    assert len(parse_urdf(chain(MOST_LINKS)).link_names) == MOST_LINKS
    with pytest.raises(ModelError, match=f'has {MOST_LINKS + 1} links, expected at most'):
        parse_urdf(chain(MOST_LINKS + 1))


def test_as_many_tags_as_may_be_are_read_and_no_more():
    text = robot(LINKS + JOINT + '{}')
    more = MOST_TAGS - text.count('<')
    assert parse_urdf(text.format('<a/>' * more)).joint('turn').moves
    with pytest.raises(ModelError, match=f'has {MOST_TAGS + 1} tags, expected at most'):
        parse_urdf(text.format('<a/>' * (more + 1)))


@pytest.mark.parametrize('length', [2**16 - 1, 2**16, 2**16 + 1, 200_000])
def test_a_text_of_any_length_is_read_as_a_whole(length):
    name = 'ü' * (length // 2) + 'x' * (length % 2)
    assert parse_urdf(joint_of('').replace('name="bot"', f'name="{name}"')).name == name


def test_a_declared_but_unused_xacro_namespace_is_no_xacro_file():
    xml = robot(LINKS + JOINT, 'name="bot" xmlns:xacro="http://www.ros.org/wiki/xacro"')
    assert parse_urdf(xml).link_names == ('base', 'arm')


def test_a_xacro_leftover_of_a_real_package_is_recognized():
    left_over = robot_path('ur3').with_name('ur3.urdf').read_text(encoding='utf-8')
    assert re.search('has no links.*xacro file without its robot', refusal(left_over))


def test_all_real_robots_are_read():
    for name in ROBOTS:
        urdf = robot_urdf(name)
        root = ElementTree.fromstring(urdf)
        parsed = parse_urdf(urdf)
        assert len(parsed.joints) == len(root.findall('joint'))
        assert len(parsed.link_names) == len(root.findall('link'))
