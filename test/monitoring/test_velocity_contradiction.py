# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What a velocity that contradicts its position is called."""

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.monitoring.velocity_contradiction import describe, reversal_ratio, SHORT

ZERO, SIGN, DEGREES, STILL = (
    ': velocity is zero or missing', ': wrong sign', ': degrees instead of radians?',
    ': the position does not move')
STEPS = st.lists(st.floats(0.01, 1.0), max_size=5)


@given(STEPS, STEPS, st.sampled_from([-1.0, 1.0]), st.floats(1e-4, 10.0), st.one_of(
    st.floats(0.0, 0.69), st.floats(0.71, 1.29), st.floats(1.31, 100.0)))
def test_after_a_reversal_paths_state_the_scale_and_equal_paths_leave_the_sign(
    forth, back, sign, size, scale,
):
    """The way forth and back, at any size; the velocities are the true ones times a factor."""
    way = size * np.concatenate(([2.0], 2.0 + np.cumsum([*forth, *(-x for x in back)])))
    found = reversal_ratio(way, (sign * scale - 1.0) * way)
    path, net = sum(forth) + sum(back), abs(sum(forth) - sum(back))
    if net < 0.89 * path:
        assert found == pytest.approx(-1.0 if 0.7 < scale < 1.3 else scale, abs=1e-6)
    elif net > 0.91 * path:
        assert found is None


@pytest.mark.parametrize('moved', [0.05, -0.05])
@pytest.mark.parametrize(('factor', 'cause'), [
    (0.0, ZERO), (0.09, ZERO), (-0.09, ZERO), (-0.11, SIGN), (-1.0, SIGN), (-3.9, SIGN),
    (0.11, ': 0.11 times'), (0.5, ': 0.5 times'), (-4.1, ': -4.1 times'), (19.0, ': 19 times'),
    (21.0, DEGREES), (57.3, 'about 57 times'), (74.0, DEGREES), (-57.3, 'about -57 times'),
    (75.4, ': 75 times'), (990.0, ': 9.9e+02 times'), (1000.4, STILL), (-1010.0, STILL)])
def test_the_cause_follows_from_the_ratio_to_the_displacement(moved, factor, cause):
    words = describe('a', 0.1, factor * moved, moved, factor * moved / 0.1, None)
    assert cause in words
    assert f"velocity of 'a' is {factor * moved / 0.1:.2g}, " in words
    assert f'moved by {moved} in 100 ms: ' in words
    # after a reversal the paths state it
    assert cause in describe('a', 0.1, 7.0 * moved, moved, moved, factor)


@pytest.mark.parametrize('moved', [0.01, -0.01])
def test_the_last_velocity_decides_if_the_window_contains_true_ones(moved):
    assert ZERO in describe('a', 0.1, 0.7 * moved, moved, 0.0, 0.7)
    for length, cause in ((0.9 * SHORT, SIGN), (1.1 * SHORT, ': 0.5 times')):
        assert cause in describe('a', length, 0.5 * moved, moved, -moved / length, None)
    # the last velocity is -60 times the displacement
    assert 'about -60 times' in describe(
        'a', SHORT, 0.5 * moved, moved, -60.0 * moved / SHORT, None)
    assert ': 2 times' in describe('a', SHORT, 2.0 * moved, moved, moved / SHORT, None)


def test_without_displacement_the_position_does_not_move():
    assert STILL in describe('a', 0.1, 0.05, 0.0, 0.0, None)
    assert STILL in describe('a', 0.01, 0.05, 0.0, -5.0, None)
