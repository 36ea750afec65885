# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The loop through ros2_control: arm, broadcaster, `dynamics`, effort controller, arm.

ros2_control cannot be installed here; `ros2_control_standin` replaces it.
"""

import time

from closed_loop import collecting, NAMES, START
from fault_table import fault
import numpy as np
import pytest
from robot_dynamics.ros.middleware.conversions import trajectory_to_ros
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from ros2_control_standin import commanding, ros2_control
from ros_harness import Collector, LONG, NodeProcess, SIMULATED_ARM, wait_until
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

GROUP = 'ros2_control and replayed recordings'
GOAL = [0.4, 0.9]
ALWAYS = -1.0
"""A threshold with which every command is published."""


def wait_unchanged(efforts: Collector) -> list[float]:
    """Wait until efforts are unchanged for longer than the timeout of the arm; return them."""
    efforts.clear()

    def last() -> set[tuple[float, ...]]:
        return {tuple(m.effort) for m in efforts.messages[-300:]}

    wait_until(
        lambda: len(efforts.messages) >= 300 and len(last()) == 1, 'efforts that do not change',
        LONG)
    effort, = last()
    return list(effort)


@fault(GROUP, 'SIGKILL of `dynamics` behind a `JointGroupEffortController` (stand-in) that moves '
       '`simulated_arm`; then the controller is deactivated',
       'the arm reaches its goal first; after SIGKILL the last command stays active, and the '
       'brakes do not engage; deactivation writes 0 immediately: the arm falls')
def test_the_loop_closes_and_the_controller_keeps_the_last_efforts(client):
    with collecting(client, '/closed', 'simulated/joint_states', 'simulated/effort_command') as (
            measured, received), NodeProcess(
                SIMULATED_ARM, {
                    'rate': 200.0, 'initial_position': START, 'command_timeout': 1.0},
                namespace='/closed', remaps={
                    'joint_states': 'simulated/joint_states',
                    'effort_command': 'simulated/effort_command'}) as arm, \
            ros2_control('/closed', NAMES, ALWAYS):
        dynamics = commanding('/closed').start()
        try:
            publisher = client.publisher(JointTrajectory, '/closed/dynamics/joint_trajectory')
            goal = trajectory_to_ros(make_trajectory(NAMES, [2.0], [GOAL], (), (), NAMES))
            again = 0.0

            def is_at_goal() -> bool:
                nonlocal again
                if time.monotonic() > again + 5.0:  # on a loaded machine the states may pause
                    again = time.monotonic()
                    publisher.publish(goal)
                last = measured.messages[-1]
                return bool(last.position == pytest.approx(GOAL, abs=0.02)
                            and np.abs(last.velocity).max() < 0.05)

            measured.wait_for(lambda m: any(m.effort), LONG)
            wait_until(is_at_goal, 'the goal', LONG)
        finally:
            dynamics.kill()
        assert np.abs(wait_unchanged(received)).min() > 1.0
        assert 'No valid effort' not in arm.log
        answer = client.call(
            SetBool, '/closed/effort_controller/set_active', SetBool.Request(data=False))
        assert answer.success
        received.wait_for(lambda m: not any(m.effort))
        assert not any(wait_unchanged(received))
        measured.clear()
        measured.wait_for(lambda m: np.abs(np.subtract(m.position, GOAL)).max() > 0.5, LONG)
        assert 'No valid effort' not in arm.log
