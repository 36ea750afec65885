# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Real nodes at default parameters: set-points of any size are reached within the limits.

The loop runs in lock-step, so that the result does not depend on the machine.
`scripts/bench safe_motion` runs thousands of cases without ROS.
"""

from collections.abc import Callable
from typing import Any

from children import TIMEOUT
from closed_loop import closed_loop, collecting, NAMES, send, START
from diagnostic_msgs.msg import DiagnosticArray
from disturbances import push, ZERO
from lock_step_loop import middle
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robots import arm_without_gripper, robot_urdf
from ros_harness import Collector, LONG, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

ARRIVED = 0.005
"""[rad] from the goal, and [rad/s]."""


def wait_arrived(states: Collector, goal: np.ndarray) -> None:
    """Wait until the arm rests at a goal."""
    states.wait_for(
        lambda m: np.abs(np.array(m.position) - goal).max() < ARRIVED
        and np.abs(m.velocity).max() < ARRIVED, LONG)


def wait_active(states: Collector) -> None:
    """Wait for 0.1 s of simulated time: the first state is repeated until the node is active."""
    states.wait_for(lambda m: m.header.stamp.nanosec > 100_000_000, LONG)


def wait_held(
    states: Collector, is_held: Callable[[np.ndarray], bool] = lambda _: True,
) -> tuple[JointState, JointState]:
    """
    Return the first state at rest whose position meets a condition, and the state 2 s later.

    The collector may receive states seconds of simulated time late. Therefore the time of an
    action of the test does not identify a state: clear the collector before the action.
    """
    held = states.wait_for(
        lambda m: np.abs(m.velocity).max() < 1e-4 and is_held(np.array(m.position)), LONG)
    end = stamp_from_ros(held.header.stamp) + 2 * 10**9
    return held, states.wait_for(lambda m: stamp_from_ros(m.header.stamp) >= end, LONG)


def test_a_set_point_is_reached_within_the_limits(client):
    arm = arm_without_gripper('ur10')
    names, limits, namespace = list(arm.joint_names), arm.limits, '/safe_ur10'
    start = middle(arm, 0.3)
    way = np.where(np.arange(len(names)) % 2 == 0, -2.0, 2.0)
    goal = np.clip(start + way, limits.lower + 0.1, limits.upper - 0.1)
    of_both = {'robot_description': robot_urdf('ur10'), 'joints': names}
    with client.collect(JointState, f'{namespace}/joint_states') as states, closed_loop(
            namespace, of_both, **of_both, initial_position=start.tolist()):
        wait_active(states)
        # Without a reference the arm drifts: sampled gravity compensation is unstable, and time
        # constants of a second turn rounding errors into motion within 20 s of simulated time.
        client.set_parameters(f'{namespace}/simulated_arm', {'paused': True})
        send(client, namespace, (0.0, goal), names=names)
        client.set_parameters(f'{namespace}/simulated_arm', {'paused': False})
        wait_arrived(states, goal)
        messages = states.messages
    q, v = (np.array([getattr(m, field) for m in messages]) for field in ('position', 'velocity'))
    moved = np.abs(goal - start)
    assert (np.abs(v) <= limits.velocity).all()
    assert np.abs(q - start).max() > 0.9 * moved.max()  # a starved observer may miss the motion
    past = np.maximum(q - np.maximum(start, goal), np.minimum(start, goal) - q)
    assert (past <= np.maximum(0.05 * moved, 0.01)).all()


def test_the_first_trial_of_the_safety_page(client):
    """docs/safety.md, section "The first command, and every change", step by step."""
    start, goal = np.array(START), np.array([0.85, 0.5])
    namespace, node = '/first_trial', '/first_trial/dynamics'
    gravity = ArmDynamics(load_arm(default_arm_urdf())).rigid_body.gravity(start)

    def set_parameter(name: str, value: Any) -> None:
        client.set_parameters(node, {name: value})

    def hold_for(states: Collector, seconds: float) -> None:
        begin = states.wait_count(1, LONG)[-1].header.stamp
        end = begin.sec + 1e-9 * begin.nanosec + seconds
        states.wait_for(lambda m: m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec > end, LONG)

    with collecting(client, namespace, 'joint_states', 'effort_command') as (states, efforts), \
            closed_loop(namespace, {'joints': NAMES, 'command': 'none'}, real_time_factor=4.0):
        computed = client.wait_for(JointState, f'{node}/gravity_compensation', timeout=LONG)
        assert computed.effort == pytest.approx(gravity)
        assert not efforts.messages
        set_parameter('command', 'gravity_compensation')
        assert efforts.wait_count(1, LONG)[0].effort == pytest.approx(gravity)
        for scale in (0.5, 0.05):
            set_parameter('effort_limit_fraction', scale)
            hold_for(states, 1.0)
            assert states.messages[-1].position == pytest.approx(start, abs=1e-6)
        set_parameter('effort_limit_fraction', 0.5)
        set_parameter('command', 'computed_torque')
        send(client, namespace, (0.0, goal))
        wait_arrived(states, goal)
        hold_for(states, 2.0)
        assert states.messages[-1].position == pytest.approx(goal, abs=1e-3)
        send(client, namespace, (0.0, goal + 2.0))
        states.wait_for(lambda m: m.position[0] > goal[0] + 0.2, LONG)
        assert client.call(Trigger, f'{node}/stop', Trigger.Request()).success
        wait_until(lambda: np.abs(states.messages[-1].velocity).max() < 1e-4, 'the stop', TIMEOUT)
        limits = load_arm(default_arm_urdf()).limits
        assert all((np.abs(m.velocity) <= limits.velocity).all() for m in states.messages)


def test_an_external_effort_above_its_limit_is_a_fault_that_ends_in_a_hold(client):
    goal, namespace = np.array(START) + 0.2, '/pushed_beyond'
    with client.collect(JointState, f'{namespace}/joint_states') as states, \
            client.collect(DiagnosticArray, '/diagnostics') as diagnostics, \
            closed_loop(namespace, {'external_effort_limit': [15.0]}, real_time_factor=4.0):
        wait_active(states)
        send(client, namespace, (0.0, goal))
        wait_arrived(states, goal)
        states.clear()
        push(client, f'{namespace}/simulated_arm', (20.0, 0.0, 20.0))
        diagnostics.wait_for(lambda message: any(
            value.key == 'faults: external_effort' and int(value.value) > 0
            for status in message.status if status.hardware_id.startswith(namespace.strip('/'))
            for value in status.values), LONG)
        push(client, f'{namespace}/simulated_arm', ZERO)
        held, later = wait_held(states, lambda q: np.abs(q - goal).max() > 1e-3)
    assert later.position == pytest.approx(held.position, abs=1e-3)
