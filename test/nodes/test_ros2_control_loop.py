# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The loop through ros2_control: arm, broadcaster, `dynamics`, effort controller, arm.

ros2_control cannot be installed here; `ros2_control_standin` replaces it.
"""

from collections.abc import Iterator
from contextlib import ExitStack
import itertools
import time
from typing import Any, NamedTuple

from closed_loop import NAMES, START
from fault_table import fault
import numpy as np
import pytest
from robot_dynamics.ros.middleware.conversions import trajectory_to_ros
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from ros2_control_standin import commanding, DEFAULT_THRESHOLD, INTERFACES, ros2_control
from ros_harness import (
    Collector,
    KEEP_MANY,
    LONG,
    NodeProcess,
    RosClient,
    SIMULATED_ARM,
    wait_until,
)
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

GROUP = 'ros2_control and replayed recordings'
GOAL = [0.4, 0.9]
ALWAYS = -1.0
"""A threshold with which every command is published."""


class Robot(NamedTuple):
    """A simulated arm behind the stand-ins; collectors of its states, efforts and broadcasts."""

    space: str
    arm: NodeProcess
    measured: Collector
    received: Collector
    broadcast: Collector

    def set_active(self, client: RosClient, is_active: bool) -> None:
        """Activate or deactivate the effort controller."""
        answer = client.call(
            SetBool, f'{self.space}/effort_controller/set_active', SetBool.Request(data=is_active))
        assert answer.success


def robot(
    client: RosClient, stack: ExitStack, space: str, threshold: float,
    interfaces: Any = INTERFACES, command_timeout: float = 0.2,
) -> Robot:
    """Start a simulated arm behind the stand-ins, until `stack` is closed."""
    def collect(topic: str) -> Collector:
        return stack.enter_context(client.collect(JointState, f'{space}/{topic}', KEEP_MANY))

    measured, received = collect('simulated/joint_states'), collect('simulated/effort_command')
    broadcast = collect('joint_states')
    arm = stack.enter_context(NodeProcess(
        SIMULATED_ARM, {'rate': 200.0, 'initial_position': START,
                        'command_timeout': command_timeout}, namespace=space,
        remaps={'joint_states': 'simulated/joint_states',
                'effort_command': 'simulated/effort_command'}))
    stack.enter_context(ros2_control(space, NAMES, threshold, interfaces))
    return Robot(space, arm, measured, received, broadcast)


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as processes:
        yield processes


def test_before_the_first_command_there_is_none(client, stack):
    one = robot(client, stack, '/before', ALWAYS, ['position'])
    assert all(np.isnan(m.effort).all() for m in one.received.wait_count(20))
    one.arm.wait_for_log('Rejected an effort')
    stamps = {(m.header.stamp.sec, m.header.stamp.nanosec) for m in one.measured.wait_count(20)}
    state = one.broadcast.wait_for(lambda m: list(m.position) == START)
    assert list(state.name) == NAMES
    assert (state.header.stamp.sec, state.header.stamp.nanosec) not in stamps
    assert np.isnan([*state.velocity, *state.effort]).all()


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
def test_the_loop_closes_and_the_controller_keeps_the_last_efforts(client, stack):
    one = robot(client, stack, '/closed', ALWAYS, command_timeout=1.0)
    dynamics = commanding(one.space).start()
    try:
        publisher = client.publisher(JointTrajectory, '/closed/dynamics/joint_trajectory')
        path = trajectory_to_ros(quintic_point_to_point(NAMES, START, GOAL, 2.0))
        client.ask(
            publisher, path, one.measured, lambda m: np.abs(np.subtract(m.position, START)).max()
            > 0.01, LONG)
        again = time.monotonic()

        def is_at_goal() -> bool:
            nonlocal again
            if time.monotonic() > again + 5.0:  # on a loaded machine the states may pause
                again = time.monotonic()
                publisher.publish(trajectory_to_ros(make_trajectory(
                    NAMES, [2.0], [GOAL], (), (), NAMES)))
            last = one.measured.messages[-1]
            return bool(last.position == pytest.approx(GOAL, abs=0.02)
                        and np.abs(last.velocity).max() < 0.05)

        wait_until(is_at_goal, 'the goal', LONG)
    finally:
        dynamics.kill()
    kept = wait_unchanged(one.received)
    assert np.abs(kept).min() > 1.0
    assert 'No valid effort' not in one.arm.log

    one.set_active(client, False)
    one.received.wait_for(lambda m: not any(m.effort))
    assert not any(wait_unchanged(one.received))
    one.measured.clear()
    one.measured.wait_for(lambda m: np.abs(np.subtract(m.position, GOAL)).max() > 0.5, LONG)
    assert 'No valid effort' not in one.arm.log


@fault(GROUP, '`trigger_joint_command_threshold` at its default (stand-in), while the arm is held',
       'a command equal to the reported effort is not published: the brakes of '
       '`simulated_arm` engage after `command_timeout`; the next command releases them; this '
       'repeats')
def test_a_threshold_that_is_not_negative_lets_the_brakes_cycle(client, stack, seen):
    one = robot(client, stack, '/threshold', DEFAULT_THRESHOLD)
    stack.enter_context(commanding(one.space))
    one.received.wait_for(lambda m: np.isfinite(m.effort).all())
    one.measured.clear()

    def engagements() -> int:
        braked = [not any(m.effort) for m in one.measured.messages]
        return sum(not before and after for before, after in itertools.pairwise(braked))

    one.received.clear()
    wait_until(lambda: engagements() >= 5, 'brakes that engage five times', LONG)
    stamps = [m.header.stamp for m in one.received.messages]
    span = (stamps[-1].sec - stamps[0].sec) + 1e-9 * (stamps[-1].nanosec - stamps[0].nanosec)
    seen(f'{(len(stamps) - 1) / span:.1f} commands per second')
    one.arm.wait_for_log('the brakes hold the arm where it is')
