# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Teach by hand, record, and play back, as docs/hand_guiding.md describes it."""

from pathlib import Path
import subprocess
import sys

from children import run, TIMEOUT
from closed_loop import START
from disturbances import push, ZERO
import numpy as np
import pytest
from robot_dynamics_tools.recordings import Recording
from ros_harness import DYNAMICS, LONG, NodeProcess, running, SIMULATED_ARM, UNHURRIED, wait_until
from sensor_msgs.msg import JointState

EXAMPLE = Path(__file__).resolve().parents[3] / 'docs' / 'examples' / 'play_back.py'
RECORD = [sys.executable, '-m', 'robot_dynamics_tools.ros2_dynamics', 'record', 'joint_states']


@pytest.mark.soak
def test_a_taught_motion_is_played_back(client, tmp_path):
    nodes = running(
        NodeProcess(DYNAMICS, {**UNHURRIED, 'command': 'hand_guiding'}),
        NodeProcess(SIMULATED_ARM, {'rate': 250.0, 'initial_position': START}))
    with client.collect(JointState, '/joint_states') as states, nodes:
        states.wait_count(100)
        bag = tmp_path / 'taught'
        count = client.node.count_subscribers('/joint_states')
        recorder = subprocess.Popen([*RECORD, '--output', str(bag), '--duration', '6'])
        wait_until(lambda: bag.exists() and client.node.count_subscribers('/joint_states') > count,
                   'the recording', LONG)
        push(client, '/simulated_arm', (0.0, 0.0, 3.0))
        wait_until(lambda: np.abs(np.subtract(states.messages[-1].position, START)).max() > 0.3,
                   'a motion', LONG)
        push(client, '/simulated_arm', ZERO)
        assert recorder.wait(TIMEOUT) == 0
        last = states.messages[-1].position
        client.set_parameters('/dynamics', {'command': 'computed_torque'})
        begin = len(states.messages)
        done = run([sys.executable, str(EXAMPLE), str(bag)], stdout=subprocess.PIPE,
                   stderr=subprocess.STDOUT, text=True, timeout=TIMEOUT)
        assert done.returncode == 0, done.stdout
        wait_until(lambda: np.abs(np.subtract(states.messages[-1].position, last)).max() < 0.02,
                   'the last position', LONG)
        played = np.array([m.position for m in states.messages[begin:]])
        with Recording(bag) as recording:  # which may begin after the motion
            taught = recording.joint_series(recording.joint_state_topic()).position
        assert taught is not None
        assert np.abs(taught[-1] - taught[0]).max() > 0.05
        assert np.abs(played - taught[0]).max(axis=1).min() < 0.02
