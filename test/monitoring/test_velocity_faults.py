# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Measured velocities that contradict the positions: detection, marks and causes."""

from collections.abc import Callable
import itertools
import math

from consistency_signals import (
    alarms,
    consistency,
    FINE,
    KINDS,
    N,
    regular,
    sampled,
    SECOND,
    States,
)
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.monitoring.motion_consistency import MotionConsistency

# --- detection -----------------------------------------------------------------------------------

FAULTS: dict[str, tuple[Callable[[FloatArray], FloatArray], str]] = {
    'wrong sign': (lambda v: -v, 'wrong sign'),
    'zeros': (lambda v: 0.0 * v, 'zero or missing'),
    'degrees': (np.degrees, 'degrees instead of radians'),
    'double': (lambda v: 2.0 * v, 'times the displacement'),
    'half': (lambda v: 0.5 * v, 'times the displacement'),
}


def faulty(
    fault: str, speed: float, rate: int, noise: float, seed: int, begin: float = 1.5,
) -> tuple[float, float, MotionConsistency]:
    """Return duration and displacement of the first joint until its fault is found."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 4.0, FINE)
    v = speed * np.clip((t - 1.0) / 0.4, 0.0, 1.0)[:, None] * np.array([1.0, -0.5, 0.3])
    q = np.cumsum(FINE * v, axis=0)
    states = sampled(t, q, v, regular(t, rate))
    states = states._replace(v=states.v + rng.normal(0.0, noise, states.v.shape))
    is_faulty = states.stamps >= (1.0 + begin) * SECOND
    states.v[is_faulty, 0] = FAULTS[fault][0](states.v[is_faulty, 0])
    one = consistency()
    k, _ = next(alarms(one, states), (0, ''))
    assert k > 0, 'not found'
    first = int(np.argmax(is_faulty))
    return 1e-9 * float(states.stamps[k] - states.stamps[first]), abs(
        float(states.q[k, 0] - states.q[first, 0])), one


@pytest.mark.parametrize(('noise', 'sign', 'zeros'), [(0.0, 0.005, 0.012), (0.2, 0.010, 0.025)])
@pytest.mark.parametrize(('speed', 'rate'), [(0.5, 250), (1.0, 500), (2.0, 1000)])
def test_faults_are_found_within_a_small_displacement(noise, sign, zeros, speed, rate):
    """The displacement [rad] at constant speed, plus that of one period."""
    for seed, (fault, allowed) in itertools.product(
            range(2), {'wrong sign': sign, 'degrees': sign, 'zeros': zeros}.items()):
        allowed *= 1.0 if noise == 0.0 else max(1.0, 1.0 / speed) * math.sqrt(500.0 / rate) + 0.5
        _, moved, one = faulty(fault, speed, rate, noise, seed)
        assert moved <= allowed + 1.01 * speed / rate, fault
        assert one.doubtful.tolist() == [True, False, False]
        assert not one.frozen.any()


@pytest.mark.parametrize('fault', FAULTS)
def test_the_cause_is_named_in_motion_from_rest(fault):
    duration, moved, _ = faulty(fault, 1.0, 100, 0.0, 0)
    assert max(duration, moved) < 0.1
    _, moved, one = faulty(fault, 1.0, 100, 0.0, 0, begin=0.0)
    assert moved < 0.25
    assert one.doubtful.tolist() == [True, False, False]
    assert "velocity of 'joint1' is " in one.reason
    assert FAULTS[fault][1] in one.reason


@pytest.mark.parametrize(('rate', 'speed', 'begins'), [
    (100, 0.31, True), (1000, 0.31, True), (100, 0.3, False), (500, 3.0, False)])
def test_zeros_are_found_soon_in_motion_and_after_a_start(rate, speed, begins):
    """
    A joint with a low velocity limit must not accelerate for long.

    After a start it has left 3 mrad for longer than a filter would delay the first velocity.
    """
    t = np.arange(0.0, 2.5, 1.0 / rate)
    q = speed * (t if begins else np.maximum(t - 2.0, 0.0))[:, None]
    v = np.where((t < 2.0)[:, None] & begins, speed, 0.0 * q)
    row, _ = next(alarms(consistency(KINDS[:1]), States(
        SECOND + np.round(1e9 * t).astype(np.int64), q, v)))
    found = t[row] - 2.0
    assert 0.0 < found < (0.02 if begins else 0.025 + 0.003 / speed) + 2.01 / rate
    assert begins or found > 0.02


@pytest.mark.filterwarnings('ignore:overflow', 'ignore:invalid value')
@pytest.mark.parametrize('value', [1e200, 1e308, math.inf, math.nan])
def test_velocities_beyond_all_numbers_are_in_doubt(value):
    one = consistency()
    for k in range(100):
        one.update(k * SECOND // 500, np.full(N, 1e-5 * k), np.array(
            [value if 50 <= k < 53 else 5e-3, 5e-3, 5e-3]))
    assert one.doubtful.tolist() == [True, False, False]
    assert one.reason


# --- marks ------------------------------------------------------------------------------------

def moving(one, begin, end, speed, factor):
    """Move the first joint; return the time [s] at which no joint was in doubt, or `end`."""
    for k in range(round(500 * begin), round(500 * end)):
        v = np.array([speed, 0.0, 0.0])
        if one.update(SECOND + k * SECOND // 500, k / 500 * v, factor * v) and factor > 0.0:
            return k / 500
    return end


def test_a_doubt_lasts_until_the_velocity_agrees_in_motion():
    one = consistency()
    moving(one, 0.0, 0.5, 1.0, -1.0)
    assert one.doubtful.tolist() == [True, False, False]
    one.restart()
    assert one.doubtful.tolist() == [True, False, False]
    assert moving(one, 1.0, 5.0, 0.0, 1.0) == 5.0
    agreed = moving(one, 6.0, 9.0, 1.0, 1.0)
    assert 1.0 < agreed - 6.0 < 1.3
    assert one.is_consistent


@pytest.mark.parametrize('gap', [0.105, -0.5])
def test_after_a_gap_of_100_ms_the_positions_may_be_anywhere(gap):
    one = consistency()
    moving(one, 1.0, 2.0, 0.5, 1.0)
    for k in range(100):
        stamp = SECOND + round((1.998 + gap) * SECOND) + k * SECOND // 500
        assert one.update(
            stamp, np.array([7.0 + 1e-3 * k, 0.0, 0.0]), np.array([0.5, 0.0, 0.0]))


def test_states_without_velocities_are_never_in_doubt():
    one = consistency()
    assert one.is_consistent is True
    for k in range(500):
        q = np.full(N, 2e-3 * k)
        assert one.update(k * SECOND // 500, q, None if k % 400 < 200 else np.ones(N))


# --- the cause that the reason names -------------------------------------------------------------

def first_reason(q: FloatArray, v: FloatArray, rate: float) -> str:
    """Return the reason of the first alarm for one joint, whose samples are (m,)."""
    one = consistency(('revolute',))
    stamps = np.rint(np.arange(len(q)) * SECOND / rate).astype(np.int64)
    _, reason = next(alarms(one, States(stamps, q[:, None], v[:, None])))
    return reason


@pytest.mark.parametrize(('factor', 'cause'), [
    (-1.0, 'wrong sign'), (2.5, ' times the displacement'), (0.0, 'zero or missing')])
def test_the_cause_is_named_in_motion_that_reverses(factor, cause):
    t, omega = np.arange(0.0, 2.0, 0.002), 2.0 * np.pi * 6.0
    q, v = 0.02 * np.sin(omega * t), 0.02 * omega * np.cos(omega * t)
    true = t < 1.0 + 1.0 / 24.0  # a reversal
    assert cause in first_reason(q, np.where(true, v, factor * v), 500.0)
