# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Start and end of the effort commands: the supervisor of the command, event by event."""

from typing import Any

import numpy as np
import pytest
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.fault_action import SafetyOptions
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import CommandSupervisor, Mode
from supervised import (
    answer,
    course,
    HOLD,
    HOLD_TIME,
    LATCHED,
    limits,
    OTHER_HOLD,
    PERIOD,
    PUSH,
    RAMP_TIME,
    RATE,
    RELEASE,
    RELEASE_NOW,
    running,
    SILENT,
    START,
    TROUBLE,
)

# --- the course of a fault -----------------------------------------------------------------------

def test_a_fault_is_replaced_by_a_stricter_one_or_another_one_to_reset():
    one = running()
    easy, hard = Fault('easy', 'words'), Fault('hard', 'words', recovery=5)
    other = Fault('other', 'words', latched=True)
    for n, (fault, in_force) in enumerate([
            (easy, easy), (hard, hard), (easy, hard), (LATCHED, LATCHED), (hard, LATCHED),
            (other, other)]):
        one.end(START + 0.1 * n, Ending.by(fault))
        assert one.fault == in_force, n
    assert one.fault_count == 4
    t, _ = course(one, START + 0.5)  # the action began with the first fault
    assert t[-1] == pytest.approx(HOLD_TIME + RAMP_TIME - 0.5, abs=1.5 * PERIOD)


# --- latched -------------------------------------------------------------------------------------

@pytest.mark.parametrize(('fault', 'words'), [
    (LATCHED, 'broken persists: something is wrong'),
    (TROUBLE, 'ends automatically after 1 valid joint states')])
def test_a_reset_fails_while_the_cause_persists_or_without_a_latched_fault(fault, words):
    one = running()
    one.end(START, Ending.by(fault))
    done, message = one.reset()
    assert not done
    assert words in message
    answer(one, START + 0.01)
    assert one.reset()[0] == fault.latched


def test_valid_states_count_from_the_reset_on():
    one = running()
    one.end(START, Ending.by(Fault('broken', 'words', latched=True, recovery=3)))
    modes = []
    for k in range(1, 9):
        if k == 6:
            assert one.reset()[0]
        answer(one, START + k * PERIOD)
        modes.append(one.mode)
    assert modes == [*7 * [Mode.FAULT], Mode.RUNNING]


# --- valid states in a fault ---------------------------------------------------------------------

@pytest.mark.parametrize('action', ['hold_gravity_then_ramp', 'stop_publishing'])
def test_while_states_are_valid_a_fault_holds_the_arm_indefinitely(action):
    one = running(PUSH, fault_action=action)
    for k in range(1, 1001):
        effort = answer(one, START + k * PERIOD, PUSH, q=(0.0, 1.2))
        assert effort is not None
        assert one.tick(START + (k + 0.5) * PERIOD) is not None
    assert one.mode is Mode.FAULT
    assert effort == pytest.approx(HOLD)


# --- deactivation --------------------------------------------------------------------------------

def test_deactivation_ramps_to_zero_for_a_receiver_that_keeps_the_last_effort():
    one = running(end_action='ramp_to_zero')
    one.end(START + 0.04, RELEASE_NOW)  # the ramp starts at this time, not at the last effort
    assert one.mode is Mode.STOPPING
    one.end(START + 0.2, RELEASE_NOW)  # a second request does not restart the ramp
    t, efforts = course(one, START + 0.04)
    assert efforts[:-1] == pytest.approx(np.outer(1.0 - t[:-1] / RAMP_TIME, HOLD))
    assert efforts[-1].tolist() == [0.0, 0.0]
    assert t[-1] == pytest.approx(RAMP_TIME, abs=1.5 * PERIOD)
    assert one.mode is Mode.INACTIVE
    assert [answer(one, START + 1.0, PUSH), one.tick(START + 1.1)] == SILENT


@pytest.mark.parametrize(('rate', 'ramp_time', 'expected'), [
    (RATE, 0.5, 0.5), (RATE, 0.0, 0.05), (10.0, 0.5, 5.0)])
def test_the_time_to_stop_is_reported(rate, ramp_time, expected):
    one = running(rate=rate, ramp_time=ramp_time, end_action='ramp_to_zero')
    assert one.time_to_stop == 2.5 + expected
    one.end(START, RELEASE_NOW)
    t, _ = course(one)
    assert t[-1] == pytest.approx(expected, abs=2 * PERIOD)
    assert one.time_to_stop == 2.5 + ramp_time  # the effort is zero already


# --- another model, other options ----------------------------------------------------------------

def test_options_that_change_act_at_once():
    one = running()
    one.set_options(limits(), SafetyOptions(state_timeout=0.2))
    assert one.tick(START + 0.15) is None
    assert one.mode is Mode.RUNNING
    one.end(START + 0.15, Ending.by(TROUBLE))
    assert one.tick(START + 0.2) is not None
    one.set_options(limits(), SafetyOptions(fault_action='stop_publishing'))
    assert one.tick(START + 0.21) is None
    assert not one.acts_alone


# --- faults that recur ---------------------------------------------------------------------------

@pytest.mark.parametrize(('names', 'gap', 'recurs', 'is_followed'), [
    (('overspeed', 'following_error', 'overspeed'), 4.9, True, True),
    (('overspeed', 'overspeed', 'overspeed'), 5.1, False, False),
    (('overspeed', 'following_error'), 0.1, False, False),
    (('trouble', 'trouble', 'trouble'), 0.1, False, False),
    (('overspeed', 'trouble', 'overspeed', 'overspeed'), 0.1, True, False),
])
def test_three_faults_of_the_motion_within_ten_seconds_wait_for_a_reset(
    names, gap, recurs, is_followed,
):
    one, now = running(), START
    for name in names:
        now = fails(one, now + gap, name)
    if not recurs:
        assert one.standing_fault is None
        assert one.reset()[0] is False
        return
    assert str(one.standing_fault) == (
        f'fault {names[-1]}: words; 3 faults of the motion within 10 s; waits for ~/reset_fault')
    if is_followed:  # by another fault
        one.end(now + 0.1, Ending.by(TROUBLE))
        assert one.standing_fault is TROUBLE
        answer(one, now + 0.2)
        assert one.standing_fault is not None
    assert one.reset() == (True, f'reset {names[-1]}: words; 3 faults of the motion within 10 s')
    assert one.standing_fault is None
    fails(one, now + 0.3, 'overspeed')
    assert one.standing_fault is None


def fails(one: CommandSupervisor, now: float, name: str) -> float:
    """End a reference by a fault; return the time when it has ended and the arm is held."""
    fault = Fault(name, 'words')
    one.last_state = now
    one.end(now, Ending.by(fault))
    one.recurring.count(fault, now)
    answer(one, now + PERIOD)
    assert one.mode is Mode.RUNNING
    return now


@pytest.mark.parametrize(('moment', 'dt'), [(0.02, None), (0.3, 30.0), (1.2, 0.002), (1.49, None)])
def test_efforts_resume_without_a_jump(moment, dt):
    """For any time between stamps of states: efforts were published since the last state."""
    one = running(PUSH)
    one.end(START, Ending.by(TROUBLE))
    last = PUSH
    for k in range(round(moment / PERIOD)):
        effort = one.tick(START + k * PERIOD)
        assert effort is not None
        last = effort
    back = answer(one, START + moment, PUSH, dt=dt)
    assert one.mode is Mode.RUNNING
    assert np.abs(back - last).max() <= RATE * PERIOD + 1e-9
    assert np.abs(answer(one, START + moment + PERIOD, PUSH, dt=PERIOD) - np.array(back)).max() > 0


@pytest.mark.parametrize('reset_while_inactive', [False, True])
def test_a_latched_fault_outlives_deactivation(reset_while_inactive):
    one = running()
    one.end(START, Ending.by(LATCHED))
    course(one)
    one.end(START + 2.0, RELEASE_NOW)
    assert one.mode is Mode.INACTIVE
    if reset_while_inactive:
        one.reset()
        assert one.mode is Mode.INACTIVE
    one.activate()
    if not reset_while_inactive:
        assert one.mode is Mode.FAULT
        assert answer(one, START + 2.1) is None
        one.reset()
    assert answer(one, START + 2.2, PUSH) == HOLD.tolist()


# --- each fault action, from the first to the last effort ----------------------------------------

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
    begin = state + 0.05  # state_timeout
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


def braking(**options: Any) -> CommandSupervisor:
    one = running(PUSH, end_action='ramp_to_zero', **options)
    one.end(START, RELEASE)
    assert one.mode is Mode.BRAKING
    assert one.is_commanding
    return one


@pytest.mark.parametrize(('state_timeout', 'longest'), [(0.0625, 0.0625), (60.0, 2.5)])
def test_without_states_a_stop_ends_with_the_ramp(state_timeout, longest):
    """After 2.5 s also if states may take long. Numbers are exact in binary."""
    one = braking(state_timeout=state_timeout)
    assert one.deadline == START + longest
    assert one.tick(START + longest) is None
    assert one.tick(START + longest + 0.001) is not None
    assert one.mode is Mode.STOPPING
    assert one.fault is None
    one = running(end_action='ramp_to_zero', state_timeout=state_timeout)
    one.end(START + state_timeout + 0.001, RELEASE)
    assert one.mode is Mode.STOPPING


@pytest.mark.parametrize('before', [True, False])
def test_a_fault_before_or_during_the_stop_holds_and_damps_the_arm(before):
    one = running(PUSH)
    endings = [Ending.by(TROUBLE), RELEASE]
    for ending in endings if before else endings[::-1]:
        one.end(START, ending)
    assert one.mode is Mode.BRAKING
    assert one.fault == TROUBLE
    assert one.fault_count == 1
    damped = HOLD + [2.0, -3.0]
    for k in range(1, 200):  # good states do not end the hold
        effort = one.answer(
            START + k * PERIOD, np.zeros(2), np.ones(2), PUSH, HOLD.copy, PERIOD,
            lambda *_: damped)
        assert one.damping == (pytest.approx(effort - HOLD), pytest.approx([2.0, -3.0]))
    assert effort == pytest.approx(damped)
    one.end(START + 0.4, Ending.by(TROUBLE))
    assert one.fault_count == 1
    one.resume()
    assert one.mode is Mode.FAULT
    assert answer(one, START + 0.402, PUSH) is not None
    assert one.mode is Mode.RUNNING
