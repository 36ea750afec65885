# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The gate of the measured states: wrong velocities, corrupted samples, lost joints."""

from collections.abc import Callable

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gate import Gate, Signals
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.trajectories.interpolation import Reference

SECOND = 1_000_000_000
START = 1_790_000_000 * SECOND
rates = st.sampled_from([100.0, 125.0, 250.0, 500.0, 1000.0])
signs = st.sampled_from([-1.0, 1.0])
FEW = settings(max_examples=25)
pytestmark = pytest.mark.filterwarnings('error')


class Fed:
    """A gate of two joints, the first one continuous, that gets states at a rate [Hz]."""

    def __init__(self, rate: float, limit: float = 2.0, is_held: bool = False) -> None:
        self.reference: FloatArray | None = None
        self.is_commanded = True
        self.gate = Gate(
            ('a', 'b'), np.array([True, False]), np.full(2, limit), 0.2,
            lambda: None if self.reference is None else Reference(*[self.reference] * 3),
            lambda q, error: np.full(2, is_held), lambda: self.is_commanded)
        self.rate, self.k = rate, 0

    @property
    def t(self) -> float:
        """The time [s] of the next state."""
        return self.k / self.rate

    def take(self, q: FloatArray, v: FloatArray | None) -> Signals:
        self.k += 1
        return self.gate.take(START + round((self.k - 1) * SECOND / self.rate), q, v)

    def starts(self, q: FloatArray) -> None:
        """Begin at rest, and show how fine the positions are."""
        for way in (0.0, 1e-7):
            self.take(q + way, 0.0 * q)

    def signals(self, q: FloatArray, v: FloatArray | None) -> Signals:
        found = self.take(q, v)
        assert found.verdict.is_new
        return found

    def moves(self, v: FloatArray, until: float, has_velocity: bool = True) -> FloatArray:
        """Move from 0 at a constant velocity; return the last position."""
        while self.t < until:
            q = self.t * v
            self.signals(q, v if has_velocity else None)
        return q


class Swing:
    """Two joints from rest, which turn back and forth with speeds up to `speed` [rad/s]."""

    def __init__(self, speed: float, frequency: float) -> None:
        self._speed, self._w = speed * np.array([1.0, -0.7]), 2.0 * np.pi * frequency

    def q(self, t: float) -> FloatArray:
        x = self._w * t - np.pi / 6.0
        return 3.0 + self._speed * (t / 3.0 - 2.0 / 3.0 * np.cos(x) / self._w)

    def v(self, t: float) -> FloatArray:
        return self._speed * (1.0 + 2.0 * np.sin(self._w * t - np.pi / 6.0)) / 3.0


swings = st.builds(Swing, st.floats(0.3, 2.0), st.floats(0.2, 1.0))


# --- velocities ----------------------------------------------------------------------------------

@FEW
@given(swing=swings, rate=rates, scale=st.floats(0.8, 1.2), noise=st.floats(0.0, 0.05))
def test_a_true_velocity_is_used_without_a_delay(swing, rate, scale, noise):
    one, rng = Fed(rate), np.random.default_rng(1)
    while one.t < 3.0:
        is_first, q = one.k == 0, swing.q(one.t)
        v = scale * swing.v(one.t) + rng.normal(0.0, noise, 2)
        signals = one.signals(q, v)
        assert signals.v.tolist() == ([0.0, 0.0] if is_first else v.tolist())
        assert signals.q.tolist() == q.tolist()
        assert (signals.candidates[0][1], signals.lost) == (0.0, None)
        assert bool(signals.verdict.restart) == is_first
    assert not one.gate.doubtful.any()


def test_the_velocity_of_the_positions_is_used_if_it_is_chosen():
    one = Fed(500.0)
    one.gate = Gate(('a', 'b'), np.zeros(2, dtype=bool), np.full(2, 2.0), 0.2, choice=lambda: 1)
    while one.t < 0.3:
        signals = one.signals(one.t * np.array([0.5, 1.0]), np.array([0.7, 0.8]))
        if one.t > 0.02:
            assert signals.v == pytest.approx([0.5, 1.0])
            assert signals.candidates[1][1] == pytest.approx(0.004)


@FEW
@given(rate=rates | st.just(30.0), begin=st.floats(-1.0, 1.0), a=st.floats(-4.0, 4.0))
def test_without_a_velocity_it_is_that_of_the_middle_of_8_ms_or_of_a_period(rate, begin, a):
    """At a constant acceleration a [rad/s²] from `begin` [rad/s]; a turn is no motion."""
    one = Fed(rate)
    while one.t < 0.3:
        t = one.t
        q = 3.1 + begin * t + 0.5 * a * t**2 + np.zeros(2)
        q[0] = np.arctan2(np.sin(q[0]), np.cos(q[0]))
        signals = one.signals(q, None)
        if t > 0.02:
            assert 8.0 * 0.999 <= 2e3 * signals.candidates[0][1] < 8.0 + 1001.0 / rate
            assert signals.v == pytest.approx(begin + a * (t - signals.candidates[0][1]), abs=1e-6)


WRONG: dict[str, Callable[[FloatArray], FloatArray]] = {
    'sign': lambda v: -v, 'degrees': np.degrees, 'zero': lambda v: 0.0 * v,
    'constant': lambda v: 0.0 * v + 3.0}
"""The constant is twice the largest speed: one within 30 % of the velocity may be right."""


@FEW
@given(kind=st.sampled_from([*WRONG]), speed=st.floats(0.3, 2.0), rate=rates,
       at=st.floats(0.1, 2.1), sign=signs)
def test_a_wrong_velocity_is_not_used_until_it_is_right_for_1_s(kind, speed, rate, at, sign):
    """
    Of the second joint, faster than 0.15 rad/s; the first one is not doubted.

    It is found within 20 mrad, and the way of 30 ms: the displacement of 0.1 s may be 30 % off.
    """
    is_far = kind in ('zero', 'degrees')  # missing in fast motion: nothing is learned
    one = Fed(rate, 2.0 if is_far else 20.0)
    swing, wrong = Swing(sign * speed, 0.5), WRONG[kind]
    way, before, right_at, was_doubted = 0.0, swing.q(0.0), at + 2.0, False
    while one.t < right_at + 3.2:
        t, q, v = one.t, swing.q(one.t), swing.v(one.t)
        measured = v.copy()
        if at <= t < right_at:
            measured[1:] = wrong(v[1:])
            way += abs(q[1] - before[1])
        before = q
        signals = one.signals(q, measured)
        assert t == 0.0 or signals.v[0] == v[0]
        if way > 0.02 + 0.03 * speed and t < right_at and abs(v[1]) > 0.15:
            assert signals.v[1] == pytest.approx(v[1], abs=0.02 + 0.05 * speed)
        is_doubted = one.gate.doubtful[1]
        was_doubted = is_doubted if t < right_at or is_far else was_doubted
        assert t < right_at or t > right_at + 0.99 or is_doubted == was_doubted
        assert t < right_at + 3.0 or signals.v.tolist() == v.tolist()


@settings(max_examples=12)
@given(swing=swings, rate=rates, at=st.floats(0.5, 2.0), size=st.floats(1.0, 308.2),
       sign=signs, j=st.sampled_from([[0], [1], [0, 1]]), rests=st.booleans(),
       limit=st.floats(1.0, 6.0))
def test_one_corrupted_velocity_changes_nothing_but_its_sample(
        swing, rate, at, size, sign, j, rests, limit):
    """Of 10 to 1.7e308 rad/s; 1 s later a wrong sign is found as without it."""
    gates, other_doubts, found = (Fed(rate, limit), Fed(rate, limit)), 0, 0
    while gates[0].t < at + 2.0:
        t = gates[0].t
        place = max(at, t - 1.0) if rests else t
        q, v = swing.q(place), swing.v(place) * (not rests or t >= at + 1.0)
        v = -v if t > at + 1.0 + 2.0 / rate else v
        corrupted, is_corrupted = v.copy(), t >= at and not found
        if is_corrupted:
            corrupted[j], found = sign * 10.0**size, gates[0].k
        clean, other = gates[0].signals(q, v), gates[1].signals(q, corrupted)
        if is_corrupted:
            assert other.v == pytest.approx(clean.v, abs=0.1 + 10.0 / rate)
            assert other.candidates[0][1] == 0.0
        elif t < at + 1.0:
            assert [each.tolist() for each in other[:2]] == [each.tolist() for each in clean[:2]]
            assert (other.verdict, other.lost) == (clean.verdict, clean.lost)
        other_doubts += (gates[0].gate.doubtful != gates[1].gate.doubtful).any()
    assert other_doubts <= 2  # one state later, or earlier, at each joint


# --- positions that repeat -----------------------------------------------------------------------

@FEW
@given(rate=rates, speed=st.floats(0.05, 2.0), sign=signs, away=st.floats(0.001, 0.1),
       has_velocity=st.booleans(), silence=st.floats(0.02, 0.4))
def test_a_joint_that_repeats_in_motion_is_continued_lost_and_found(
        rate, speed, sign, away, has_velocity, silence):
    """It moves on for 50 ms, then its velocity decays with 20/s."""
    one, v, frozen_at, last = Fed(rate), sign * speed * np.array([0.5, 1.0]), None, 0.0
    one.starts(np.full(2, 3.1))
    while one.t < 0.3:
        q, frozen_at = 3.1 + one.t * v, one.t
        assert one.signals(q, v if has_velocity else None).lost is None
    kept, end = q[1], one.t + silence
    while one.t < end:
        passed = one.t - frozen_at
        q = np.array([3.1 + one.t * v[0], kept])
        signals = one.signals(q, v * [1.0, 0.0] if has_velocity else None)
        late = max(passed - 0.05, 0.0)
        way = min(passed, 0.05) + (1.0 - np.exp(-20.0 * late)) / 20.0
        assert signals.q == pytest.approx([q[0], kept + v[1] * way], abs=1.1 * speed / rate)
        assert (signals.lost is not None) == (round(1e9 * passed) > 50_000_000)
        assert signals.lost is None or signals.lost.tolist() == [False, True]
        last = signals.v[1]
        assert last == pytest.approx(v[1] * np.exp(-20.0 * late), rel=21.0 / rate)
    found = signals.q[1] + (away if signals.lost is not None else 0.01)
    for _ in range(20):  # further away than it could move
        q = np.array([3.1 + one.t * v[0], found + last * (one.t - end)])
        signals = one.signals(q, [v[0], last] * np.ones(2) if has_velocity else None)
        assert not signals.verdict.restart
        assert signals.lost is None
        assert signals.q.tolist() == q.tolist()
        assert signals.v == pytest.approx([v[0], last], rel=0.1)


@FEW
@given(rate=rates, a=st.floats(-5.0, 5.0), share=st.floats(0.0, 1.0))
def test_a_missing_joint_follows_its_reference_and_then_brakes_as_far_as_it_can(rate, a, share):
    one, v = Fed(rate), np.array([0.3, 1.0])
    one.starts(np.zeros(2))
    kept = one.moves(v, 0.3)[1]
    one.reference, last, was_lost = np.array([0.0, a]), 1.0, False
    while one.t < 0.5:
        one.gate.braking = share
        signals = one.signals(np.array([one.t * v[0], kept]), v * [1.0, 0.0])
        decay = np.exp(-20.0 / rate * (share if was_lost else 1.0))
        was_lost = signals.lost is not None
        assert signals.v[1] == pytest.approx(last * decay if was_lost else last + a / rate)
        last = signals.v[1]
    assert was_lost
    assert one.gate.planned[0] == pytest.approx(0.3 * abs(last) / abs(1.0 + a * 0.05), rel=0.05)


@FEW
@given(rate=rates, speed=st.floats(0.1, 2.0))
def test_a_joint_whose_velocity_shows_that_it_stands_is_not_lost(rate, speed):
    one, v, rng = Fed(rate), np.array([0.3, speed]), np.random.default_rng(3)
    one.starts(np.zeros(2))
    while one.t < 0.6:
        stands = one.t > 0.3
        q = np.array([0.3 * one.t, speed * min(one.t, 0.3)])
        noise = rng.normal(0.0, 0.01, 2)
        assert one.signals(q, v * [1.0, 1.0 - stands] + noise).lost is None


@FEW
@given(rate=st.floats(100.0, 1000.0), speed=st.floats(0.05, 3.0), states=st.floats(1.0, 100.0),
       moves=st.booleans(), has_velocity=st.booleans(), shift=st.floats(0.0, 1.0))
def test_a_joint_that_friction_stops_is_never_missing(
        rate, speed, states, moves, has_velocity, shift):
    """
    Within one state or more, as a light wrist, with a constant deceleration a [rad/s²].

    Then its position repeats bit by bit.
    """
    a = speed * rate / states
    one = Fed(rate, 3.0)
    one.starts(np.zeros(2))
    begin = 0.1 + shift / rate
    while one.t < begin + speed / a + 0.2:
        t = min(max(one.t - begin, 0.0), speed / a)
        x = speed * (min(one.t, begin) + t) - 0.5 * a * t**2
        q = np.array([0.3 * one.t if moves else 0.0, x])
        v = np.array([0.3 * moves, speed - a * t if t < speed / a else 0.0])
        signals = one.signals(q, v if has_velocity else None)
        assert signals.q.tolist() == q.tolist()
        assert signals.lost is None


def test_a_slow_joint_may_rest_while_another_one_is_lost():
    one, slow = Fed(500.0), np.array([0.0, 0.0001])
    q = np.zeros(2)
    one.starts(q)
    for _ in range(50):
        q = q + [0.002, 0.0]
        one.signals(q, np.array([1.0, 0.05]))
    for k in range(50):  # the first joint is lost, the second one moves once
        signals = one.signals(q + slow, np.zeros(2))
        assert signals.q[1] == 0.0001
        assert (signals.lost is not None) == (k > 24)
    assert signals.lost.tolist() == [True, False]


@FEW
@given(rate=rates, speed=st.floats(0.2, 2.0), gap=st.integers(3, 15))
def test_a_joint_that_stops_in_a_gap_is_never_missing(rate, speed, gap):
    one, v = Fed(rate), np.array([0.3, speed])
    one.starts(np.zeros(2))
    one.moves(v, 0.2)
    q = (one.t + 0.5 * gap / rate) * v
    one.k += gap
    for _ in range(int(0.3 * rate)):
        q[0] = 0.3 * one.t
        assert one.signals(q.copy(), np.array([0.3, 0.0])).lost is None


@FEW
@given(speed=st.floats(0.02, 0.6), rate=rates)
def test_the_steps_of_an_encoder_are_no_loss(speed, rate):
    """Of 15 bit per turn: below 0.2 rad/s its positions repeat at 1 kHz."""
    one, step = Fed(rate), 2.0 * np.pi / 2**15
    while one.t < 1.0:
        x, v = speed * one.t, np.array([speed, 0.7])
        signals = one.signals(np.array([step * np.floor(x / step), 0.7 * one.t]), v)
        assert signals.lost is None
        assert signals.q[0] == pytest.approx(x, abs=1.5 * step)


@pytest.mark.parametrize(('steps', 'is_missing'), [(2, False), (3, True)])
def test_a_joint_that_repeats_after_steps_of_three_increments_is_missing(steps, is_missing):
    one, v = Fed(500.0), np.array([steps * 0.5, 0.7])
    for k in (0, 1, *(1 + steps * i for i in range(1, 30))):
        x = 1e-3 * k
        one.signals(np.array([x, 0.7 * one.t]), v)
    assert (one.signals(np.array([x, 0.7 * one.t]), v).q[0] > x) == is_missing


@pytest.mark.parametrize(('speed', 'is_missing'), [(0.08, False), (0.14, True)])
def test_a_velocity_of_0_is_missing_above_0_1_rad_s(speed, is_missing):
    one, v = Fed(500.0), np.array([0.5, speed])
    one.moves(v, 1.0)
    assert one.signals(one.t * v, np.array([0.5, 0.0])).v[1] == (speed if is_missing else 0.0)


@FEW
@given(rate=rates, speed=st.floats(0.02, 0.09), sign=signs, offset=st.just(0.0) | st.just(0.04))
def test_a_slow_joint_that_repeats_its_velocity_is_lost_once_it_should_have_moved_3_mrad(
        rate, speed, sign, offset):
    """Unless the velocity has contradicted the positions before."""
    one, v = Fed(rate), np.array([sign * speed, 0.7])
    while one.t < 1.0:
        signals = one.signals(one.t * v, v + np.array([sign * offset, 0.0]))
        assert signals.lost is None
    q, begin = (one.t - 1.0 / rate) * v[0], one.t - 1.0 / rate
    seen = 0.003 / speed * (1.0 + 0.002 / speed)  # forgotten with a time constant of 1 s
    while one.t < begin + seen + 2.0 / rate:
        signals = one.signals(np.array([q, one.t * v[1]]), v + np.array([sign * offset, 0.0]))
        if one.t < begin + 0.003 / speed:
            assert signals.lost is None
    assert (signals.lost is not None) == (offset == 0.0)


@FEW
@given(rate=rates, speed=st.floats(0.16, 2.0), count=st.integers(1, 30), moved=signs)
def test_a_state_that_repeats_in_motion_is_none_until_a_position_changes(
        rate, speed, count, moved):
    one, v = Fed(rate), np.array([speed, 0.0])
    one.starts(0.0 * v)
    q = one.moves(v, 0.2)
    for _ in range(count):
        assert not one.take(q, v).verdict.is_new
        assert not one.take(q, 0.0 * v).verdict.is_new
    q = q + moved * 1e-6 * v
    assert one.signals(q, v).q.tolist() == q.tolist()


@FEW
@given(rate=rates, speed=st.floats(0.16, 2.0), has_velocity=st.booleans())
def test_an_arm_without_a_command_that_repeats_in_motion_is_on_its_brakes(
        rate, speed, has_velocity):
    one, v = Fed(rate), np.array([speed, 0.0])
    one.is_commanded = False
    one.starts(0.0 * v)
    q = one.moves(v, 0.2, has_velocity)
    if has_velocity:
        assert not one.take(q, v).verdict.is_new
    for _ in range(5):
        assert one.signals(q, 0.0 * v if has_velocity else None).v.tolist() == [0.0, 0.0]


@FEW
@given(rate=rates, speed=st.floats(0.02, 0.5), sign=signs, is_held=st.booleans())
def test_a_slow_joint_is_lost_if_its_reference_moves_30_mrad_where_friction_cannot_hold_it(
        rate, speed, sign, is_held):
    one, way = Fed(rate, is_held=is_held), 0.0
    for _ in range(20):
        one.reference = np.array([5.0, 0.1])
        one.signals(np.array([0.0, 0.1 + 1e-7 * one.k]), np.zeros(2))
    q = np.array([0.0, 0.1 + 1e-7 * one.k])
    while way < 0.08:
        q[0] += 1e-3 / rate
        one.reference = np.array([5.0, 0.1 + sign * way])
        signals = one.signals(q.copy(), np.zeros(2))
        if not 0.03 < way < 0.031 + speed * (0.01 + 2.0 / rate):
            assert (signals.lost is not None) == (way > 0.03 and not is_held)
        way += speed / rate
    signals = one.signals(q + [0.0, 1e-6], np.zeros(2))
    assert signals.lost is None


@pytest.mark.parametrize('rate', [100.0, 500.0])
@pytest.mark.parametrize('samples', [1, 100])
def test_a_position_that_jumps_is_missing_or_another_place(rate, samples):
    one, zero, restarts = Fed(rate), np.zeros(2), []
    for k in range(150):
        jump = 0.2 * (20 <= k < 20 + samples)
        try:
            signals = one.signals(np.array([0.0, jump]) + 1e-7 * one.k, zero)
        except ImplausibleStateError:
            continue
        assert np.abs(signals.v).max() < 0.1
        restarts += [(k, signals.verdict.restart)] if signals.verdict.restart else []
    assert restarts == [(0, 'first state'), *(() if samples == 1 else (
        (25, 'jump'), (125, 'jump')))]


# --- time ----------------------------------------------------------------------------------------

@FEW
@given(rate=st.floats(100.0, 250.0), jump=st.floats(0.06, 0.12), sign=signs)
def test_a_jump_between_velocities_that_agree_is_another_place(rate, jump, sign):
    """Without a velocity limit, it is no faster than a joint may be."""
    one, q = Fed(rate, np.inf), np.zeros(2)
    for _ in range(20):
        one.signals(q, np.zeros(2))
    restarts = [one.signals(q + [0.0, sign * jump], np.zeros(2)).verdict.restart for _ in range(9)]
    assert [restart for restart in restarts if restart] == ['jump']


def test_after_a_pause_a_state_is_a_first_one():
    one, v = Fed(500.0), np.array([1.0, -1.0])
    for _ in range(20):
        last = one.signals(one.t * v, v)
    again = one.gate.take(START + round((one.k - 1) * SECOND / 500.0), last.q + 1.0, v)
    assert not again.verdict.is_new
    assert again.q.tolist() == last.q.tolist()  # the same stamp is the same state
    stamp = START + round((one.k - 1) * SECOND / 500.0) + 501_000_000
    first = one.gate.take(stamp, last.q + 1.0, v)
    assert (first.q.tolist(), first.v.tolist()) == ((last.q + 1.0).tolist(), [0.0, 0.0])
    second = one.gate.take(stamp + 2_000_000, last.q + 1.0 + 0.002 * v, v)
    assert second.v.tolist() == v.tolist()
