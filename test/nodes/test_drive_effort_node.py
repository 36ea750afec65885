# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0
"""Real nodes in lock-step: an arm whose drives have a scale and an offset."""

from bounded_waits import has_stamp, wait_until
from closed_loop import closed_loop, collecting, NAMES, send, START
from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from robot_dynamics.model import arm_from_parameters, ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.ros.dynamics.parameters import effort_rates, torque_rates
from ros_harness import DYNAMICS, LONG, NodeProcess, UNHURRIED
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

GOAL = [0.2, 1.0]
G = ArmDynamics(load_arm(default_arm_urdf())).gravity(START)
SCALE, OFFSET = [0.7, 1.3], [8.0, -4.0]
DRIVES = {
    'joints': NAMES, 'effort.command_scale': SCALE, 'effort.command_offset': OFFSET,
    'effort.report_scale': [*SCALE], 'effort.report_offset': [*OFFSET]}  # no aliases in YAML
NOISE = 0.02
"""Standard deviation of the measured effort [N·m]."""


def test_known_drives_hold_and_move_the_arm_with_efforts_of_the_driver(client):
    with client.collect(Float64MultiArray, '/holds/dynamics/commands') as bare, collecting(
            client, '/holds', 'joint_states', 'effort_command',
            'dynamics/gravity_compensation') as topics:
        states, commands, gravity = topics
        with closed_loop('/holds', DRIVES, **DRIVES, effort_noise=NOISE):
            still = states.wait_count(100)
            bare.wait_count(1)
            first = commands.messages[0]
            torque = gravity.wait_for(has_stamp(first.header.stamp))
            send(client, '/holds', (2.0, GOAL))
            states.wait_for(lambda m: np.abs(np.subtract(m.position, GOAL)).max() < 1e-3, LONG)
            sent = commands.messages
    assert np.abs(np.array([m.position for m in still]) - START).max() < 1e-3
    assert (np.abs([m.effort for m in sent]) <= [150.0, 60.0]).all()
    assert first.effort == pytest.approx(G / SCALE + OFFSET)  # efforts of the driver
    assert torque.effort == pytest.approx(G)  # a torque at the joints
    assert {tuple(m.data) for m in bare.messages if any(m.data)} & {tuple(m.effort) for m in sent}


@pytest.mark.parametrize(('limit', 'first'), [([], None), ([50.0, 20.0], [-50.0, -11.772])])
def test_an_arm_without_effort_limits_is_commanded_once_a_parameter_gives_them(
        client, limit, first):
    urdf = planar_arm_urdf(
        [5.0, 3.0], [1.0, 0.8], [0.5, 0.4], [0.1, 0.05], effort_limits=7.0).replace('"7.0"', '"0"')
    parameters = {'robot_description': urdf, 'joints': NAMES, 'effort.limit': limit}
    state = JointState(name=NAMES, position=[np.pi / 2, 0.0], velocity=[0.0, 0.0])

    def is_told() -> bool:
        state.header.stamp = client.node.get_clock().now().to_msg()
        states.publish(state)
        return bool(commands.messages) if limit else any(
            'nothing is commanded' in status.message for report in diagnostics.messages
            for status in report.status if status.name == '/unlimited/dynamics: command')

    with client.collect(JointState, '/unlimited/effort_command') as commands, \
            client.collect(DiagnosticArray, '/diagnostics') as diagnostics, \
            NodeProcess(DYNAMICS, {**UNHURRIED, **parameters}, namespace='/unlimited') as node:
        states = client.publisher(JointState, '/unlimited/joint_states', 1)
        wait_until(is_told, 'a command, or why there is none')
        if not limit:
            node.wait_for_log(r"nothing is commanded: \['joint1', 'joint2'\] have no effort limit")
    assert not commands.messages if first is None else (
        list(commands.messages[0].effort) == pytest.approx(first))


@pytest.mark.parametrize(('rate', 'driver'), [(0.0, [1500.0, 600.0]), (40.0, [40.0, 40.0])])
def test_the_rate_limit_is_that_of_the_driver(rate, driver):
    arm, values = arm_from_parameters(default_arm_urdf(), DRIVES), {'effort_rate_limit': rate}
    assert effort_rates(values, arm).tolist() == driver
    assert torque_rates(values, arm) == pytest.approx(np.array(driver) * SCALE)
