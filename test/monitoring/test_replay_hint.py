# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A replayed recording is recognised by a constant age of its states."""

import pytest
from robot_dynamics.monitoring.replay_hint import ReplayHint

NOW = 1_790_000_000_000_000_000
PERIOD = 10_000_000
STATES = 200


def ns(seconds: float) -> int:
    return round(1e9 * seconds)


def recognised(hint: ReplayHint, first: int, ages: list[float], pace: float = 1.0) -> list[int]:
    """Return the indices at which the hint is new, for states one period apart by local time."""
    return [
        k for k, age in enumerate(ages)
        if hint.examine(first - ns(age) + round(pace * k * PERIOD), first + k * PERIOD)]


@pytest.mark.parametrize('age', [5.0, 1800.0, 7200.0, 3e7])
def test_states_of_a_constant_age_are_those_of_a_replay(age):
    hint = ReplayHint()
    at, = recognised(hint, NOW, [age] * STATES)
    assert at * PERIOD == ns(1.0)
    assert f'{age:.1f} s old' in hint.text
    assert '`ros2 bag play --clock`' in hint.text
    assert '`use_sim_time:=true`' in hint.text


@pytest.mark.parametrize(('jitter', 'found'), [(0.19, 1), (0.21, 0)])
def test_jitter_of_0_2_s_is_allowed(jitter, found):
    ages = [100.0 + jitter * (k % 2) for k in range(STATES)]
    assert len(recognised(ReplayHint(), NOW, ages)) == found


@pytest.mark.parametrize('pace', [0.0, 0.5, 2.0])
def test_stamps_at_another_pace_are_not_those_of_a_replay(pace):
    hint = ReplayHint()
    assert not recognised(hint, NOW, [100.0] * STATES, pace)
    assert not hint.text


@pytest.mark.parametrize(('stamp', 'found'), [(1e9 - 3.0, 0), (1e9 + 3.0, 1)])
def test_stamps_of_a_simulation_are_not_those_of_a_replay(stamp, found):
    """They are before 2001, 1e9 s after 1970."""
    assert len(recognised(ReplayHint(), NOW, [NOW / 1e9 - stamp] * STATES)) == found


@pytest.mark.parametrize(('states', 'found'), [(9, False), (10, True)])
def test_ten_states_are_enough(states, found):
    hint = ReplayHint()
    last = [hint.examine(NOW + ns(k - 100.0), NOW + ns(k)) for k in range(states)][-1]
    assert last == found
    assert bool(hint.text) == found


def test_another_age_ends_the_hint_and_a_second_replay_is_recognised():
    hint = ReplayHint()
    assert recognised(hint, NOW, [100.0] * STATES)
    assert not hint.examine(NOW + ns(3.0), NOW + ns(3.0))
    assert not hint.text
    assert recognised(hint, NOW + ns(4.0), [100.0] * STATES)
    hint.reset()
    assert not hint.text
    assert recognised(hint, NOW + ns(8.0), [100.0] * STATES)
