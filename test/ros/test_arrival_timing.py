# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Rate, jitter and late states, compared with numpy on random times."""

from collections import deque

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.ros.dynamics.state_log import ArrivalTiming, Timing

START = 1000.0
intervals = st.lists(st.floats(1e-4, 0.5), min_size=1, max_size=60)


@settings(max_examples=50)
@given(intervals, intervals)
def test_windows_do_not_mix(first, second):
    """An interval belongs to the window in which it ended."""
    timing, t = ArrivalTiming(START), START
    last: list[float] = []
    for lengths in (first, second):
        begin, ends = t, t + np.cumsum(lengths)
        t = max(float(ends[-1]), begin + 1.0) + 0.01
        arrivals = deque(ends.tolist())
        seen, between = timing.take(arrivals, t), np.diff([*last, *ends])
        assert not arrivals
        if between.size == 0:
            assert seen == Timing()
        else:
            assert seen.jitter == pytest.approx(between.std(), abs=1e-6)
        assert seen.rate == pytest.approx(between.size / (t - begin))
        assert seen.longest == pytest.approx(between.max(initial=0.0))
        last = [float(ends[-1])]


@settings(max_examples=50)
@given(st.lists(st.floats(1e-3, 0.1), min_size=2, max_size=30),
       st.lists(st.floats(1e-3, 0.3), min_size=1, max_size=30))
def test_late_is_more_than_one_and_a_half_intervals_of_the_window_before(first, second):
    timing, times = ArrivalTiming(START), START + np.cumsum(first)
    now = START + max(1.0, sum(first))
    timing.take(deque(times.tolist()), now)
    assert timing.late == 0  # there is no reference interval yet
    usual = np.diff(times).mean()
    later = times[-1] + np.cumsum(second)
    timing.take(deque(later.tolist()), now + max(1.0, sum(second)))
    between = np.diff([times[-1], *later])
    assume((np.abs(between - 1.5 * usual) > 1e-9).all())
    assert timing.late == (between > 1.5 * usual).sum()


def test_a_window_is_evaluated_when_it_is_over_and_not_before():
    timing, arrivals = ArrivalTiming(START), deque((START + np.arange(1, 100) * 0.005).tolist())
    assert timing.take(arrivals, START + 0.999) == Timing()
    assert len(arrivals) == 99
    seen = timing.take(arrivals, START + 1.0)
    assert seen.rate == pytest.approx(98.0)
    assert timing.take(arrivals, START + 1.5) == seen == timing.timing
    assert timing.take(arrivals, START + 2.0) == Timing()  # no state since
    assert timing.take(deque([START + 2.5]), START + 3.0).rate == pytest.approx(1.0)
    assert timing.late == 0  # until an interval is known
