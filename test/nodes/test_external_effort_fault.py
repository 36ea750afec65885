# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Real node: an external effort above its limit is a fault, only if there is a limit."""

from collections.abc import Iterator

from closed_loop import NAMES, START
from diagnostic_msgs.msg import DiagnosticArray
from held_robot import HeldRobot
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import DYNAMICS, LONG, NodeProcess, RosClient, UNHURRIED, wait_until

NODE = '/resisted/dynamics'
GRAVITY = ArmDynamics(load_arm(default_arm_urdf())).rigid_body.gravity(np.array(START))
LIFT = np.array([0.0, 3.0])
"""External torque on joint2 of the robot, which is at rest."""


@pytest.fixture(scope='module')
def node() -> Iterator[NodeProcess]:
    with NodeProcess(DYNAMICS, {**UNHURRIED, 'joints': NAMES}, namespace='/resisted') as process:
        yield process


@pytest.fixture(scope='module')
def robot(client: RosClient, node: NodeProcess) -> HeldRobot:
    return HeldRobot(client, '/resisted', position=START, effort=(GRAVITY - LIFT).tolist())


def has_status(
    client: RosClient, robot: HeldRobot, words: str, name: str = 'external effort',
) -> None:
    """Wait for these words of a status in the diagnostics."""
    def found() -> bool:
        robot.say()
        return any(
            status.name == f'{NODE}: {name}' and words in status.message
            for message in diagnostics.messages for status in message.status)

    with client.collect(DiagnosticArray, '/diagnostics') as diagnostics:
        wait_until(found, words, LONG)


def test_without_a_limit_nothing_is_observed(client, robot):
    has_status(client, robot, 'no limit')


def test_a_contact_is_a_fault_if_wanted(client, node, robot):
    reason = client.rejection(NODE, 'contact.is_fault', True)
    assert 'contact.is_fault is true without levels' in reason
    client.set_parameters(NODE, {'contact.effort': [1.0, 2.0], 'contact.is_fault': True})
    robot.say(30)
    node.wait_for_log(
        r"Fault external_effort: .*'joint2'.* at most 2 \(external_effort_limit or contact")
    reason = client.rejection(NODE, 'contact.effort', [0.0, 0.0])
    assert 'contact.is_fault is true without levels' in reason
    client.set_parameters(NODE, {'contact.is_fault': False})


def test_the_smaller_limit_counts_and_a_missing_effort_is_reported(client, node, robot):
    client.set_parameters(NODE, {'external_effort_limit': [0.0, 4.0]})
    has_status(client, robot, 'limited')
    robot.say(50)  # the fault ends
    client.set_parameters(NODE, {'external_effort_limit': [0.0, 2.5]})
    has_status(client, robot, 'expected at most 2.5', 'command')
    node.provoke(lambda: robot.say(effort=[]), 'is not limited: joint states have no effort')
