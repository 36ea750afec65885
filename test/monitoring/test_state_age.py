# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The age of a measured state, by the clock of this computer and by other clocks."""

from typing import Any

import numpy as np
import pytest
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError, StateVerdict
from watched_states import CONFIRMATIONS, nanoseconds, NOW, PERIOD, Q, SECOND, started, Watched

# --- the age of a state --------------------------------------------------------------------------

@pytest.mark.parametrize('is_first', [True, False])
@pytest.mark.parametrize(('age', 'reason'), [
    (0.199, ''), (0.201, 'too old'), (-0.199, ''), (-0.201, 'from the future'),
    (10.0, 'too old'), (-50.0, 'from the future'), (3599.0, 'too old')])
def test_a_state_is_of_now(is_first, age, reason):
    one = (Watched if is_first else started)(crowd=True)
    t = 0.5
    if not reason:
        assert one.judge(t - age, t).is_new
    else:
        error = one.refusal(t - age, t)
        assert error.reason == reason
        assert not error.is_conflict
        assert f'{abs(age):.3f} s {"old" if age > 0 else "in the future"}' in str(error)
        assert str(error).endswith('0.2 s (state_max_age), by the clock of this computer')


def test_a_state_rejected_for_its_age_has_no_side_effect():
    one = started()
    one.refusal(0.1, 0.5, q=Q + 1.0)
    assert one.judge(0.01, q=Q) == StateVerdict(True, 0.01)


def test_the_limit_of_age_may_change_and_0_is_none():
    one = started(max_age=0.0)
    assert one.judge(1.0, 20.0).is_new
    one.watch.max_age = 1.0
    assert one.confirmed(20.01, 20.9).is_new
    one.watch.max_age = 0.1
    assert one.refusal(20.6, 20.91).reason == 'too old'


# --- other clocks --------------------------------------------------------------------------------

@pytest.mark.parametrize('begin', [100.0, 1e9 - 1000.0])
@pytest.mark.parametrize('crowd', [False, True])
def test_simulated_time_has_no_age(begin, crowd):
    """Stamps before 2001, 1e9 s after 1970, are of a simulation, which may pause or be slow."""
    one, stamp, clock = started(offset=begin - NOW / SECOND, crowd=crowd), 0.0, 0.0
    for by_stamp, by_clock in ((0.002, 0.002), (0.002, 20.0), (0.1, 0.0), (0.0, 5.0), (5.0, 25.0)):
        stamp, clock = stamp + by_stamp, clock + by_clock
        assert one.judge(stamp, clock).is_new == (by_stamp > 0.0)


def test_simulated_time_may_run_slowly_but_does_not_jump():
    one = started(offset=-NOW / SECOND + 100.0)
    for k in range(1, 50):
        assert one.judge(k * PERIOD, float(k)).dt == pytest.approx(PERIOD)
    assert one.judge(0.1 + 0.19, 49.001).dt == pytest.approx(0.192)
    assert one.confirmed(5.0, 49.002) == StateVerdict(True, None, 'stamp jumped ahead')


@pytest.mark.parametrize(('max_age', 'largest'), [(0.2, 0.2), (3.0, 3.0), (0.0, 1.0)])
def test_simulated_time_may_run_ahead_of_the_clock_by_the_largest_age(max_age, largest):
    one = started(max_age=max_age, offset=-NOW / SECOND + 100.0)
    assert one.refusal(0.1 + 1.01 * largest, 0.1).reason == 'stamp jumped ahead'
    assert one.judge(0.1 + 0.99 * largest, 0.1).is_new


@pytest.mark.parametrize('offset', [3620.0, -3601.0, 1e8])
def test_the_clock_of_another_computer_keeps_its_offset(offset):
    one = started(offset=offset)
    assert one.judge(1.0, 1.19).is_new
    for age, reason in ((0.21, 'too old'), (10.0, 'too old'), (-0.21, 'from the future')):
        error = one.refusal(2.0 - age, 2.0)
        assert error.reason == reason
        assert str(error).endswith('(state_max_age), by the offset of its clock so far')
    for k in range(1, 1000):  # an oscillator that is 0.05 % fast
        t = 2.0 + 0.5 * k
        assert one.judge(1.0005 * t, t).is_new
    one.watch.has_age = lambda: False
    assert one.judge(1.0005 * t + PERIOD, t + 10.0).is_new


@pytest.mark.parametrize(('offset', 'has_age', 'seen'), [
    (0.0, True, 0.0), (-3000.0, True, 0.0), (-7200.0, True, 7200.0), (7200.0, True, -7200.0),
    (-7200.0, False, 0.0), (100.0 - NOW / SECOND, True, 0.0)])
def test_the_offset_of_another_clock_is_known_as_that_of_a_replayed_recording(
        offset, has_age, seen):
    """That of the same clock is an age, and simulated time has none."""
    one = Watched(max_age=0.0, offset=offset)
    one.watch.has_age = lambda: has_age
    assert one.watch.clock_offset == 0.0
    one.judge(0.0)
    one.judge(PERIOD)
    assert one.watch.clock_offset == seen
    assert one.watch.is_other_clock == (abs(offset) > 3600.0)


def test_the_offset_of_a_clock_is_followed_by_a_thousandth_of_the_time():
    """A clock that is 0.2 % fast is 0.2 s off what is followed after 200 s."""
    one, t = started(offset=1e8), 0.0
    while t < 190.0:
        t += 0.5
        one.judge(1.002 * t, t)
    assert one.refusal(1.002 * 215.0, 215.0).reason == 'from the future'


@pytest.mark.parametrize('clock', [1.0, 1.1])
def test_a_clock_that_is_set_right_gets_its_age(clock):
    """The first stamps are of 1970, as of a computer that has not received the time yet."""
    one = Watched(offset=-NOW / SECOND + 20.0)
    one.judge(0.0)
    one.offset = 0.0
    assert one.confirmed(1.0, clock) == StateVerdict(True, None, 'stamp jumped ahead')
    assert one.refusal(1.02, 1.5).reason == 'too old'
    assert one.judge(1.4, 1.5).is_new


def test_a_clock_of_this_computer_that_is_set_moves_no_reference():
    """Stamps and clock jump together; the steady clock does not."""
    one = started()
    one.watch.is_lock_step = True
    t = NOW + nanoseconds(5.0)
    verdict = one.watch.judge(t, t, Q, lambda: False, NOW + nanoseconds(PERIOD))
    assert verdict == StateVerdict(True, None, 'stamp jumped ahead', t)


# --- states without a stamp ----------------------------------------------------------------------

def bare(one: Watched, stamp_ns: int, clock: float, q: Any = Q) -> StateVerdict:
    return one.watch.judge(stamp_ns, NOW + nanoseconds(clock), np.array(q), lambda: one.crowd)


def test_where_there_is_no_stamp_the_clock_is_the_time():
    one = Watched()
    assert bare(one, 0, 1.0) == StateVerdict(True, None, 'first state', NOW + SECOND)
    second = bare(one, 0, 1.1)
    assert (second.is_new, second.restart) == (True, '')
    assert second.dt == pytest.approx(0.1)
    assert second.stamp == NOW + nanoseconds(1.1)
    one.crowd = True
    with pytest.raises(ImplausibleStateError, match='shoulder'):
        bare(one, 0, 1.11, Q + 1.0)


def test_a_simulation_that_begins_at_0_restarts_time_with_its_sixth_stamp():
    """The first stamp, 0, counts as missing; the clock has replaced it."""
    one = Watched()
    bare(one, 0, 1.0)
    for k in range(1, CONFIRMATIONS + 1):
        with pytest.raises(ImplausibleStateError, match='stamp is [0-9.]* s before'):
            bare(one, nanoseconds(k * PERIOD), 1.0 + k * PERIOD)
    k = CONFIRMATIONS + 1
    assert bare(one, nanoseconds(k * PERIOD), 1.0 + k * PERIOD) == StateVerdict(
        True, None, 'stamp went back', nanoseconds(k * PERIOD))


def test_present_stamps_continue_after_states_without_stamps():
    one = Watched()
    bare(one, 0, 1.0)
    assert one.judge(1.1) == StateVerdict(True, pytest.approx(0.1))
