# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Which reversals of the velocity are bounces off a surface, and the motion towards it."""

from collections.abc import Callable
from functools import partial

from lock_step_loop import FIRST_STAMP, MS
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.bounce import Bounce


def bounces(
    velocity: Callable[[float], FloatArray], M: FloatArray, a: Callable[[float], FloatArray],
) -> list[bool]:
    """Return whether each of 250 states, every 4 ms, is near a bounce; the reference rests."""
    one, found = Bounce(len(M)), []
    for k in range(250):
        v = velocity(0.004 * k)
        one.take(FIRST_STAMP + 4 * k * MS, v, -v, M, partial(a, 0.004 * (k - 0.5)))
        found.append(one.is_near)
    return found


@pytest.mark.parametrize('n', [1, 2, 6])
def test_noise_of_the_velocity_is_rarely_a_bounce(n):
    rng = np.random.default_rng(n)
    noise = rng.normal(size=(250, n))
    found = bounces(lambda t: noise[round(250.0 * t)], np.eye(n), lambda t: np.zeros(n))
    assert np.mean(found) < 0.2
