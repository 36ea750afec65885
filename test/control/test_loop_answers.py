# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What the answers of the control loop state: limits, faults, times, and reasons."""

from lock_step_loop import FIRST_STAMP, LockStep, MS
from loop_motions import arm_named, in_motion, Q
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import LoopAnswer
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.trajectories.joint_trajectory import make_trajectory


def state(one: LockStep, v: FloatArray | None = None) -> LoopAnswer:
    """Return the answer to the next state at the position of the arm."""
    answer = one.loop.answer(FIRST_STAMP + one.k * MS, one.q, one.v if v is None else v)
    one.k += 2
    return answer


def at_rest() -> LockStep:
    one = LockStep(arm_named('default'), q=Q)
    one.run(0.1)
    assert one.loop.goals.interruption == ''
    return one


def test_an_effort_has_the_names_of_the_limits_that_change_it():
    one = at_rest()
    answer = state(one)
    assert answer.limits == ()
    assert answer.verdict.dt == pytest.approx(0.002)
    one.loop.supervisor.limiter.last = np.array([100.0, -11.0])
    assert state(one).limits == ('effort rate',)


def test_the_pause_of_a_stream_is_measured_by_the_steady_clock():
    one = at_rest()
    names, loop = one.arm.joint_names, one.loop

    def send(k: int) -> None:
        loop.follow(make_trajectory(names, [0.0], [Q + 0.004 * k], [[0.2, 0.2]]))

    stamp = FIRST_STAMP + 100 * MS
    for k in range(1, 11):
        stamp += 20 * MS
        loop.answer(stamp, Q + 0.004 * k, one.v + 0.2, stamp, stamp)
        send(k)
    steady = stamp
    for k in range(10):  # simulated time is slow
        stamp, steady = stamp + MS, steady + 20 * MS
        loop.answer(stamp, Q + 0.04 + 2e-4 * k, one.v + 0.2, stamp, steady)
    assert loop.goals.paused_streams == 1


def test_a_clock_of_the_driver_that_is_set_back_interrupts_the_motion_with_the_sixth_state():
    one = in_motion()
    stamp, h, shift = FIRST_STAMP + one.k * MS, 2 * MS, 100 * MS
    for k in range(1, 6):
        with pytest.raises(ImplausibleStateError, match='it is not used'):
            one.loop.answer(stamp + k * h - shift, one.q, one.v, stamp + k * h, stamp + k * h)
    assert one.loop.goals.interruption == ''
    answer = one.loop.answer(stamp + 6 * h - shift, one.q, one.v, stamp + 6 * h, stamp + 6 * h)
    assert answer.verdict.restart == 'stamp went back'
    assert one.loop.goals.interruption == 'joint states restarted: stamp went back'


def test_a_noisy_velocity_of_an_arm_at_rest_does_not_delay_the_end():
    one, rng = at_rest(), np.random.default_rng(1)
    one.loop.deactivate(one.now)
    for _ in range(125):
        state(one, rng.normal(0.0, 0.03, 2))
    assert one.loop.supervisor.mode is Mode.INACTIVE
