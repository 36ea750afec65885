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

"""The check that a measured state can follow the previous one: stamps, ages, distances, source."""

from collections.abc import Callable
from typing import Any

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.monitoring.state_plausibility import (
    CONFIRMATIONS,
    CONTRADICTION,
    ImplausibleStateError,
    JUMP,
    LONGEST_GAP,
    PLAY,
    SAME_CLOCK,
    SIMULATED_BEFORE,
    SPEED_FACTOR,
    StateMonitor,
    StateVerdict,
)

NAMES = ('shoulder', 'wrist')  # the wrist is continuous
LIMIT = np.array([2.0, 3.0])
SECOND = 1_000_000_000
NOW = 1_790_000_000 * SECOND
MAX_AGE = 0.2
Q = np.array([0.3, -0.4])
PERIOD = 0.002

laws = settings(deadline=None, derandomize=True)


def nanoseconds(seconds: float) -> int:
    return round(seconds * SECOND)


class Watched:
    """A check with times in seconds after NOW; `crowd` declares several publishers."""

    def __init__(
        self, max_age: float = MAX_AGE, limit: np.ndarray = LIMIT, offset: float = 0.0,
    ) -> None:
        self.watch = StateMonitor(NAMES, limit, max_age, np.array([False, True]))
        self.offset, self.crowd = offset, False

    def judge(
        self, stamp: float, clock: float | None = None, q: Any = Q, v: Any = None,
    ) -> StateVerdict:
        """
        Check a state that arrives at `clock`, which by default is its stamp.

        The stamp is the time of the state, and is not part of the result.
        """
        stamp_ns = NOW + nanoseconds(stamp) + nanoseconds(self.offset)
        judgement = self.watch.judge(
            stamp_ns, NOW + nanoseconds(stamp if clock is None else clock),
            np.array(q), None if v is None else np.array(v), lambda: self.crowd)
        assert judgement.stamp == stamp_ns
        return judgement._replace(stamp=0)

    def refusal(self, *args: Any, **more: Any) -> ImplausibleStateError:
        """Return the rejection of a state; fail if the state is accepted."""
        with pytest.raises(ImplausibleStateError) as caught:
            self.judge(*args, **more)
        return caught.value


def started(**options: Any) -> Watched:
    """Return a check that has accepted a state at 0 s."""
    one = Watched(**options)
    assert one.judge(0.0) == StateVerdict(True, None, 'first state')
    return one


# --- accepted states -----------------------------------------------------------------------------

@laws
@given(st.lists(st.floats(0.0005, 0.02), min_size=1, max_size=30), st.floats(0.0, 0.99))
def test_states_that_move_as_fast_as_they_may_follow_each_other(
    steps: list[float], fraction: float,
) -> None:
    one, t, q = started(), 0.0, Q.copy()
    one.crowd = True
    for dt in steps:
        t, q = t + dt, q + fraction * SPEED_FACTOR * LIMIT * dt
        judgement = one.judge(t, q=q)
        assert judgement.is_new
        assert judgement.dt == pytest.approx(dt, abs=2e-9)
        assert not judgement.restart


def test_a_repeated_stamp_is_no_new_state_for_any_content() -> None:
    one = started()
    for q in (Q, Q + 1.0):
        assert one.judge(0.0, 0.01, q) == StateVerdict(False)
    assert one.judge(PERIOD, q=Q).dt == pytest.approx(PERIOD)


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize(('dt', 'v', 'longest'), [
    (0.01, None, PLAY + SPEED_FACTOR * 2.0 * 0.01),
    (0.5, None, PLAY + SPEED_FACTOR * 2.0 * 0.5),
    (0.01, [0.0, 0.0], PLAY + SPEED_FACTOR * 2.0 * 0.01),
    (0.01, [-30.0, 0.0], PLAY + SPEED_FACTOR * 30.0 * 0.01),  # at a reported speed above the limit
])
def test_a_way_longer_than_the_speed_allows_is_a_jump(
    sign: float, dt: float, v: list[float] | None, longest: float,
) -> None:
    for factor, jumps in ((0.999, False), (1.001, True)):
        one = started()
        judgement = one.judge(dt, q=Q + [sign * factor * longest, 0.0], v=v)
        assert judgement.is_new
        assert judgement.restart == ('jump' if jumps else '')
        assert judgement.dt == pytest.approx(dt)


def test_a_joint_without_a_velocity_limit_never_jumps() -> None:
    one = started(limit=np.full(2, np.inf))
    one.crowd = True
    assert not one.judge(PERIOD, q=Q + 1e6).restart


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize(('speed', 'restart'), [(1.7e308, ''), (-1e200, 'jump')])
def test_beyond_all_speeds_nothing_overflows(speed: float, restart: str) -> None:
    watched = Watched()
    first = watched.judge(0.0, q=[1.7e308, -1.7e308], v=[speed, 0.0])
    assert first == StateVerdict(True, None, 'first state')
    second = watched.judge(0.5, q=[-1.7e308, 1.7e308], v=[speed, speed])
    assert second == StateVerdict(True, 0.5, restart)


@pytest.mark.parametrize('turns', [-3, -1, 1, 7])
def test_a_whole_turn_is_no_way_for_a_joint_without_an_end(turns: int) -> None:
    one = started()
    assert not one.judge(PERIOD, q=Q + [0.0, 2.0 * np.pi * turns + PLAY]).restart
    assert one.judge(2 * PERIOD, q=Q + [0.0, 2.0 * np.pi * turns + 1.0]).restart == 'jump'
    assert started().judge(PERIOD, q=Q + [2.0 * np.pi * turns, 0.0]).restart == 'jump'


# --- rejected states -----------------------------------------------------------------------------

ODD: dict[str, Callable[[Watched], Any]] = {
    'stamp went back': lambda one: one.judge(-0.1, PERIOD),
    'jump': lambda one: one.judge(PERIOD, q=Q + [1.0, 0.0]),
}


@pytest.mark.parametrize('reason', ODD)
def test_from_a_single_publisher_it_is_a_new_start(reason: str) -> None:
    one = started()
    judgement = ODD[reason](one)
    assert judgement.is_new
    assert judgement.restart == reason
    assert (judgement.dt is None) == (reason == 'stamp went back')


@pytest.mark.parametrize('reason', ODD)
def test_publishers_that_contradict_each_other_are_a_conflict(reason: str) -> None:
    one = started()
    one.crowd = True
    with pytest.raises(ImplausibleStateError) as caught:
        ODD[reason](one)
    assert caught.value.reason == reason
    assert not caught.value.is_conflict  # possibly a restart
    assert str(caught.value).endswith('; there are several publishers of joint_states')
    judgement = one.judge(0.01, q=Q)
    assert not judgement.restart
    assert judgement.dt == pytest.approx(0.01)
    for k in range(3 * CONFIRMATIONS):  # from then on no state resets the time
        assert one.refusal(-0.1 + k * PERIOD, 0.01 + k * PERIOD).is_conflict


@pytest.mark.parametrize('clock_steps', [-5.0, 5.0])
def test_an_idle_publisher_is_no_conflict(clock_steps: float) -> None:
    """A robot whose clock is set: after several successive states the time is reset."""
    one = Watched(max_age=0.0)
    one.crowd = True
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
    (CONTRADICTION - 1, True), (CONTRADICTION, False)])
def test_a_contradiction_is_over_after_enough_good_states(
    good_states: int, is_conflict: bool,
) -> None:
    one = started()
    one.crowd = True
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
def test_states_that_do_not_follow_each_other_are_not_confirmed(
    place: Callable[[int], tuple[float, Any]],
) -> None:
    one = started()
    one.crowd = True
    for k in range(1, 4 * CONFIRMATIONS):
        stamp, q = place(k)
        assert one.refusal(stamp, k * PERIOD, q).reason == 'jump'


def test_a_stray_state_does_not_count_as_a_confirmation() -> None:
    one = started()
    one.crowd = True
    one.refusal(PERIOD, q=Q + [9.0, 0.0])
    for k in range(2, CONFIRMATIONS + 2):
        assert one.refusal(k * PERIOD, q=Q + [1.0, 0.0]).reason == 'jump'
    assert one.judge((CONFIRMATIONS + 2) * PERIOD, q=Q + [1.0, 0.0]).restart == 'jump'


def test_the_joint_that_jumped_is_named() -> None:
    one = started()
    one.crowd = True
    assert "position of 'wrist' is 0.6, 1 away from that of 0.002 s before" in str(
        one.refusal(PERIOD, q=Q + [0.0, 1.0]))


def test_the_crowd_is_not_counted_while_all_is_well() -> None:
    watch = StateMonitor(NAMES, LIMIT, MAX_AGE, np.array([False, True]))

    def must_not_be_asked() -> bool:
        raise AssertionError

    for k in range(3):
        t = NOW + k * nanoseconds(PERIOD)
        watch.judge(t, t, Q, None, must_not_be_asked)


# --- the age of a state --------------------------------------------------------------------------

@pytest.mark.parametrize('is_first', [True, False])
@pytest.mark.parametrize(('age', 'reason'), [
    (0.199, ''), (0.201, 'too old'), (-0.199, ''), (-0.201, 'from the future'),
    (10.0, 'too old'), (-50.0, 'from the future'), (SAME_CLOCK - 1.0, 'too old')])
def test_a_state_is_of_now(is_first: bool, age: float, reason: str) -> None:
    one = Watched() if is_first else started()
    one.crowd = True
    t = 0.5
    if not reason:
        assert one.judge(t - age, t).is_new
    else:
        error = one.refusal(t - age, t)
        assert error.reason == reason
        assert not error.is_conflict
        assert f'{abs(age):.3f} s {"old" if age > 0 else "in the future"}' in str(error)
        assert str(error).endswith('0.2 s (state_max_age), by the clock of this computer')


def test_a_state_rejected_for_its_age_has_no_side_effect() -> None:
    one = started()
    one.refusal(0.1, 0.5, q=Q + 1.0)
    assert one.judge(0.01, q=Q) == StateVerdict(True, 0.01)


def test_any_age_goes_where_there_is_no_limit() -> None:
    one = started(max_age=0.0)
    assert one.judge(1.0, 20.0).is_new


def test_the_limit_of_age_may_change() -> None:
    one = started()
    one.watch.max_age = 1.0
    assert one.judge(0.01, 0.8).is_new
    one.watch.max_age = 0.1
    assert one.refusal(0.6, 0.9).reason == 'too old'


# --- other clocks --------------------------------------------------------------------------------

STORY = st.lists(st.tuples(
    st.floats(-0.5, 40.0) | st.sampled_from([0.0, PERIOD]),  # increment of the stamp
    st.floats(0.0, 40.0) | st.sampled_from([PERIOD]),  # increment of the clock
    st.sampled_from([0.0, 0.01, 1.0])), max_size=8)


def fates_of(one: Watched, story: list[tuple[float, float, float]], crowd: bool) -> list[object]:
    """Return the result for each state of a story: the judgement, or the reason of rejection."""
    one.crowd = crowd
    stamp = clock = 0.0
    fates: list[object] = []
    for by_stamp, by_clock, way in story:
        stamp, clock = stamp + by_stamp, clock + by_clock
        try:
            fates.append(one.judge(stamp, clock, Q + [way, 0.0]))
        except ImplausibleStateError as error:
            fates.append(str(error))
    return fates


@laws
@given(
    STORY, st.floats(100.0 - NOW / SECOND, SIMULATED_BEFORE - NOW / SECOND - 1000.0),
    st.booleans())
def test_simulated_time_has_no_age(
    story: list[tuple[float, float, float]], offset: float, crowd: bool,
) -> None:
    fates = fates_of(Watched(offset=offset), story, crowd)
    assert not [fate for fate in fates if 'old' in str(fate) or 'future' in str(fate)]


def test_simulated_time_may_run_slowly_but_does_not_jump() -> None:
    one = started(offset=-NOW / SECOND + 100.0)
    for k in range(1, 50):
        assert one.judge(k * PERIOD, float(k)).dt == pytest.approx(PERIOD)
    assert one.judge(0.1 + 0.19, 49.001).dt == pytest.approx(0.192)
    assert one.judge(5.0, 49.002) == StateVerdict(True, None, 'stamp jumped ahead')


@pytest.mark.parametrize(('max_age', 'largest'), [(MAX_AGE, MAX_AGE), (3.0, 3.0), (0.0, JUMP)])
def test_simulated_time_may_run_ahead_of_the_clock_by_the_largest_age(
    max_age: float, largest: float,
) -> None:
    for excess, restart in ((0.99 * largest, ''), (1.01 * largest, 'stamp jumped ahead')):
        one = started(max_age=max_age, offset=-NOW / SECOND + 100.0)
        assert one.judge(0.1 + excess, 0.1).restart == restart


@pytest.mark.parametrize('offset', [2.0 * SAME_CLOCK, -2.0 * SAME_CLOCK, 1e8])
def test_the_clock_of_another_computer_keeps_its_offset(offset: float) -> None:
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


@pytest.mark.parametrize('clock', [1.0, 1.1])
def test_a_clock_that_is_set_right_gets_its_age(clock: float) -> None:
    """The first stamps are of 1970, as of a computer that has not received the time yet."""
    one = Watched(offset=-NOW / SECOND + 20.0)
    one.judge(0.0)
    one.offset = 0.0
    assert one.judge(1.0, clock) == StateVerdict(True, None, 'stamp jumped ahead')
    assert one.refusal(1.01, 1.5).reason == 'too old'
    assert one.judge(1.4, 1.5).is_new


def test_a_clock_of_this_computer_that_is_set_moves_no_reference() -> None:
    """Stamps and clock jump together; the steady clock does not."""
    one = started()
    t = NOW + nanoseconds(5.0)
    verdict = one.watch.judge(t, t, Q, None, lambda: False, NOW + nanoseconds(PERIOD))
    assert verdict == StateVerdict(True, None, 'stamp jumped ahead', t)


# --- resets --------------------------------------------------------------------------------------

@pytest.mark.parametrize('crowd', [True, False])
def test_after_a_long_pause_any_state_is_a_first_state(crowd: bool) -> None:
    one = started()
    one.crowd = crowd
    assert one.judge(LONGEST_GAP + 0.1, q=Q + 1.0) == StateVerdict(True, None, 'first state')


def test_after_a_shorter_one_it_is_not() -> None:
    one = started()
    assert one.judge(LONGEST_GAP - 0.1).dt == pytest.approx(LONGEST_GAP - 0.1)


def test_refused_states_do_not_keep_the_memory_alive() -> None:
    """The accepted publisher has stopped: after some time the other one is accepted."""
    one = started()
    for k in range(1, 30):
        assert one.refusal(-100.0 + k, float(k)).reason == 'too old'
    one.watch.max_age = 0.0
    assert one.judge(-69.5, 30.5) == StateVerdict(True, None, 'first state')


@laws
@given(st.floats(-1e5, 1e5))
def test_a_clock_that_is_set_with_the_stamps_resets_or_continues(jump: float) -> None:
    """The jump of the clock never causes a rejection, nor a step back in time."""
    assume(abs(jump) > 1e-3)
    one = started()
    one.crowd = True
    judgement = one.judge(jump + PERIOD)
    assert judgement.is_new
    if 0.0 < jump < LONGEST_GAP - PERIOD:
        assert judgement.dt == pytest.approx(jump + PERIOD, abs=2e-9)
    else:
        assert judgement == StateVerdict(True, None, 'first state')


def test_stamps_far_ahead_reset_the_time() -> None:
    one = Watched(max_age=0.0)
    one.judge(0.0)
    assert one.judge(LONGEST_GAP + 1.0, 0.01) == StateVerdict(True, None, 'stamp jumped ahead')


# --- states without a stamp ----------------------------------------------------------------------

def bare(one: Watched, stamp_ns: int, clock: float, q: Any = Q) -> StateVerdict:
    return one.watch.judge(
        stamp_ns, NOW + nanoseconds(clock), np.array(q), None, lambda: one.crowd)


def test_where_there_is_no_stamp_the_clock_is_the_time() -> None:
    one = Watched()
    assert bare(one, 0, 1.0) == StateVerdict(True, None, 'first state', NOW + SECOND)
    second = bare(one, 0, 1.1)
    assert (second.is_new, second.restart, second.time_shift) == (True, '', 0)
    assert second.dt == pytest.approx(0.1)
    assert second.stamp == NOW + nanoseconds(1.1)
    one.crowd = True
    with pytest.raises(ImplausibleStateError, match='shoulder'):
        bare(one, 0, 1.11, Q + 1.0)


def test_a_simulation_that_begins_at_0_continues_without_a_reset() -> None:
    """The first stamp, 0, counts as missing; times counted from the clock then count from 0."""
    one = Watched()
    first = bare(one, 0, 1.0)
    second = bare(one, nanoseconds(PERIOD), 1.01)
    assert second == StateVerdict(True, None, '', nanoseconds(PERIOD), first.stamp)
    third = bare(one, nanoseconds(2 * PERIOD), 1.02)
    assert (third.restart, third.time_shift) == ('', 0)
    assert third.dt == pytest.approx(PERIOD)


def test_present_stamps_after_states_without_stamps_reset_the_time() -> None:
    one = Watched()
    bare(one, 0, 1.0)
    assert one.judge(1.1) == StateVerdict(True, None, 'first state')
