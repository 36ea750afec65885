# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Which reversals of the velocity are bounces off a surface, and the motion towards it."""

from collections.abc import Callable
from functools import partial

from hypothesis import given, settings
from hypothesis import strategies as st
from lock_step_loop import FIRST_STAMP, MS
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.bounce import Bounce

SPRING = 5.0
"""[m/s²] towards the surface."""
seeds = given(seed=st.integers(0, 10_000))
few = settings(max_examples=20)


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


def inertia(rng: np.random.Generator) -> FloatArray:
    A = rng.normal(size=(4, 4))
    return np.asarray(A @ A.T + np.eye(4))


@few
@seeds
def test_bounces_are_found_in_any_direction_and_the_approach_is_towards_the_surface(seed):
    rng = np.random.default_rng(seed)
    M, normal, period = inertia(rng), rng.normal(size=4), rng.uniform(0.03, 0.06)
    rise = np.linalg.solve(M, normal)  # the change of velocity by an impulse along `normal`
    rise /= np.sqrt(rise @ M @ rise)
    assert all(bounces(
        lambda t: rise * SPRING * (0.5 * period - t % period), M,
        lambda t: -SPRING * rise)[50:])
    one, stamp = Bounce(4), FIRST_STAMP
    for k in range(3):
        assert one.is_near == (k == 3)
        for speed, ms in ((-0.1, 40), (0.1, 4)):  # the spring reverses the rise in 40 ms
            stamp += ms * MS
            one.take(stamp, speed * rise, -speed * rise, M, lambda: -SPRING * rise)
    v = rng.normal(size=4)
    assert one.is_near
    assert normal @ (v - one.approach(v)) == pytest.approx(max(normal @ v, 0.0), abs=1e-9)
    for ms, is_near in ((79, True), (81, False)):  # after the last impact
        one.take(stamp + ms * MS, v, -v, M, lambda: 100.0 * v)
        assert one.is_near == is_near
    assert one.approach(v) == 0.0


@few
@seeds
def test_an_oscillation_is_no_bounce(seed):
    """Neither one that the feedback explains, nor that of a gearbox."""
    rng = np.random.default_rng(seed)
    M, mode, frequency = inertia(rng), rng.normal(size=4), rng.uniform(2.0, 60.0)

    def wave(t: float) -> FloatArray:
        return np.asarray(mode * np.sin(2.0 * np.pi * frequency * t))

    assert not any(bounces(wave, M, lambda t: (wave(t + 1e-6) - wave(t - 1e-6)) / 2e-6))
    assert not any(bounces(wave, M, lambda t: 0.0 * mode))


@pytest.mark.parametrize('n', [1, 2, 6])
def test_noise_of_the_velocity_is_rarely_a_bounce(n):
    rng = np.random.default_rng(n)
    noise = rng.normal(size=(250, n))
    found = bounces(lambda t: noise[round(250.0 * t)], np.eye(n), lambda t: np.zeros(n))
    assert np.mean(found) < 0.2
