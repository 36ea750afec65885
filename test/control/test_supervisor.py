# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Start and end of the effort commands: the supervisor of the command, event by event."""

import numpy as np
import pytest
from robot_dynamics.control.safety.ending import Ending
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
    PERIOD,
    PUSH,
    RAMP_TIME,
    RATE,
    RELEASE_NOW,
    running,
    SILENT,
    START,
    TROUBLE,
)


def states(one: CommandSupervisor, last: int, first: int = 1) -> list[Mode]:
    """Pass valid states of these periods after START; return the mode after each."""
    modes = []
    for k in range(first, last + 1):
        answer(one, START + k * PERIOD)
        modes.append(one.mode)
    return modes


# --- timeout of the states -----------------------------------------------------------------------

def test_a_state_within_the_timeout_is_no_fault_and_a_later_one_is():
    """All numbers are exact in binary."""
    for after, mode in ((0.0625, Mode.RUNNING), (0.0627, Mode.FAULT)):
        one = running(state_timeout=0.0625)
        answer(one, START + after)
        assert one.mode is mode


# --- the course of a fault -----------------------------------------------------------------------

def test_a_fault_is_replaced_by_one_with_a_stricter_recovery():
    one = running()
    easy, hard = Fault('easy', 'words'), Fault('hard', 'words', recovery=5)
    for n, (fault, in_force) in enumerate([
            (easy, easy), (hard, hard), (easy, hard), (LATCHED, LATCHED), (hard, LATCHED)]):
        one.end(START + 0.1 * n, Ending.by(fault))
        assert one.fault == in_force, n
    assert one.fault_count == 3
    t, _ = course(one, START + 0.4)  # the action began with the first fault
    assert t[-1] == pytest.approx(HOLD_TIME + RAMP_TIME - 0.4, abs=1.5 * PERIOD)


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
    states(one, 5)
    assert one.reset()[0]
    assert states(one, 8, 6) == [Mode.FAULT, Mode.FAULT, Mode.RUNNING]


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
    assert t[-1] == pytest.approx(one.options.ramp_time, abs=1.5 * PERIOD)
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
