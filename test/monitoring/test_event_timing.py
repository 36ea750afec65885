# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Rate, jitter and late events, compared with numpy on random times."""

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.monitoring.event_timing import EventTiming, Timing

WINDOW = 1.0
START = 1000.0

intervals = st.lists(st.floats(1e-4, 0.5), min_size=1, max_size=60)


def timing_of(times: np.ndarray) -> EventTiming:
    timing = EventTiming(START, WINDOW)
    for t in times:
        timing.happened(float(t))
    return timing


@settings(max_examples=50)
@given(intervals, intervals)
def test_windows_do_not_mix(first, second):
    """An interval belongs to the window in which it ended."""
    timing, t = EventTiming(START, WINDOW), START
    last: list[float] = []
    for lengths in (first, second):
        begin, ends = t, t + np.cumsum(lengths)
        for end in ends:
            timing.happened(float(end))
        t = max(float(ends[-1]), begin + WINDOW) + 0.01
        seen, between = timing.last_window(t), np.diff([*last, *ends])
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
    timing = timing_of(START + np.cumsum(first))
    assert timing.late == 0  # there is no reference interval yet
    end = START + sum(first)
    usual = np.diff(START + np.cumsum(first)).mean()
    timing.last_window(START + max(WINDOW, sum(first)))
    for t in end + np.cumsum(second):
        timing.happened(float(t))
    between = np.diff(np.concatenate([[end], end + np.cumsum(second)]))
    assume((np.abs(between - 1.5 * usual) > 1e-9).all())
    assert timing.late == (between > 1.5 * usual).sum()


def test_a_window_is_summed_up_when_it_is_over_and_not_before():
    timing = timing_of(START + np.arange(1, 100) * 0.005)
    assert timing.last_window(START + 0.999 * WINDOW) == Timing()
    seen = timing.last_window(START + WINDOW)
    assert seen.rate == pytest.approx(98.0)
    assert timing.last_window(START + 1.5 * WINDOW) == seen == timing.timing
    assert timing.last_window(START + 2.0 * WINDOW) == Timing()  # no event since
    timing.happened(START + 3.0)
    assert timing.late == 0  # until an interval is known
