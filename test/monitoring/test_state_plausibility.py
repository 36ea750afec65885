# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The check that a measured state can follow the previous one: distances, source, resets."""

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.monitoring.state_plausibility import StatePlausibility, StateVerdict
from watched_states import CONFIRMATIONS, LIMIT, PERIOD, Q, started, Watched

LONGEST_GAP = 30.0  # [s] without a state, after which any state is a first one

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
@pytest.mark.parametrize(('limit', 'dt', 'longest'), [
    (2.0, 0.01, 0.05 + 1.5 * 2.0 * 0.01),  # 50 mrad, and 1.5 times the velocity limit
    (2.0, 0.5, 0.05 + 1.5 * 2.0 * 0.5),
    (np.inf, 0.01, 0.05 + 1.5 * 20.0 * 0.01)])
def test_a_way_longer_than_the_speed_allows_is_a_jump(sign, limit, dt, longest):
    for crowd in (False, True):
        one, other = (started(limit=np.full(2, limit), crowd=crowd) for _ in range(2))
        assert one.refusal(dt, q=Q + [sign * 1.001 * longest, 0.0]).reason == 'jump'
        assert other.judge(dt, q=Q + [sign * 0.999 * longest, 0.0]) == StateVerdict(
            True, pytest.approx(dt))


@pytest.mark.parametrize('period', [0.001, 0.01, 0.03])
def test_a_place_that_was_too_far_is_not_nearer_because_time_passes(period):
    one, there = started(), Q + [0.05 + 1.5 * 2.0 * 0.03 + 0.01, 0.0]
    for k in range(1, 6):
        assert one.refusal(k * period, q=there).reason == 'jump'
    assert one.judge(6 * period, q=there).restart == 'jump'
    one = started()  # the arm moves on while one sample is elsewhere
    assert one.refusal(period, q=2.0 * Q - there).reason == 'jump'
    assert one.judge(2 * period, q=Q + [2.0 * 2.0 * period, 0.0]).dt == pytest.approx(2 * period)


@pytest.mark.parametrize(('unseen', 'reason'), [(0.2, ''), (0.1, 'jump')])
def test_a_joint_may_have_moved_as_long_as_its_sample_was_missing(unseen, reason):
    one = started()
    one.watch.unseen = np.array([unseen, 0.0])
    q = Q + [0.05 + 1.5 * 2.0 * 0.15, 0.0]
    if reason:
        assert one.refusal(PERIOD, q=q).reason == reason
    else:
        assert not one.judge(PERIOD, q=q).restart
    assert one.refusal(2 * PERIOD, q=Q + [0.0, 0.6]).reason == 'jump'


@pytest.mark.filterwarnings('error')
def test_positions_beyond_all_arms_are_never_used_and_nothing_overflows():
    one = Watched()
    for k in range(20):
        q = np.array([1.1e9, 0.0]) if k % 2 else np.array([1.7e308, -1.7e308])
        assert one.refusal(k * PERIOD, q=q).reason == 'jump'
    assert one.judge(21 * PERIOD).restart == 'first state'


@pytest.mark.parametrize('turns', [-3, -1, 1, 7])
def test_a_whole_turn_is_no_way_for_a_joint_without_an_end(turns):
    one = started()
    assert not one.judge(PERIOD, q=Q + [0.0, 2.0 * np.pi * turns + 0.05]).restart
    assert one.refusal(2 * PERIOD, q=Q + [0.0, 2.0 * np.pi * turns + 1.0]).reason == 'jump'
    assert started().refusal(PERIOD, q=Q + [2.0 * np.pi * turns, 0.0]).reason == 'jump'


# --- rejected states -----------------------------------------------------------------------------

@pytest.mark.parametrize(('stamp', 'q', 'reason'), [
    (-0.1, Q, 'stamp went back'), (PERIOD, Q + [1.0, 0.0], 'jump')])
def test_publishers_that_contradict_each_other_are_a_conflict(stamp, q, reason):
    one = started(crowd=True)
    error = one.refusal(stamp, PERIOD, q)
    assert error.reason == reason
    assert not error.is_conflict  # possibly a restart
    judgement = one.judge(0.01, q=Q)
    assert not judgement.restart
    assert judgement.dt == pytest.approx(0.01)
    for k in range(3 * CONFIRMATIONS):  # from then on no state resets the time
        error = one.refusal(-0.1 + k * PERIOD, 0.01 + k * PERIOD)
        assert error.is_conflict
        assert str(error).endswith('; there are several publishers of joint_states')


@pytest.mark.parametrize('crowd', [False, True])
@pytest.mark.parametrize('clock_steps', [-5.0, 5.0])
def test_an_idle_publisher_is_no_conflict(clock_steps, crowd):
    """A robot whose clock is set: after several successive states the time is reset."""
    one = Watched(max_age=0.0, crowd=crowd)
    one.judge(0.0)
    assert one.confirmed(clock_steps + PERIOD, PERIOD).restart == (
        'stamp jumped ahead' if clock_steps > 0.0 else 'stamp went back')
    k = CONFIRMATIONS + 2
    assert one.judge(clock_steps + k * PERIOD, k * PERIOD) == StateVerdict(
        True, pytest.approx(PERIOD))
    error = one.refusal(clock_steps + PERIOD, (k + 1) * PERIOD)
    assert not error.is_conflict  # the other publisher has ended


@pytest.mark.parametrize(('later', 'q', 'reason'), [
    (-1.0, Q, 'stamp went back'), (5.0, Q, 'stamp jumped ahead'), (0.0, Q + 1.0, 'jump')])
def test_a_single_state_that_cannot_follow_is_missing(later, q, reason):
    """An older message, or a corrupted sample, of the only publisher: the next one continues."""
    one = started(max_age=0.0)
    for k in range(1, 3 * CONFIRMATIONS):
        error = one.refusal(k * PERIOD + later, k * PERIOD, q)
        assert (error.reason, error.is_conflict) == (reason, False)
        assert str(error).endswith('; it is not used')
        assert one.judge(k * PERIOD) == StateVerdict(True, pytest.approx(PERIOD))


@pytest.mark.parametrize(('stamp', 'q', 'reason'), [
    (-1.0, Q, 'stamp went back'), (5.0, Q, 'stamp jumped ahead'), (PERIOD, Q + 1.0, 'jump')])
def test_a_simulation_in_lock_step_restarts_at_once(stamp, q, reason):
    """It waits for the answer to each state: to drop one would stop it."""
    one = started(max_age=0.0)
    one.watch.is_lock_step = True
    assert one.judge(stamp, PERIOD, q) == StateVerdict(True, None, reason)
    assert not one.judge(stamp + PERIOD, 2 * PERIOD, q).restart


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
    lambda k: (PERIOD * (100 - k), Q + [1.0, 0.0])])  # stamps that go back
@pytest.mark.parametrize('crowd', [False, True])
def test_states_that_do_not_follow_each_other_are_not_confirmed(place, crowd):
    one = started(crowd=crowd)
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


@pytest.mark.parametrize('is_lock_step', [True, False])
def test_a_first_state_of_time_0_that_is_repeated_is_new_only_if_0_may_mean_no_stamp(is_lock_step):
    """In lock-step it is published until it is answered, and must be one state."""
    one = StatePlausibility(('a', 'b'), LIMIT, 0.2, np.zeros(2, dtype=bool))
    one.is_lock_step = is_lock_step
    clock = 1_790_000_000 * 10**9
    verdicts = [one.judge(0, clock + k * 10**7, Q, lambda: False, k * 10**7) for k in range(5)]
    assert [each.is_new for each in verdicts] == [True, *[not is_lock_step] * 4]
    if is_lock_step:
        assert one.judge(2_000_000, clock + 10**8, Q, lambda: False, 10**8).dt == (
            pytest.approx(0.002))
