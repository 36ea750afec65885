# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Error messages of the URDF parser."""

import re

from one_joint_urdf import INERTIA, INERTIAL, JOINT, joint_of, LIMIT, link_of, LINKS, mimics, robot
import pytest
from robot_dynamics.exceptions import ModelError, RobotDynamicsError
from robot_dynamics.urdf.parser import MOST_LINKS, MOST_TAGS, parse_urdf
from robots import robot_path


def refusal(xml):
    with pytest.raises(ModelError) as caught:
        parse_urdf(xml)
    assert isinstance(caught.value, RobotDynamicsError)
    assert isinstance(caught.value, ValueError)
    return str(caught.value)


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
        "robot_description: joint 'turn': child link is missing, expected one of ['base', 'arm']"),
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
        "robot_description: joint 'turn' is revolute and has no <limit>, which URDF requires: a "
        'joint without limits has the type continuous'),
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


@pytest.mark.parametrize('kind', ['revolute', 'continuous', 'prismatic'])
@pytest.mark.parametrize('attribute', ['velocity', 'effort'])
def test_a_negative_effort_or_velocity_limit_is_refused(kind, attribute):
    for value, shown in (('-3', '-3'), ('-inf', '-inf'), ('-1e-300', '-1e-300')):
        assert refusal(joint_of('', kind, f'<limit {attribute}="{value}"/>')) == (
            f"robot_description: joint 'turn': {attribute}={shown}, expected >= 0 (0: unknown)")


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


def test_a_xacro_leftover_of_a_real_package_is_recognized():
    left_over = robot_path('ur3').with_name('ur3.urdf').read_text(encoding='utf-8')
    assert re.search('has no links.*xacro file without its robot', refusal(left_over))
