# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/feed_forward` and `~/position_offset` of real nodes, with the drives of `simulated_arm`."""

import re
from typing import Any

from bounded_waits import has_stamp, wait_until
from closed_loop import closed_loop, collecting, NAMES, send, START
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import pytest
from robot_dynamics.model import arm_from_parameters, ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.ros.dynamics.parameters import effort_rates, torque_rates
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robot_dynamics_interfaces.msg import DynamicsTerms
from ros_harness import DYNAMICS, KEEP_MANY, LONG, NodeProcess, running, SIMULATED_ARM, UNHURRIED
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics
from std_msgs.msg import Float64MultiArray

STIFFNESS, DAMPING = [240.0, 31.0], [20.0, 3.0]
DRIVES = {'joints': NAMES, 'drive.stiffness': STIFFNESS, 'drive.damping': DAMPING}
BODY = default_dynamics().rigid_body


def stamp_of(message: JointState) -> int:
    return stamp_from_ros(message.header.stamp)


def test_the_drives_hold_and_move_the_arm_without_sag(client):
    """Gravity alone would be an error of 140 and 370 mrad; the feed-forward leaves 2 mrad."""
    namespace = '/drives'
    with collecting(
            client, namespace, 'joint_states', 'dynamics/feed_forward') as (states, commands), \
            closed_loop(namespace, **DRIVES):
        states.wait_count(200)
        assert states.messages[-1].position == pytest.approx(START, abs=1e-6)
        held = commands.wait_for(lambda m: stamp_of(m) >= 100_000_000)
        assert list(held.name) == NAMES
        assert held.effort == pytest.approx(BODY.gravity(np.array(START)), rel=1e-6)
        goal = [START[0] - 0.4, START[1] + 0.4]
        send(client, namespace, (2.0, goal))
        states.wait_for(lambda m: np.abs(np.array(m.position) - goal).max() < 2e-3 and (
            np.abs(m.velocity).max() < 1e-3), LONG)
        reference = {stamp_of(m): m for m in commands.messages}
        errors = [np.subtract(reference[stamp_of(m)].position, m.position)
                  for m in states.messages if stamp_of(m) in reference]
    assert np.abs(errors).max() < 2e-3
    moving = [m for m in commands.messages if np.abs(np.subtract(m.position, goal)).min() > 0.1
              and np.abs(np.subtract(m.position, START)).min() > 0.1]
    assert len(moving) > 20
    assert all(all(m.velocity) for m in moving)  # 0 would let the drives brake the arm


def test_drives_without_a_torque_input_take_the_offset(client):
    """A message without efforts: the position error of the drive is the effort over k_p."""
    arm = NodeProcess(
        SIMULATED_ARM, {'rate': 250.0, 'lock_step': True, 'initial_position': START, **DRIVES},
        namespace='/offset', remaps={'dynamics/feed_forward': 'dynamics/position_offset'})
    node = NodeProcess(
        DYNAMICS, {'joints': NAMES, 'drive.stiffness': STIFFNESS, 'lock_step': True},
        namespace='/offset')
    with running(node, arm), collecting(
            client, '/offset', 'joint_states', 'dynamics/position_offset') as (states, commands):
        states.wait_count(500)
        found = commands.wait_for()
        assert states.messages[-1].position == pytest.approx(START, abs=1e-6)
    offset = np.subtract(found.position, START)
    assert offset == pytest.approx(BODY.gravity(np.array(START)) / STIFFNESS, rel=1e-6)
    assert not len(found.effort)


def test_no_command_follows_an_invalid_state(client):
    """Only fresh and valid states are answered; without a stiffness there is no offset."""
    with NodeProcess(DYNAMICS, UNHURRIED, namespace='/fresh') as node, \
            client.collect(JointState, '/fresh/dynamics/position_offset') as offsets, \
            client.collect(JointState, '/fresh/dynamics/feed_forward') as commands:
        commands.wait_matched()
        states = client.publisher(JointState, '/fresh/joint_states', 1)
        good = JointState(name=NAMES, position=START, velocity=[0.0, 0.0])
        good.header.stamp = client.node.get_clock().now().to_msg()
        client.answer_to(states, good, commands)
        bad = JointState(name=NAMES, position=[0.1, float('nan')], velocity=[0.0, 0.0])
        bad.header.stamp = client.node.get_clock().now().to_msg()
        node.provoke(lambda: states.publish(bad), 'Dropped a joint state: position of')
        assert all(message.header.stamp == good.header.stamp for message in commands.messages)
        node.wait_for_log('position_offset: drive.stiffness is empty')
        assert not offsets.messages


def test_the_drives_refuse_a_wrong_command(client):
    with NodeProcess(SIMULATED_ARM, DRIVES, namespace='/refusing') as arm:
        commands = client.publisher(JointState, '/refusing/dynamics/feed_forward')
        arm.provoke(
            lambda: commands.publish(JointState(name=NAMES, position=START, effort=[0.0, 0.0])),
            'Rejected an effort: velocity is empty')


# --- efforts in the units of the driver ----------------------------------------------------------

GOAL = [0.2, 1.0]
G = ArmDynamics(load_arm(default_arm_urdf())).gravity(START)
SCALE, OFFSET = [0.7, 1.3], [8.0, -4.0]
SCALED = {
    'joints': NAMES, 'effort.command_scale': SCALE, 'effort.command_offset': OFFSET,
    'effort.report_scale': [*SCALE], 'effort.report_offset': [*OFFSET]}  # no aliases in YAML
NOISE = 0.02
"""Standard deviation of the measured effort [N·m]."""


def test_known_drives_hold_and_move_the_arm_with_efforts_of_the_driver(client):
    with client.collect(Float64MultiArray, '/holds/dynamics/commands') as bare, collecting(
            client, '/holds', 'joint_states', 'effort_command',
            'dynamics/gravity_compensation') as topics:
        states, commands, gravity = topics
        with closed_loop('/holds', SCALED, **SCALED, effort_noise=NOISE):
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
    arm, values = arm_from_parameters(default_arm_urdf(), SCALED), {'effort_rate_limit': rate}
    assert effort_rates(values, arm).tolist() == driver
    assert torque_rates(values, arm) == pytest.approx(np.array(driver) * SCALE)


# --- the status of the drives --------------------------------------------------------------------

def drives(message: Any, namespace: str) -> dict[str, str]:
    """Return the verdicts of a report by joint; empty if it has none."""
    return {value.key: value.value for status in message.status
            if status.name == f'{namespace}/dynamics: drive' for value in status.values}


def test_with_both_declared_the_arm_holds_still_and_the_drives_agree_after_a_motion(client):
    gravity = {'robot_compensates': ['gravity']}
    with client.collect(JointState, '/both/joint_states') as states, \
            client.collect(JointState, '/both/effort_command') as commands, \
            client.collect(DynamicsTerms, '/both/dynamics/terms') as all_terms, \
            client.collect(DiagnosticArray, '/diagnostics') as diagnostics, \
            closed_loop('/both', gravity, **gravity) as node:
        efforts, terms, held = commands.wait_count(100), all_terms.wait_for(), states.messages
        send(client, '/both', (1.0, [START[0] - 0.6, START[1] + 0.6]))
        diagnostics.wait_for(lambda message: all(
            drives(message, '/both').get(name, '').startswith('agrees; ') for name in NAMES), LONG)
        assert 'Drive of' not in node.log
    assert np.abs([message.effort for message in efforts]).max() < 1e-9
    assert list(terms.gravity) == [0.0, 0.0]
    assert np.abs(np.array([m.position for m in held]) - START).max() < 1e-6


def test_a_self_compensating_robot_is_found_before_the_first_command(client):
    """As in a start with a real robot: command none, while the robot's own controller holds it."""
    with client.collect(DiagnosticArray, '/diagnostics') as diagnostics, \
            closed_loop('/alone', {'command': 'none'}, **{
                'robot_compensates': ['gravity'], 'brakes': False, 'lock_step': False}) as node:
        node.wait_for_log(r'\[WARN\].*Drive of .joint1.: adds gravity; ', LONG)
        report = diagnostics.wait_for(lambda message: any(
            status.name == '/alone/dynamics: drive' and status.level == DiagnosticStatus.WARN
            for status in message.status))
    assert 'set robot_compensates: [gravity]' in drives(report, '/alone')['joint1']
    assert len(re.findall('Drive of .joint1.', node.log)) == 1


def test_without_a_measured_effort_a_robot_that_is_not_commanded_shows_nothing(client):
    arm = {'robot_compensates': ['gravity'], 'brakes': False, 'lock_step': False,
           'measured_effort': 'none'}
    with client.collect(JointState, '/away/joint_states') as states, \
            client.collect(DiagnosticArray, '/diagnostics') as diagnostics, \
            closed_loop(
                '/away', {'command': 'none', 'measured_effort': 'none'}, **arm) as node:
        states.wait_count(200)
        report = diagnostics.wait_for(lambda message: drives(message, '/away'))
    assert all(value.startswith('not observable yet; ') for value in drives(
        report, '/away').values())
    assert 'Drive of' not in node.log


def test_a_wrong_drive_ends_the_command_and_is_named(client):
    with client.collect(DiagnosticArray, '/diagnostics') as diagnostics, \
            client.collect(JointState, '/wrong/joint_states', KEEP_MANY) as states, \
            client.collect(JointState, '/wrong/effort_command', KEEP_MANY) as efforts, \
            closed_loop('/wrong', rate=500.0, real_time_factor=0.25, **{  # few states are late
                'joints': NAMES, 'effort.command_scale': [-1.0, 1.0]}) as node:
        diagnostics.wait_for(  # perhaps with another cause
            lambda message: 'reversed' in drives(message, '/wrong').get('joint1', ''), LONG)
        node.wait_for_log('Drive of .joint1.: .*reversed', LONG)
        report = diagnostics.wait_for(lambda message: any(
            status.name == '/wrong/dynamics: command' and 'wrong_drive' in status.message
            for status in message.status), LONG)
        end = efforts.wait_for(lambda command: command.effort[0] == 0.0, LONG)  # released
        state = states.wait_for(has_stamp(end.header.stamp), LONG)
        assert np.abs(np.subtract(state.position, START)).max() < 0.1
    command = next(s for s in report.status if s.name == '/wrong/dynamics: command')
    assert command.message.startswith("fault wrong_drive: 'joint1': ")
    assert command.message.endswith('waits for ~/reset_fault')
