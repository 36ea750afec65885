# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Real nodes: gravity compensation, declared correctly or not, and the logs of `dynamics`."""

import re
from typing import Any

from closed_loop import closed_loop, NAMES, START
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import pytest
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_interfaces.msg import DynamicsTerms
from ros_harness import (
    LONG,
    wait_until,
)
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics

G = default_dynamics().rigid_body.gravity(np.array(START))
SLOW = {'real_time_factor': 3.0}
PASSED, WARNED = 'Effort check passed: ', r'\[WARN\].*Effort check: '


def numbers(line: str) -> tuple[float, dict[str, list[float]]]:
    """Return k, and the measured effort, command and g(q) of each joint."""
    k = re.search(r'exceeds the command by (-?[\d.]+) times', line)
    assert k is not None, line
    return float(k[1]), {
        name: [float(number) for number in rest] for name, *rest in re.findall(
            r'(joint\d): measured (\S+), command (\S+), g\(q\) (-?\d+\.\d+)', line)}


def checks(message: Any, namespace: str) -> list[DiagnosticStatus]:
    """Return the statuses of the check that a report has."""
    return [s for s in message.status if s.name == f'{namespace}/dynamics: effort check']


# --- correct declarations ------------------------------------------------------------------------

def test_with_both_declared_the_arm_holds_still_without_a_command(client):
    """A new model is checked again."""
    gravity = {'robot_compensates': ['gravity']}
    other = default_arm_urdf().replace('name="planar_arm"', 'name="other_arm"')
    with client.collect(JointState, '/both/joint_states') as states, \
            client.collect(JointState, '/both/effort_command') as commands, \
            client.collect(DynamicsTerms, '/both/dynamics/terms') as all_terms, \
            client.describing('/both') as publish, \
            closed_loop('/both', gravity, **SLOW, **gravity) as node:
        line = node.wait_for_log(PASSED, LONG)
        efforts, terms, held = commands.wait_count(200), all_terms.wait_for(), states.messages
        assert len(re.findall(PASSED, node.log)) == 1  # there is one verdict per model
        publish(other)
        node.wait_for_log("Model 'other_arm'", LONG)
        wait_until(lambda: len(re.findall(PASSED, node.log)) == 2, 'another verdict', LONG)
    assert numbers(line)[0] == pytest.approx(1.0, abs=0.01)
    assert np.abs([message.effort for message in efforts]).max() < 1e-9
    assert list(terms.gravity) == [0.0, 0.0]
    assert np.abs(np.array([m.position for m in held]) - START).max() < 1e-6
    assert held[-1].effort == pytest.approx(G, abs=1e-3)


# --- wrong declarations --------------------------------------------------------------------------

def test_a_self_compensating_robot_is_found_before_the_first_command(client):
    """As in a start with a real robot: command none, while the robot's own controller holds it."""
    with client.collect(DiagnosticArray, '/diagnostics') as diagnostics, \
            closed_loop('/alone', {'command': 'none'}, **{
                'robot_compensates': ['gravity'], 'brakes': False, 'lock_step': False}) as node:
        line = node.wait_for_log(WARNED, LONG)
        report = diagnostics.wait_for(lambda message: any(
            status.level == DiagnosticStatus.WARN for status in checks(message, '/alone')))
    k, joints = numbers(line)
    assert k == pytest.approx(1.0, abs=0.02)
    for j, name in enumerate(NAMES):
        assert joints[name] == pytest.approx([G[j], 0.0, G[j]], abs=0.05), name
    assert 'set robot_compensates: [gravity]' in line
    status, = checks(report, '/alone')
    values = {value.key: value.value for value in status.values}
    assert float(values['k']) == pytest.approx(1.0, abs=0.01)
    assert values['expected k'] == '0'
    assert len(re.findall(WARNED, node.log)) == 1


# --- no effort, no check -------------------------------------------------------------------------

def test_the_check_can_be_declared_away(client):
    """An arm that compensates its gravity, for which the check would warn."""
    arm = {'robot_compensates': ['gravity'], 'brakes': False, 'lock_step': False,
           'measured_effort': 'none'}
    with client.collect(JointState, '/away/joint_states') as states, \
            client.collect(DiagnosticArray, '/diagnostics') as diagnostics, \
            closed_loop(
                '/away', {'command': 'none', 'measured_effort': 'none'}, **arm) as node:
        states.wait_count(200)
        report = diagnostics.wait_for(lambda message: checks(message, '/away'))
    status, = checks(report, '/away')
    assert status.message == "no measured effort (measured_effort is 'none')"
    assert len(states.messages[-1].effort) == 0
    assert 'Effort check' not in node.log
