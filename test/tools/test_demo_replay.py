# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Replays of recordings by the demo."""

import os
from pathlib import Path
import re
import signal
import time

from demo_process import nodes_of, relative_residuals, run_demo, start_demo, wait_for_line
import numpy as np
import pytest
from recordings import KnownMotion, write_recording
from robot_dynamics.recordings.reader import Recording
from robot_dynamics.trajectories.files import write_trajectory
from robot_dynamics.trajectories.joint_trajectory import make_trajectory
from robots import robot_path, robot_urdf
from ros_harness import TIMEOUT, wait_until, write_parameters

UR10 = Path(__file__).parents[3] / 'shared' / 'data' / 'ur10'


def test_replay_of_positions_that_wrap(tmp_path):
    """Exact effort of the default arm in a swing about its rest pose, positions within ±π."""
    motion = KnownMotion(seconds=4.0, rest=(np.pi, 0.0))
    write_recording(tmp_path / 'bag', motion.messages(wrapped=True))
    status, out, err = run_demo(
        tmp_path, '--replay', tmp_path / 'bag', '--no-plot', '--out', 'here')
    assert status == 0, out + err
    assert max(relative_residuals(out).values()) < 1.0


def record_brakes(tmp_path, name):
    """Record a demo whose dynamics node hangs for a while; return whether it contains brakes."""
    wall_time = write_parameters(tmp_path / 'wall_time.yaml', {'lock_step': False})
    start, goal = [0.4, 0.1], [0.6, 0.1]
    rest = [0.0, 0.0]
    write_trajectory(tmp_path / 'rests.yaml', make_trajectory(
        ['joint1', 'joint2'], [0.0, 1.0, 12.0], [start, goal, goal], [rest] * 3, [rest] * 3,
        ['joint1', 'joint2']))
    with start_demo(
            tmp_path, '--trajectory', 'rests.yaml', '--parameters', wall_time, '--no-plot',
            '--rate', 100, '--out', name) as process:
        wait_for_line(process.stderr, r' [2-7]\d %')  # at the goal: no motion is interrupted
        log = tmp_path / name / 'simulated_arm.log'
        suspended = nodes_of(process)['dynamics']
        os.kill(suspended, signal.SIGSTOP)
        try:
            wait_until(lambda: 'the brakes hold the arm' in log.read_text(), 'brakes')
            time.sleep(0.3)  # part of the recording has brakes
        finally:
            os.kill(suspended, signal.SIGCONT)
        process.communicate(timeout=4 * TIMEOUT)
    with Recording(tmp_path / name / 'recording') as recording:
        states = recording.joint_series('/joint_states')
    return len(states.driven().stamps_ns) < len(states.stamps_ns)


def test_brakes_in_a_recording_are_played_and_not_compared(tmp_path):
    """A dynamics node that hangs makes the arm brake, which no model of the arm can explain."""
    # On a starved machine the node may hang only after the recorded span, in wall time.
    made = next(name for name in map(str, range(10)) if record_brakes(tmp_path, name))
    status, out, err = run_demo(
        tmp_path, '--replay', tmp_path / made / 'recording', '--no-plot', '--out', 'here')
    assert status == 0, out + err
    assert re.search(r'^  \d+ states without any effort \(brakes\): played', out, re.MULTILINE)
    assert max(relative_residuals(out).values()) < 10.0


def replay_ur10(directory, bag, states):
    """
    Replay a recording of a UR10 with this number of states; check that all are played.

    Return the relative residual of each joint [%].
    """
    status, out, err = run_demo(
        directory, '--replay', bag, '--robot', robot_path('ur10'), '--no-plot', '--out', 'here')
    assert status == 0, out + err
    assert f'{states} states played' in out
    with Recording(directory / 'here' / 'recording') as recording:
        gravity = recording.joint_series('/dynamics/gravity_compensation')
    assert len(gravity.stamps_ns) == states
    relative = [float(fraction) for fraction in re.findall(
        r'^\w+_joint .*?([\d.]+) % ', out, re.MULTILINE)]
    assert len(relative) == 6
    return relative


def test_replay_of_an_arm_with_six_joints(tmp_path):
    """As of the real arm below, with a recording made here: the model has these efforts."""
    motion = KnownMotion(seconds=3.0, rate=125.0, urdf=robot_urdf('ur10'), rest=0.3)
    bag = write_recording(tmp_path / 'made', motion.messages(), 'sqlite3')
    assert max(replay_ur10(tmp_path, bag, 375)) < 10.0


def test_replay_of_a_real_arm(tmp_path):
    if not UR10.exists():
        pytest.skip('the recording of a UR10 is missing: expected shared/data/ur10 next to '
                    'the repository')
    relative = replay_ur10(tmp_path, UR10, 3441)
    # Effects that the description of this robot does not include: friction, and motors.
    assert 32.0 < min(relative) < 34.0
    assert 99.0 < max(relative) <= 101.0
