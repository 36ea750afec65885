# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The check that a measured state can follow the previous one: distances, source, resets."""


from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.monitoring.state_plausibility import StateVerdict
from watched_states import LIMIT, PERIOD, Q, started, Watched

LONGEST_GAP = 30.0  # [s] without a state, after which any state is a first one
CONFIRMATIONS = 5  # states that must follow one that does not follow the old ones

# --- accepted states -----------------------------------------------------------------------------

@settings(max_examples=50)
@given(st.lists(st.floats(0.0005, 0.02), min_size=1, max_size=30), st.floats(0.0, 0.99))
def test_states_that_move_as_fast_as_they_may_follow_each_other(steps, fraction):
    one, t, q = started(crowd=True), 0.0, Q.copy()
    for dt in steps:
        t, q = t + dt, q + fraction * 1.5 * LIMIT * dt
        judgement = one.judge(t, q=q)
        assert judgement.is_new
        assert judgement.dt == pytest.approx(dt, abs=2e-9)
        assert not judgement.restart


def test_a_repeated_stamp_is_no_new_state_for_any_content():
    one = started()
    for q in (Q, Q + 1.0):
        assert one.judge(0.0, 0.01, q) == StateVerdict(False)
    assert one.judge(PERIOD, q=Q).dt == pytest.approx(PERIOD)


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize(('dt', 'v', 'longest'), [
    (0.01, None, 0.05 + 1.5 * 2.0 * 0.01),  # 50 mrad, and 1.5 times the velocity limit
    (0.5, None, 0.05 + 1.5 * 2.0 * 0.5),
    (0.01, [0.0, 0.0], 0.05 + 1.5 * 2.0 * 0.01),
    (0.01, [-30.0, 0.0], 0.05 + 1.5 * 30.0 * 0.01),  # at a reported speed above the limit
])
def test_a_way_longer_than_the_speed_allows_is_a_jump(sign, dt, v, longest):
    for factor, jumps in ((0.999, False), (1.001, True)):
        one = started()
        judgement = one.judge(dt, q=Q + [sign * factor * longest, 0.0], v=v)
        assert judgement.is_new
        assert judgement.restart == ('jump' if jumps else '')
        assert judgement.dt == pytest.approx(dt)


def test_a_joint_without_a_velocity_limit_never_jumps():
    one = started(limit=np.full(2, np.inf), crowd=True)
    assert not one.judge(PERIOD, q=Q + 1e6).restart


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize(('speed', 'restart'), [(1.7e308, ''), (-1e200, 'jump')])
def test_beyond_all_speeds_nothing_overflows(speed, restart):
    watched = Watched()
    first = watched.judge(0.0, q=[1.7e308, -1.7e308], v=[speed, 0.0])
    assert first == StateVerdict(True, None, 'first state')
    second = watched.judge(0.5, q=[-1.7e308, 1.7e308], v=[speed, speed])
    assert second == StateVerdict(True, 0.5, restart)


@pytest.mark.parametrize('turns', [-3, -1, 1, 7])
def test_a_whole_turn_is_no_way_for_a_joint_without_an_end(turns):
    one = started()
    assert not one.judge(PERIOD, q=Q + [0.0, 2.0 * np.pi * turns + 0.05]).restart
    assert one.judge(2 * PERIOD, q=Q + [0.0, 2.0 * np.pi * turns + 1.0]).restart == 'jump'
    assert started().judge(PERIOD, q=Q + [2.0 * np.pi * turns, 0.0]).restart == 'jump'


# --- rejected states -----------------------------------------------------------------------------

@pytest.mark.parametrize(('stamp', 'q', 'reason'), [
    (-0.1, Q, 'stamp went back'), (PERIOD, Q + [1.0, 0.0], 'jump')])
def test_publishers_that_contradict_each_other_are_a_conflict(stamp, q, reason):
    one = started(crowd=True)
    error = one.refusal(stamp, PERIOD, q)
    assert error.reason == reason
    assert not error.is_conflict  # possibly a restart
    assert str(error).endswith('; there are several publishers of joint_states')
    judgement = one.judge(0.01, q=Q)
    assert not judgement.restart
    assert judgement.dt == pytest.approx(0.01)
    for k in range(3 * CONFIRMATIONS):  # from then on no state resets the time
        assert one.refusal(-0.1 + k * PERIOD, 0.01 + k * PERIOD).is_conflict


@pytest.mark.parametrize('clock_steps', [-5.0, 5.0])
def test_an_idle_publisher_is_no_conflict(clock_steps):
    """A robot whose clock is set: after several successive states the time is reset."""
    one = Watched(max_age=0.0, crowd=True)
    one.judge(0.0)
    for k in range(1, CONFIRMATIONS + 1):
        error = one.refusal(clock_steps + k * PERIOD, k * PERIOD)
        assert not error.is_conflict
    k = CONFIRMATIONS + 1
    judgement = one.judge(clock_steps + k * PERIOD, k * PERIOD)
    assert judgement.restart == ('stamp jumped ahead' if clock_steps > 0.0 else 'stamp went back')
    assert one.judge(clock_steps + (k + 1) * PERIOD, (k + 1) * PERIOD) == StateVerdict(
        True, pytest.approx(PERIOD))
    error = one.refusal(clock_steps + k * PERIOD, (k + 2) * PERIOD)
    assert not error.is_conflict  # the other publisher has ended


@pytest.mark.parametrize(('good_states', 'is_conflict'), [
    (99, True), (100, False)])
def test_a_contradiction_is_over_after_a_hundred_good_states(good_states, is_conflict):
    one = started(crowd=True)
    one.refusal(-0.1, PERIOD)
    for k in range(1, good_states + 1):
        assert one.judge(k * PERIOD).is_new
    now = (good_states + 1) * PERIOD
    error = one.refusal(now - 0.1, now)
    assert error.reason == 'stamp went back'
    assert error.is_conflict == is_conflict
    later = [now + k * PERIOD for k in range(1, CONFIRMATIONS)]
    assert all(one.refusal(t - 0.1, t).is_conflict == is_conflict for t in later)
    last = now + CONFIRMATIONS * PERIOD
    if is_conflict:  # no number of states restarts time
        one.refusal(last - 0.1, last)
    else:
        assert one.judge(last - 0.1, last).restart == 'stamp went back'


@pytest.mark.parametrize('place', [
    lambda k: (PERIOD * k, Q + [1.0 + (k % 2), 0.0]),  # positions that do not follow each other
    lambda k: (PERIOD * (100 - k), Q + [1.0, 0.0]),  # stamps that go back
    lambda k: (PERIOD, Q + [1.0, 0.0])])  # one state, received again and again
def test_states_that_do_not_follow_each_other_are_not_confirmed(place):
    one = started(crowd=True)
    for k in range(1, 4 * CONFIRMATIONS):
        stamp, q = place(k)
        assert one.refusal(stamp, k * PERIOD, q).reason == 'jump'


def test_the_joint_that_jumped_is_named():
    one = started(crowd=True)
    assert "position of 'wrist' is 0.6, 1 away from that of 0.002 s before" in str(
        one.refusal(PERIOD, q=Q + [0.0, 1.0]))


# --- resets --------------------------------------------------------------------------------------

@pytest.mark.parametrize('crowd', [True, False])
def test_after_a_long_pause_any_state_is_a_first_state(crowd):
    one = started(crowd=crowd)
    assert one.judge(LONGEST_GAP + 0.1, q=Q + 1.0) == StateVerdict(True, None, 'first state')
    assert started().judge(LONGEST_GAP - 0.1).dt == pytest.approx(LONGEST_GAP - 0.1)


def test_refused_states_do_not_keep_the_memory_alive():
    """The accepted publisher has stopped: after some time the other one is accepted."""
    one = started()
    for k in range(1, 30):
        assert one.refusal(-100.0 + k, float(k)).reason == 'too old'
    one.watch.max_age = 0.0
    assert one.judge(-69.5, 30.5) == StateVerdict(True, None, 'first state')


@settings(max_examples=50)
@given(st.floats(-1e5, 1e5))
def test_a_clock_that_is_set_with_the_stamps_resets_or_continues(jump):
    """The jump of the clock never causes a rejection, nor a step back in time."""
    assume(abs(jump) > 1e-3)
    one = started(crowd=True)
    judgement = one.judge(jump + PERIOD)
    assert judgement.is_new
    if 0.0 < jump < LONGEST_GAP - PERIOD:
        assert judgement.dt == pytest.approx(jump + PERIOD, abs=2e-9)
    else:
        assert judgement == StateVerdict(True, None, 'first state')


def test_stamps_far_ahead_reset_the_time():
    one = Watched(max_age=0.0)
    one.judge(0.0)
    assert one.judge(LONGEST_GAP + 1.0, 0.01) == StateVerdict(True, None, 'stamp jumped ahead')
