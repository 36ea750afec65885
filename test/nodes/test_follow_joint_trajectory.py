# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The action `~/follow_joint_trajectory` of real nodes, with a client of rclpy.

The client of docs/trajectories.md goes through all results of the action.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
import re
import subprocess
import sys
from typing import Any

from action_clients import Client, seconds
from action_msgs.msg import GoalStatus
from bounded_waits import wait_until
from builtin_interfaces.msg import Duration
from children import run, TIMEOUT
from closed_loop import closed_loop, NAMES, START
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointComponentTolerance, JointTolerance
import numpy as np
import pytest
from ros_harness import DYNAMICS, NodeProcess, RosClient, running, SIMULATED_ARM
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

GOAL = [0.4, 0.9]
Result = FollowJointTrajectory.Result


def goal_of(
    *points: tuple[float, Sequence[float]], names: Sequence[str] = NAMES, **more: Any,
) -> FollowJointTrajectory.Goal:
    """Return a plan from rest to rest through these times [s] and positions."""
    trajectory = JointTrajectory(joint_names=list(names), points=[
        JointTrajectoryPoint(
            positions=list(q), velocities=[0.0] * len(q), accelerations=[0.0] * len(q),
            time_from_start=seconds(t))
        for t, q in points])
    return FollowJointTrajectory.Goal(trajectory=trajectory, **more)


@contextmanager
def served(client: RosClient, namespace: str, **arm: Any) -> Iterator[tuple[Client, NodeProcess]]:
    """Run an arm that is held at START, in lock-step by default."""
    with closed_loop(namespace, {'joints': NAMES}, **arm) as node:
        client.wait_for(JointState, f'{namespace}/dynamics/reference')
        yield Client(client, namespace), node


@pytest.fixture(scope='module')
def arm(client: RosClient) -> Iterator[Client]:
    with served(client, '/goals') as (server, _):
        yield server


def test_feedback_a_cancelled_goal_and_the_end_of_the_node(client):
    """In the time of the computer, because feedback comes at 20 Hz of it."""
    with served(client, '/timed', real_time_factor=1.0) as (server, node), \
            client.collect(JointState, '/timed/joint_states') as states:
        sent = server.send(goal_of((0.0, START), (2.0, GOAL)))
        assert sent.result() == (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL, '')
        last = sent.feedback[-1]
        assert list(last.joint_names) == NAMES
        assert np.subtract(last.desired.positions, last.actual.positions) == pytest.approx(
            list(last.error.positions), abs=1e-12)
        assert len(last.actual.velocities) == 2
        assert any(any(message.desired.velocities) for message in sent.feedback)

        sent = server.send(goal_of((0.0, GOAL), (3.0, START)))
        wait_until(lambda: any(
            abs(message.desired.velocities[0]) > 0.05 for message in sent.feedback), 'motion')
        sent.cancel()
        status, _, message = sent.result()
        count = len(states.messages)
        after = [m.velocity for m in states.wait_count(count + 50)[count:]]
        assert status == GoalStatus.STATUS_CANCELED
        assert message == 'cancelled: the arm is at rest'
        assert np.abs(after).max() < 0.03

        sent = server.send(goal_of((3600.0, GOAL)))
        wait_until(lambda: bool(sent.feedback), 'feedback')
        node.interrupt()
        assert sent.result() == (
            GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL, 'the node was deactivated')


@pytest.mark.parametrize(('goal', 'code', 'words'), [
    (goal_of((1.0, [0.0]), names=['joint1']), Result.INVALID_JOINTS, "lacks ['joint2']"),
    (goal_of(), Result.INVALID_GOAL, 'points is empty'),
    (goal_of((0.0, GOAL), (1.0, START)), Result.INVALID_GOAL, 's late, expected at most 0.5 s'),
    (goal_of((1.0, START), path_tolerance=[JointTolerance(name='elbow', position=0.1)]),
     Result.INVALID_JOINTS, "path_tolerance.position has a tolerance for 'elbow'"),
    (goal_of((1.0, START), goal_tolerance=[JointTolerance(name='joint2', velocity=-0.5)]),
     Result.INVALID_GOAL, "goal_tolerance.velocity of 'joint2' is -0.5"),
    (goal_of((1.0, START), path_tolerance=[JointTolerance(name='joint2', acceleration=0.5)]),
     Result.INVALID_GOAL, 'accelerations are not measured'),
    (goal_of((1.0, START), goal_time_tolerance=Duration(sec=-2)), Result.INVALID_GOAL,
     'goal_time_tolerance is -2 s'),
    (goal_of((1.0, START), component_goal_tolerance=[JointComponentTolerance()]),
     Result.INVALID_GOAL, 'component_goal_tolerance has 1 entries')])
def test_an_invalid_goal_is_aborted_with_its_reason(arm, goal, code, words):
    status, found, message = arm.send(goal).result()
    assert (status, found) == (GoalStatus.STATUS_ABORTED, code), message
    assert words in message


def test_a_stop_ends_every_goal_that_was_accepted_before(client, arm):
    """The node executes a goal later than it accepts it, and answers ~/stop at once."""
    for _ in range(20):
        sent = arm.send(goal_of((3600.0, GOAL)))
        assert client.call(Trigger, '/goals/dynamics/stop').success
        assert sent.result() == (
            GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL, '~/stop was called')


def test_the_tolerance_of_the_parameter_is_the_default(client, arm):
    def result(*points: tuple[float, Sequence[float]], **more: Any) -> tuple[int, str]:
        return arm.send(goal_of(*points, **more)).result()[1:]

    soon = {'goal_time_tolerance': Duration(nanosec=50_000_000)}
    client.set_parameters('/goals/dynamics', {'goal.tolerance': [0.0, 1e-15]})
    code, message = result((0.0, START), (2.0, GOAL), **soon)
    assert code == Result.GOAL_TOLERANCE_VIOLATED
    assert "'joint2' is" in message
    erased = {'goal_tolerance': [JointTolerance(name='joint2', position=-1.0)]}
    assert result((2.0, START), **erased) == (Result.SUCCESSFUL, '')
    client.set_parameters('/goals/dynamics', {'goal.tolerance': [0.01]})


EXAMPLE = Path(__file__).resolve().parents[2] / 'docs' / 'examples' / 'follow_trajectory.py'
RESULTS = [
    ('to its start', 'SUCCEEDED', 0), ('there', 'SUCCEEDED', 0), ('too fast', 'ABORTED', -1),
    ('another joint', 'ABORTED', -2), ('in the past', 'ABORTED', -3),
    ('off the path', 'ABORTED', -4), ('back', 'SUCCEEDED', 0), ('off the goal', 'ABORTED', -5),
    ('replaced', 'ABORTED', -1), ('cancelled', 'CANCELED', -1)]


def test_the_example_gets_each_result():
    with running(
            NodeProcess(DYNAMICS, {'lock_step': True}),
            NodeProcess(SIMULATED_ARM, {
                'rate': 125.0, 'lock_step': True, 'real_time_factor': 1.0,
                'initial_position': START})):
        done = run([sys.executable, str(EXAMPLE)], stdout=subprocess.PIPE,
                   stderr=subprocess.STDOUT, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stdout
    found = re.findall(r'^(.+?): (\w+), (-?\d)', done.stdout, re.MULTILINE)
    assert [(what, status, int(code)) for what, status, code in found] == RESULTS, done.stdout
