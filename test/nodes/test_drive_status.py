# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Real nodes: the status `drive` of `dynamics`, for drives that are right and for wrong ones."""

import re
from typing import Any

from bounded_waits import has_stamp
from closed_loop import closed_loop, NAMES, send, START
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import pytest
from robot_dynamics_interfaces.msg import DynamicsTerms
from ros_harness import KEEP_MANY, LONG
from sensor_msgs.msg import JointState


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


@pytest.mark.parametrize(('scale', 'word'), [
    ([-1.0, 1.0], 'reversed'), ([0.25, 1.0], 'command scale 0.')])
def test_a_wrong_drive_ends_the_command_and_is_named(client, scale, word):
    with client.collect(DiagnosticArray, '/diagnostics') as diagnostics, \
            client.collect(JointState, '/wrong/joint_states', KEEP_MANY) as states, \
            client.collect(JointState, '/wrong/effort_command', KEEP_MANY) as efforts, \
            closed_loop('/wrong', rate=500.0, real_time_factor=0.25, **{  # few states are late
                'joints': NAMES, 'effort.command_scale': scale}) as node:
        diagnostics.wait_for(  # perhaps with another cause
            lambda message: word in drives(message, '/wrong').get('joint1', ''), LONG)
        node.wait_for_log(f'Drive of .joint1.: .*{word}', LONG)
        report = diagnostics.wait_for(lambda message: any(
            status.name == '/wrong/dynamics: command' and 'wrong_drive' in status.message
            for status in message.status), LONG)
        if word == 'reversed':  # its joint is released
            end = efforts.wait_for(lambda command: command.effort[0] == 0.0, LONG)
            state = states.wait_for(has_stamp(end.header.stamp), LONG)
            assert np.abs(np.subtract(state.position, START)).max() < 0.1
    command = next(s for s in report.status if s.name == '/wrong/dynamics: command')
    assert command.message.startswith("fault wrong_drive: 'joint1': ")
    assert command.message.endswith('waits for ~/reset_fault')
