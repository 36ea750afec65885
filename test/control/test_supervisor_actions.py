# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The course of efforts during each fault action, from the first to the last effort."""

import numpy as np
import pytest
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.supervisor import Mode
from supervised import (
    answer,
    course,
    HOLD,
    HOLD_TIME,
    LATCHED,
    OTHER_HOLD,
    PERIOD,
    PUSH,
    RAMP_TIME,
    RATE,
    RELEASE,
    RELEASE_NOW,
    running,
    START,
    TROUBLE,
)


def toward(last: np.ndarray, goal: np.ndarray, dt: float) -> np.ndarray:
    """Return the effort dt [s] after the last one; all joints change in proportion."""
    longest = np.abs(goal - last).max() / RATE
    return np.asarray(goal if longest <= dt else last + dt / longest * (goal - last))


@pytest.mark.parametrize('is_fault', [True, False])
def test_a_stop_that_has_failed_ends_with_the_end_action(is_fault):
    """An arm that is lost in the stop before the end is not held for the rest of its time."""
    one = running(HOLD, end_action='ramp_to_zero')
    if is_fault:
        one.end(START, Ending.by(TROUBLE))
    one.end(START, RELEASE)
    assert one.mode is Mode.BRAKING
    one.end(START + 0.1, Ending.by(TROUBLE, Kind.RELEASE_NOW))
    assert one.mode is Mode.STOPPING
    half = one.tick(START + 0.1 + 0.5 * RAMP_TIME)
    assert half == pytest.approx(0.5 * HOLD)


def test_the_hold_is_the_gravity_torque_of_the_newest_state():
    one = running()
    one.end(START, Ending.by(LATCHED))
    state = START + 0.1  # the last state
    assert answer(one, state, PUSH, OTHER_HOLD) == OTHER_HOLD.tolist()
    begin = state + one.options.state_timeout
    for moment in (state + 0.01, begin + 0.01, begin + 0.9 * HOLD_TIME):
        effort = one.tick(moment)
        assert effort.tolist() == OTHER_HOLD.tolist()
    fading = one.tick(begin + HOLD_TIME + 0.2 * RAMP_TIME)
    assert fading == pytest.approx(0.8 * OTHER_HOLD)


def test_ramp_to_zero():
    """The gravity torque decreases linearly, the rest at the rate limit; no effort grows."""
    command = HOLD * [1.0, 3.0]
    one = running(command, fault_action='ramp_to_zero')
    one.end(START, Ending.by(TROUBLE))
    t, efforts = course(one)
    line = np.outer(1.0 - t / RAMP_TIME, HOLD)
    line[-1] = 0.0
    effort = command
    for k, goal in enumerate(line):
        effort = toward(effort, goal, PERIOD if k else 0.0)
        assert efforts[k] == pytest.approx(effort, abs=1e-6)
    reached = np.abs(command - HOLD).max() / RATE
    assert efforts[t > reached] == pytest.approx(line[t > reached], abs=1e-6)
    assert efforts[-1].tolist() == [0.0, 0.0]
    assert t[-1] == pytest.approx(RAMP_TIME, abs=1.5 * PERIOD)


@pytest.mark.parametrize('later', [0.0, 0.0078125])
@pytest.mark.parametrize('is_deactivated', [False, True])
def test_a_ramp_never_grows_an_effort(is_deactivated, later):
    """Not if a larger effort would hold the arm, nor if the effort opposed the gravity torque."""
    command = np.array([-5.0, -20.0])
    one = running(command, fault_action='ramp_to_zero', end_action='ramp_to_zero')
    begin = START + later
    if is_deactivated:
        one.end(begin, RELEASE_NOW)
    else:
        one.end(begin, Ending.by(LATCHED))
    _, efforts = course(one, begin)
    sizes = np.abs(np.vstack([command, efforts]))
    assert (np.diff(sizes, axis=0) <= 0.0).all()
    assert sizes[-1].tolist() == [0.0, 0.0]
    assert sizes[len(sizes) // 2][1] == 0.0  # the effort had the sign opposite to gravity's


def test_the_damped_hold_remains_until_the_states_time_out():
    one = running()
    damped = HOLD + [2.0, -3.0]
    one.answer(
        START + 0.01, np.zeros(2), np.ones(2), PUSH, HOLD.copy, 0.01, lambda *_: damped, TROUBLE)
    for after in (0.005, 0.02, 0.04):
        effort = one.tick(START + 0.01 + after)
        assert effort.tolist() == damped.tolist()
    for after in (0.06, 0.5):  # then the velocity is unknown
        effort = one.tick(START + 0.01 + after)
    assert effort.tolist() == HOLD.tolist()
