# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Two arms in one description, which is a tree."""

import re

from closed_loop import closed_loop, NAMES, send
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import LONG
from sensor_msgs.msg import JointState

SIDES = ('left_', 'right_')


def two_arms() -> str:
    """Return a description of two planar arms on one base, 1 m apart."""
    arm = re.search('<robot[^>]*>(.*)</robot>', default_arm_urdf(), re.DOTALL)[1]
    sides = ''.join(
        re.sub('(name|link)="', rf'\1="{side}', arm) + f"""
        <joint name="{side}mount" type="fixed"><origin xyz="0 {y} 0"/>
        <parent link="torso"/><child link="{side}base_link"/></joint>"""
        for side, y in zip(SIDES, (0.5, -0.5)))
    return f'<robot name="two_arms"><link name="torso"/>{sides}</robot>'


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
        send(client, '/two', (1.0, goal), names=names)
        states.wait_for(lambda m: np.abs(np.subtract(m.position, goal)).max() < 1e-3, LONG)
        right = [m.position[2:] for m in states.messages]
    assert np.abs(np.subtract(right, start[2:])).max() < 1e-4
