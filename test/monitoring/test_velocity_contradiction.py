# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What a velocity that contradicts its position is called."""

import pytest
from robot_dynamics.monitoring.velocity_contradiction import describe

ZERO, SIGN, DEGREES, STILL = (
    ': velocity is zero or missing', ': wrong sign', ': degrees instead of radians?',
    ': the position does not move')


@pytest.mark.parametrize(('factor', 'cause'), [
    (0.0, ZERO), (-0.09, ZERO), (0.11, ': 0.11 times'), (-0.11, SIGN), (-3.9, SIGN),
    (-4.1, ': -4.1 times'), (19.0, ': 19 times'), (21.0, DEGREES), (-57.3, 'about -57 times'),
    (74.0, DEGREES), (75.4, ': 75 times'), (990.0, ': 9.9e+02 times'), (1000.4, STILL)])
def test_the_cause_follows_from_the_ratio_to_the_displacement(factor, cause):
    words = describe('a', 0.1, 0.05 * factor, 0.05, 0.5 * factor, None)
    assert cause in words
    assert f"velocity of 'a' is {0.5 * factor:.2g}, " in words
    assert 'moved by 0.05 in 100 ms: ' in words
    # after a reversal the paths state it
    assert cause in describe('a', 0.1, 0.35, 0.05, 0.05, factor)


def test_the_last_velocity_decides_if_the_window_contains_true_ones():
    assert ZERO in describe('a', 0.1, 0.007, 0.01, 0.0, 0.7)
    for length, cause in ((0.018, SIGN), (0.022, ': 0.5 times')):
        assert cause in describe('a', length, 0.005, 0.01, -0.01 / length, None)
    assert ': 2 times' in describe('a', 0.018, 0.02, 0.01, 0.01 / 0.018, None)
    assert STILL in describe('a', 0.01, 0.05, 0.0, -5.0, None)
