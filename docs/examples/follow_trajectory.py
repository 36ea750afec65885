# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Send goals to `/dynamics/follow_joint_trajectory` of the default arm, one for each result.

    python docs/examples/follow_trajectory.py
"""

from collections.abc import Sequence
import sys
from typing import Any

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration, Time
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

HERE, THERE = [0.8, 0.5], [0.4, 0.9]


def trajectory(
    start: Sequence[float], goal: Sequence[float], seconds: int = 2,
    names: Sequence[str] = ('joint1', 'joint2'), stamp: int = 0,
) -> JointTrajectory:
    """Return a motion from rest to rest."""
    message = JointTrajectory(joint_names=list(names), points=[
        JointTrajectoryPoint(
            positions=list(q), velocities=[0.0, 0.0], accelerations=[0.0, 0.0],
            time_from_start=Duration(sec=t))
        for t, q in ((0, start), (seconds, goal))])
    message.header.stamp = Time(sec=stamp)
    return message


def goal(*arguments: Any, tolerances: Any = (), **options: Any) -> FollowJointTrajectory.Goal:
    """Return a goal; `tolerances` are its fields."""
    return FollowJointTrajectory.Goal(
        trajectory=trajectory(*arguments, **options), **dict(tolerances))


class Client:
    """Sends goals, and prints their results."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._action = ActionClient(
            node, FollowJointTrajectory, '/dynamics/follow_joint_trajectory')
        if not self._action.wait_for_server(10.0):
            sys.exit('no server of /dynamics/follow_joint_trajectory in 10 s')

    def _wait(self, future: Any) -> Any:
        rclpy.spin_until_future_complete(self._node, future)
        return future.result()

    def start(self, request: FollowJointTrajectory.Goal) -> Any:
        """Send a goal; return its handle."""
        return self._wait(self._action.send_goal_async(request))

    def report(self, what: str, handle: Any) -> None:
        """Wait for the result, and print it."""
        answer = self._wait(handle.get_result_async())
        status = next(
            name.removeprefix('STATUS_') for name in dir(GoalStatus)
            if name.startswith('STATUS_') and getattr(GoalStatus, name) == answer.status)
        print(f'{what}: {status}, {answer.result.error_code} {answer.result.error_string}')

    def cancel(self, handle: Any) -> None:
        """Cancel a goal."""
        self._wait(handle.cancel_goal_async())


def main() -> None:
    """Move the arm to and fro, and send goals that fail."""
    rclpy.init()
    node = rclpy.create_node('trajectory_client')
    client = Client(node)
    client.report('to its start', client.start(goal(HERE, HERE)))
    client.report('there', client.start(goal(HERE, THERE)))
    client.report('too fast', client.start(goal(THERE, [0.4, 20.0], 1)))
    client.report('another joint', client.start(goal(THERE, HERE, names=['joint1', 'elbow'])))
    client.report('in the past', client.start(goal(THERE, HERE, stamp=1)))
    path = {'path_tolerance': [JointTolerance(name='joint1', position=1e-9)]}
    client.report('off the path', client.start(goal(THERE, HERE, tolerances=path)))
    client.report('back', client.start(FollowJointTrajectory.Goal(
        trajectory=JointTrajectory(joint_names=['joint1', 'joint2'], points=[
            JointTrajectoryPoint(positions=HERE, time_from_start=Duration(sec=2))]))))
    end = {'goal_tolerance': [JointTolerance(name='joint1', position=1e-15)],
           'goal_time_tolerance': Duration(nanosec=200_000_000)}
    client.report('off the goal', client.start(goal(HERE, THERE, tolerances=end)))
    replaced = client.start(goal(THERE, HERE, 10))
    cancelled = client.start(goal(THERE, THERE, 10))
    client.report('replaced', replaced)
    client.cancel(cancelled)
    client.report('cancelled', cancelled)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
