# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Several arms: two in one description, which is a tree, and two in two namespaces."""

from contextlib import ExitStack
import xml.etree.ElementTree as ET

from closed_loop import closed_loop, NAMES, send, START
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import LONG
from sensor_msgs.msg import JointState

SIDES = ('left_', 'right_')


def two_arms() -> str:
    """Return a description of two planar arms on one base, 1 m apart."""
    robot = ET.Element('robot', name='two_arms')
    ET.SubElement(robot, 'link', name='torso')
    for side, y in zip(SIDES, (0.5, -0.5)):
        for child in ET.fromstring(default_arm_urdf()):
            for element in child.iter():
                for key in ('name', 'link'):
                    if key in element.attrib and element.tag in (
                            'link', 'joint', 'parent', 'child', 'material'):
                        element.set(key, side + element.attrib[key])
            robot.append(child)
        mount = ET.SubElement(robot, 'joint', name=f'{side}mount', type='fixed')
        ET.SubElement(mount, 'origin', xyz=f'0 {y} 0')
        ET.SubElement(mount, 'parent', link='torso')
        ET.SubElement(mount, 'child', link=f'{side}base_link')
    return ET.tostring(robot, encoding='unicode')


def test_one_node_serves_the_two_arms_of_a_description(client):
    """Each arm is held at first; then one moves to its goal and the other stays."""
    urdf = two_arms()
    names = [side + name for side in SIDES for name in NAMES]
    body = ArmDynamics(load_arm(urdf)).rigid_body
    start, goal = [0.8, 0.5, 0.4, -0.3], [0.4, 0.9, 0.4, -0.3]
    with client.collect(JointState, '/two/joint_states') as states, \
            client.collect(JointState, '/two/dynamics/gravity_compensation') as gravity, \
            closed_loop('/two', {'robot_description': urdf}, robot_description=urdf,
                        initial_position=start):
        held = gravity.wait_for()
        assert list(held.name) == names
        assert held.effort == pytest.approx(body.gravity(np.array(start)), rel=1e-6)
        one = ArmDynamics(load_arm(default_arm_urdf())).rigid_body
        for k in range(2):  # arms on one fixed base do not act on each other
            assert held.effort[2 * k:2 * k + 2] == pytest.approx(
                one.gravity(np.array(start[2 * k:2 * k + 2])))
        send(client, '/two', (1.0, goal), names=names)
        states.wait_for(lambda m: np.abs(np.subtract(m.position, goal)).max() < 1e-3, LONG)
        right = [m.position[2:] for m in states.messages]
    assert np.abs(np.subtract(right, start[2:])).max() < 1e-4


def test_two_namespaces_are_two_arms(client):
    """A goal for one arm moves it alone."""
    goal = [START[0] - 0.3, START[1] + 0.3]
    with ExitStack() as stack:
        states = {side: stack.enter_context(
            client.collect(JointState, f'/{side}/joint_states')) for side in ('west', 'east')}
        for side in states:
            stack.enter_context(closed_loop(f'/{side}'))
        states['east'].wait_count(100)
        send(client, '/west', (1.0, goal))
        states['west'].wait_for(
            lambda m: np.abs(np.subtract(m.position, goal)).max() < 1e-3, LONG)
        count = len(states['east'].messages)
        states['east'].wait_count(count + 100)
        other = [m.position for m in states['east'].messages]
    assert np.abs(np.subtract(other, START)).max() < 1e-4
