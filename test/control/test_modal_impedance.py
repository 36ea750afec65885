# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What both impedances, of the joints and of a frame, have in common."""

from lock_step_loop import directions, LockStep, smooth_arm
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import LoopAnswer

LARGEST_ERROR = {'joint_impedance': (3e-3, 1e-4), 'cartesian_impedance': (5e-3, 1e-3)}
"""[rad] along a motion, and at its end."""
commands = pytest.mark.parametrize('command', LARGEST_ERROR)


@commands
def test_a_motion_has_no_error(command):
    """M q̈_ref accelerates the arm, so that the spring has nothing to do; states at 1 kHz."""
    one, (along, at_end) = LockStep(
        smooth_arm('panda'), rate=1000.0, command=command), LARGEST_ERROR[command]
    one.run(0.5)
    goal = one.q + 0.3
    one.follow(goal, 2.0)
    for _ in range(4):
        one.run(0.25)
        assert one.q == pytest.approx(one.loop.reference.position, abs=along)
    one.run(2.0)
    assert one.q == pytest.approx(goal, abs=at_end)


@pytest.mark.parametrize(('name', 'largest', 'delay'), [('ur5', 5.5e-3, 8), ('ur10', 3e-3, 0)])
def test_slow_states_follow_a_stream_of_set_points(name, largest, delay):
    """Set-points each 20 ms change the acceleration of the reference between two states."""
    one, errors = LockStep(
        smooth_arm(name), rate=30.0, delay=delay, command='cartesian_impedance'), []
    one.run(1.0)
    start, answer = one.q.copy(), one.loop.answer

    def measuring(stamp_ns: int, q: FloatArray, v: FloatArray) -> LoopAnswer:
        found = answer(stamp_ns, q, v)
        errors.append(one.loop.reference.position - q)
        return found

    one.loop.answer = measuring  # type: ignore[method-assign, assignment]
    for x in np.minimum(np.arange(1, 81) / 30, 1.0):
        s = x - np.sin(2.0 * np.pi * x) / (2.0 * np.pi)
        one.follow(start + 0.1 * s * directions(len(start)))
        one.run(0.02)
    assert start + 0.1 * directions(len(start)) == pytest.approx(one.q, abs=1e-3)
    assert np.abs(errors).max() < largest
