# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Streams of set-points are followed within limits, smoothly and with little lag."""

import numpy as np
import pytest
from robot_dynamics.references.motion_limits import MotionLimits
from sampled_references import (
    AMPLITUDE,
    at,
    generator,
    limits_of,
    NOW,
    ns,
    OMEGA,
    ramp,
    samples,
    SECOND,
    set_point,
    sine,
    stream,
    TOLERANCE,
    ZERO,
)

CORRECTION = 0.05
"""Shortest time [s] in which a deviation from a moving set-point is corrected."""

# --- streams with velocities ---------------------------------------------------------------------

@pytest.mark.parametrize('rate', [50, 500])
def test_a_stream_with_velocities_is_followed_with_one_period_of_delay(rate):
    h = 1.0 / rate
    found = stream(generator(), sine, h, 0.8, True).after(0.4)
    exact = [sine(t - h) for t in found.t.tolist()]
    q, v = (np.array(x) for x in zip(*exact))
    a = -OMEGA**2 * q
    largest_jerk = AMPLITUDE * OMEGA**3
    # The acceleration is a difference of velocities, delayed by half a period. Deviations are
    # corrected in 0.05 s, with a jerk of 32 times the deviation per cube of that time.
    T = max(h, CORRECTION)
    assert np.abs(found.q - q).max() < largest_jerk * T**3 / 32.0
    assert np.abs(found.v - v).max() < largest_jerk * T**2 / 10.0
    assert np.abs(found.a - a).max() < largest_jerk * (0.6 * h + 0.15 * T)
    assert found.jerk < 4.0 * largest_jerk


@pytest.mark.parametrize('rate', [50, 500])
def test_a_stream_with_accelerations_is_followed_more_closely(rate):
    h, one = 1.0 / rate, generator()
    for i in range(round(0.6 / h)):
        q, v = sine(i * h)
        one.start(set_point(q, v, -OMEGA**2 * q), ns(i * h), q, v)
    found = samples(one, 0.6 - h, 0.6 - 1e-6, 20)
    exact = np.array([sine(t - h)[0] for t in found.t.tolist()])
    largest_jerk = AMPLITUDE * OMEGA**3
    assert np.abs(found.q - exact).max() < largest_jerk * CORRECTION**3 / 32.0
    assert np.abs(found.a + OMEGA**2 * exact).max() < 0.1 * largest_jerk * CORRECTION


@pytest.mark.parametrize(('rate', 'end'), [(50, 0.5), (200, 0.9)])
def test_the_end_of_a_stream_with_velocities_is_a_planned_stop(rate, end):
    one, limits = generator(), limits_of()
    stream(one, sine, 1.0 / rate, end, True)
    active = one.active
    stopped = (active.end_ns - NOW) / SECOND
    found = samples(one, end - 1.0 / rate, stopped + 0.1)
    assert stopped - end < one.stream_timeout + 1.0
    assert (np.abs(found.a) <= 2.0 * limits.acceleration).all()
    assert found.jerk <= 2.0 * limits.jerk[0]
    assert not at(one, stopped).velocity.any()
    # The speed decreases as soon as the acceleration is removed, with the limit of the jerk.
    later = found.after(end + one.stream_timeout + limits.acceleration[0] / limits.jerk[0])
    speed = np.abs(later.v)
    assert (np.diff(speed, axis=0) <= 1e-6).all()


# --- streams of positions ------------------------------------------------------------------------

def stated_lag(h: float, speed: float, limits: MotionLimits) -> float:
    """
    Return the largest lag [s] behind a ramp of this speed.

    The plan of each period ends at rest. Its duration T is 0.1 s, four periods, or twice that of
    the earliest stop. The lag is 2/3 of T, and one period.
    """
    return float(2.0 / 3.0 * max(0.1, 4.0 * h, 2.0 * stop_time(speed, limits)) + h)


def stop_time(speed: float, limits: MotionLimits) -> float:
    a, jerk = limits.acceleration[0], limits.jerk[0]
    return float(speed / a + a / jerk if speed > a**2 / jerk else 2.0 * np.sqrt(speed / jerk))


@pytest.mark.parametrize('limits', [limits_of(), limits_of(a=100.0, j=10_000.0)])
@pytest.mark.parametrize('rate', [10, 50, 500])
def test_a_ramp_of_positions_is_followed_smoothly_with_the_stated_lag(rate, limits):
    """It is that of the horizon where the limits do not matter."""
    h = 1.0 / rate
    everything = stream(generator(limits), ramp, h, 1.0, False)
    found = everything.after(0.8)
    lag = (ramp(1.0)[1] * found.t[:, np.newaxis] - found.q) / ramp(1.0)[1]
    assert (lag > 0.0).all()
    assert lag.max() <= stated_lag(h, 0.2, limits)
    assert lag[:, 0].max() >= stated_lag(h, 0.2, limits) - h - 1e-4
    assert found.v[:, 0] == pytest.approx(0.2, rel=0.02)
    assert np.abs(everything.v).max() <= TOLERANCE * limits.velocity[0]
    assert np.abs(everything.a).max() <= TOLERANCE * limits.acceleration[0]
    assert everything.jerk <= TOLERANCE * limits.jerk[0]


@pytest.mark.parametrize(('rate', 'distance'), [(2, 2.0), (10, 0.3), (50, 2.0), (200, 0.02)])
def test_a_set_point_that_is_repeated_is_reached_exactly_without_overshoot(rate, distance):
    goal, one = np.array((distance, -0.5 * distance)), generator()
    end = 1.5 + 2.0 * distance
    found = stream(one, lambda t: (goal, ZERO), 1.0 / rate, end, False)
    assert found.q[0] != pytest.approx(goal)
    last = at(one, end)
    assert last.position == pytest.approx(goal, abs=1e-12)
    assert not last.velocity.any()
    assert (found.q / goal).max() <= 1.0 + 1e-9
    assert (np.diff(found.q / goal, axis=0) >= -1e-9).all()
