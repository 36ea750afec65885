# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Missing efforts: the running simulated arm stands on its brakes until efforts resume."""

from closed_loop import NAMES, START
import numpy as np
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from ros_harness import LONG, NodeProcess, SIMULATED_ARM, wait_until
from sensor_msgs.msg import JointState

ARM = {'rate': 100.0, 'initial_position': START, 'joints': NAMES, 'gravity': [0.0, 0.0, 0.0],
       'friction.viscous': [10.0]}
"""Friction alone resists, so that a constant effort moves it on and on."""


def test_the_arm_stops_when_efforts_end_and_logs_the_timeout(client):
    with NodeProcess(SIMULATED_ARM, ARM, namespace='/silence') as node, \
            client.collect(JointState, '/silence/joint_states') as states:
        efforts = client.publisher(JointState, '/silence/effort_command', 1)
        client.ask(efforts, JointState(name=NAMES, effort=[10.0, -5.0]), states,
                   lambda state: np.abs(state.velocity).max() > 0.1, LONG)
        line = node.wait_for_log(
            r'\[WARN\].*No valid effort for ([\d.]+) s \(command_timeout\), since the joint state '
            r'of [\d.]+ s: the brakes hold the arm where it is, until the next effort arrives')
        states.clear()

        def stands() -> bool:
            last = states.messages[-50:]
            return len(last) == 50 and not any(any(m.velocity) for m in last) and (
                len({tuple(m.position) for m in last}) == 1)

        wait_until(stands, '50 states at rest', LONG)
        standing = states.messages[-1]
    assert list(standing.position) != START
    assert list(standing.effort) == [0.0, 0.0]
    silence, since = (float(word) for word in line.split() if word.replace('.', '').isdigit())
    assert silence >= 0.2
    assert 1e-9 * stamp_from_ros(standing.header.stamp) >= since + silence
