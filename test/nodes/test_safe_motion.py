# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Real nodes: the first trial that docs/safety.md describes.

The loop runs in lock-step, so that the result does not depend on the machine.
`scripts/bench safe_motion` runs thousands of cases without ROS.
"""

from typing import Any

from children import TIMEOUT
from closed_loop import closed_loop, collecting, NAMES, send, START
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import Collector, LONG, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

ARRIVED = 0.005
"""[rad] from the goal, and [rad/s]."""


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
        states.wait_for(lambda m: np.abs(np.array(m.position) - goal).max() < ARRIVED
                        and np.abs(m.velocity).max() < ARRIVED, LONG)
        hold_for(states, 2.0)
        assert states.messages[-1].position == pytest.approx(goal, abs=1e-3)
        send(client, namespace, (0.0, goal + 2.0))
        states.wait_for(lambda m: m.position[0] > goal[0] + 0.2, LONG)
        assert client.call(Trigger, f'{node}/stop', Trigger.Request()).success
        wait_until(lambda: np.abs(states.messages[-1].velocity).max() < 1e-4, 'the stop', TIMEOUT)
        limits = load_arm(default_arm_urdf()).limits
        assert all((np.abs(m.velocity) <= limits.velocity).all() for m in states.messages)
