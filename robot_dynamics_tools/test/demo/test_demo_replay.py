# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Replays of recordings by the demo."""

from demo_process import relative_residuals, run_demo
import numpy as np
import pytest
from recordings import KnownMotion, write_recording
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics_tools.recordings.reader import Recording


def motion_with_brakes():
    """Return a motion to a goal and back; brakes hold the arm at the goal for one second."""
    s = np.linspace(0.0, 1.0, 401)[:, None]  # minimum jerk in 4 s
    q, v, a = (10 * s**3 - 15 * s**4 + 6 * s**5, (30 * s**2 - 60 * s**3 + 30 * s**4) / 4.0,
               (60 * s - 180 * s**2 + 120 * s**3) / 16.0)
    held = np.zeros((100, 1))
    motion = KnownMotion(seconds=9.02)
    start, shift = np.array([0.4, 0.1]), np.array([0.8, -0.5])
    motion.q = start + shift * np.concatenate([q, held + 1.0, q[::-1]])
    motion.v = shift * np.concatenate([v, held, -v[::-1]])
    motion.a = shift * np.concatenate([a, held, a[::-1]])
    motion.tau = ArmDynamics(motion.arm).inverse_dynamics_batch(motion.q, motion.v, motion.a)
    motion.tau[len(s):len(s) + len(held)] = 0.0
    return motion


@pytest.mark.soak
def test_brakes_in_a_recording_are_played_and_not_compared(tmp_path):
    """An arm that its brakes hold has no effort, which no model of the arm can explain."""
    motion = motion_with_brakes()
    write_recording(tmp_path / 'bag', motion.messages())
    status, out, err = run_demo(
        tmp_path, '--replay', tmp_path / 'bag', '--no-plot', '--out', 'here')
    assert status == 0, out + err
    assert f'{len(motion.q)} states played' in out
    with Recording(tmp_path / 'here' / 'recording') as recording:
        gravity = recording.joint_series('/dynamics/gravity_compensation')
    assert len(gravity.stamps_ns) == len(motion.q)
    assert 'left out: 100 samples with zero effort, because the brakes' in out
    assert max(relative_residuals(out).values()) < 1.0
