# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The action `~/follow_joint_trajectory` of real nodes, with a client of rclpy."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
from typing import Any

from action_clients import Client, seconds
from action_msgs.msg import GoalStatus
from bounded_waits import wait_until
from builtin_interfaces.msg import Duration
from closed_loop import closed_loop, NAMES, START
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointComponentTolerance, JointTolerance
import numpy as np
import pytest
from ros_harness import DYNAMICS, NodeProcess, RosClient
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
def served(
    client: RosClient, namespace: str, dynamics: dict[str, Any] | None = None,
    **arm: Any,
) -> Iterator[tuple[Client, NodeProcess]]:
    """Run an arm that is held at START, in lock-step by default."""
    with closed_loop(namespace, {
            'condition_references': True, 'scale_gains': True, **(dynamics or {})},
            rate=500.0, **arm) as node:
        client.wait_for(JointState, f'{namespace}/dynamics/reference')
        yield Client(client, namespace), node


@pytest.fixture(scope='module')
def arm(client: RosClient) -> Iterator[Client]:
    with served(client, '/goals') as (server, _):
        yield server


def test_a_plan_succeeds_with_feedback(client):
    """In wall time, because feedback comes at 20 Hz of wall time."""
    with served(client, '/succeeds', lock_step=False) as (server, _):
        sent = server.send(goal_of((0.0, START), (2.0, GOAL)))
        assert sent.result() == (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL, '')
    assert len(sent.feedback) > 10
    last = sent.feedback[-1]
    assert list(last.joint_names) == NAMES
    assert np.subtract(last.desired.positions, last.actual.positions) == pytest.approx(
        list(last.error.positions), abs=1e-12)
    assert last.desired.positions == pytest.approx(GOAL, abs=0.05)
    assert len(last.actual.velocities) == 2
    assert any(any(message.desired.velocities) for message in sent.feedback)


@pytest.mark.parametrize(('goal', 'code', 'words'), [
    (goal_of((1.0, START), names=['joint1', 'elbow']), Result.INVALID_JOINTS,
     "joint_names has 'elbow', expected only joints of this arm"),
    (goal_of((1.0, [0.0]), names=['joint1']), Result.INVALID_JOINTS, "lacks ['joint2']"),
    (goal_of(), Result.INVALID_GOAL, 'points is empty'),
    (goal_of((0.0, START), (0.02, GOAL)), Result.INVALID_GOAL, 'not feasible'),
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


def test_a_goal_of_the_past_is_refused(arm):
    """It ends before the first state of the simulated time, which is at 2 ms."""
    goal = goal_of((0.0, START), (0.001, START))
    goal.trajectory.header.stamp.nanosec = 1
    status, code, message = arm.send(goal).result()
    assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.OLD_HEADER_TIMESTAMP)
    assert 'expected an end in the future' in message


def test_an_invalid_goal_does_not_disturb_the_motion(arm):
    moving = arm.send(goal_of((0.0, START), (2.0, GOAL)))
    wrong = arm.send(goal_of((1.0, START), names=['joint1', 'elbow']))
    assert wrong.result()[1] == Result.INVALID_JOINTS
    assert moving.result()[1] == Result.SUCCESSFUL
    assert arm.send(goal_of((0.0, GOAL), (2.0, START))).result()[1] == Result.SUCCESSFUL


def test_tolerances_that_the_arm_exceeds_abort_the_goal(client):
    """A load that the model lacks: the arm is 10 mrad or more behind its reference."""
    with served(client, '/tolerances') as (server, _):
        tight = [JointTolerance(name='joint1', position=1e-9)]
        status, code, message = server.send(
            goal_of((0.0, START), (2.0, GOAL), path_tolerance=tight)).result()
        assert (status, code) == (
            GoalStatus.STATUS_ABORTED, Result.PATH_TOLERANCE_VIOLATED), message
        assert message.startswith("path tolerance: 'joint1' is")
        server.send(goal_of((2.0, START))).result()
        status, code, message = server.send(goal_of(
            (0.0, START), (2.0, GOAL), goal_tolerance=[JointTolerance(
                name='joint2', position=1e-16)], goal_time_tolerance=seconds(0.2))).result()
        assert (status, code) == (
            GoalStatus.STATUS_ABORTED, Result.GOAL_TOLERANCE_VIOLATED), message


def test_a_cancelled_goal_ends_at_rest(client):
    with served(client, '/cancels', real_time_factor=1.0) as (server, _), \
            client.collect(JointState, '/cancels/joint_states') as states:
        sent = server.send(goal_of((0.0, START), (3.0, GOAL)))
        wait_until(lambda: any(
            abs(message.desired.velocities[0]) > 0.05 for message in sent.feedback), 'motion')
        sent.cancel()
        status, _, message = sent.result()
        count = len(states.messages)
        states.wait_count(count + 50)
        after = [message.velocity for message in states.messages[count:]]
    assert status == GoalStatus.STATUS_CANCELED
    assert message == 'cancelled: the arm is at rest'
    assert np.abs(after).max() < 0.03


def test_a_new_goal_a_topic_and_a_stop_end_a_goal(client, arm):
    first = arm.send(goal_of((3600.0, GOAL)))
    second = arm.send(goal_of((3600.0, GOAL)))
    assert first.result() == (
        GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL,
        'another goal has replaced this one: [0.4, 0.9]')
    publisher = client.publisher(JointTrajectory, '/goals/dynamics/joint_trajectory')
    publisher.publish(goal_of((3600.0, START)).trajectory)
    assert second.result()[2] == 'another goal has replaced this one: [0.8, 0.5]'
    client.node.destroy_publisher(publisher)
    third = arm.send(goal_of((3600.0, GOAL)))
    assert client.call(Trigger, '/goals/dynamics/stop').success
    assert third.result() == (
        GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL, '~/stop was called')
    assert arm.send(goal_of((2.0, START))).result()[1] == Result.SUCCESSFUL


def test_a_stop_ends_every_goal_that_was_accepted_before(client, arm):
    """The node executes a goal later than it accepts it, and answers ~/stop at once."""
    for _ in range(50):
        sent = arm.send(goal_of((3600.0, GOAL)))
        assert client.call(Trigger, '/goals/dynamics/stop').success
        assert sent.result() == (
            GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL, '~/stop was called')


def test_the_result_arrives_when_the_node_ends(client):
    with served(client, '/ending', lock_step=False) as (server, node):
        sent = server.send(goal_of((3600.0, GOAL)))
        wait_until(lambda: bool(sent.feedback), 'feedback')
        node.interrupt()
        status, code, message = sent.result()
    assert (status, code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert message == 'the node was deactivated'


def test_the_tolerances_of_the_parameters_are_the_defaults(client):
    with served(client, '/defaults', {'joints': NAMES, 'goal.path_tolerance': [0.0, 1e-9]}) as (
            server, _):
        goal = goal_of((0.0, START), (2.0, GOAL))
        status, code, message = server.send(goal).result()
        assert (status, code) == (
            GoalStatus.STATUS_ABORTED, Result.PATH_TOLERANCE_VIOLATED), message
        assert "'joint2' is" in message
        erased = [JointTolerance(name='joint2', position=-1.0)]
        server.send(goal_of((2.0, START), path_tolerance=erased)).result()
        status, code, message = server.send(
            goal_of((0.0, START), (2.0, GOAL), path_tolerance=erased)).result()
        assert code == Result.SUCCESSFUL, message


def test_without_control_msgs_the_node_starts_and_says_so(tmp_path):
    hidden = tmp_path / 'control_msgs'
    hidden.mkdir()
    (hidden / '__init__.py').write_text('raise ImportError("not installed")\n', 'utf-8')
    node = NodeProcess(DYNAMICS, {}, namespace='/without', environment={
        'PYTHONPATH': os.pathsep.join((str(tmp_path), os.environ.get('PYTHONPATH', '')))})
    with node:
        node.wait_for_log('~/follow_joint_trajectory is not offered: control_msgs is not')
