# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Samples that repeat: joints that are frozen, that stand, and drivers that are slow."""

from consistency_signals import (
    alarms,
    at_rest,
    consistency,
    FINE,
    KINDS,
    N,
    NAMES,
    no_alarm,
    regular,
    row_of,
    sampled,
    SECOND,
    States,
)
import numpy as np
import pytest
from robot_dynamics.monitoring.motion_consistency import MotionConsistency


def freeze(
    joints: list[int], speed: float, rate: int, begin: float = 1.5, end: float = 9.0,
    with_velocity: bool = True, with_reference: bool = True, continues: bool = True,
) -> tuple[float | None, MotionConsistency]:
    """
    Return the time [s] from the beginning of the repetition until a joint is frozen.

    `continues` is false to end there.
    """
    t = np.arange(0.0, 4.0, FINE)
    v = speed * np.clip((t - 1.0) / 0.4, 0.0, 1.0)[:, None] * np.array([1.0, -0.8, 0.6])
    q = np.cumsum(FINE * v, axis=0)
    states = sampled(t, q, v, regular(t, rate))
    rows = np.flatnonzero((states.stamps >= (1.0 + begin) * SECOND) & (
        states.stamps < (1.0 + end) * SECOND))
    reference = states.q.copy()
    for x in (states.q, states.v):
        x[np.ix_(rows, joints)] = x[rows[0], joints]
    one, found = consistency(), None
    for k, stamp in enumerate(states.stamps.tolist()):
        is_good = one.update(
            stamp, states.q[k], states.v[k] if with_velocity else None,
            row_of(reference if with_reference else None, k))
        if not is_good and found is None:
            found = 1e-9 * (stamp - float(states.stamps[rows[0]]))
            assert one.frozen.any()
        assert not one.doubtful.any()
        if found is not None and not continues:
            break
    return found, one


@pytest.mark.parametrize(('rate', 'joints'), [(100, [0]), (1000, [1, 2]), (500, [0, 1, 2])])
def test_a_joint_that_freezes_in_motion_is_found(rate, joints):
    found, one = freeze(joints, 1.0, rate)
    assert found < 0.03
    assert np.flatnonzero(one.frozen).tolist() == joints
    assert 'have not changed for ' in one.reason
    since = 1e-9 * one.repeats_since_ns[joints]
    assert since == pytest.approx(np.full(len(joints), 2.5), abs=max(0.003, 1.01 / rate))
    assert (np.delete(one.repeats_since_ns, joints) < 0).all()


@pytest.mark.parametrize('joints', [[0], [0, 1, 2]])
@pytest.mark.parametrize('with_velocity', [True, False])
def test_a_sample_that_repeats_at_rest_is_frozen_when_its_reference_moves(joints, with_velocity):
    found, one = freeze(joints, 1.0, 500, begin=0.5, with_velocity=with_velocity, continues=False)
    assert found is not None
    assert np.flatnonzero(one.frozen).tolist() == [0]  # its reference is the fastest
    assert 'reference moved by 0.03' in one.reason
    found, _ = freeze(joints, 1.0, 500, begin=0.5, end=1.0, with_velocity=with_velocity)
    assert found is None
    if joints == [0, 1, 2]:
        found, _ = freeze(joints, 1.0, 500, 0.5, 9.0, with_velocity, with_reference=False)
        assert found is None


def test_a_joint_that_is_frozen_at_rest_stays_frozen_until_its_sample_changes():
    """Also when its reference stops, or has ended."""
    one, q = consistency(), np.zeros(N)
    reference = 0.2 * np.clip(np.arange(1500) / 500.0, 0.0, 1.0)[:, None] * np.array([1.0, 0, 0])
    good = [one.update(k * SECOND // 500, q, q, row_of(
        reference if k < 1000 else None, k)) for k in range(1500)]
    assert not any(good[good.index(False):])
    one.restart()
    assert not one.update(3 * SECOND - 1, q, q, row_of(None, 0))
    assert one.update(3 * SECOND, q + 1e-9, q, row_of(None, 0))
    assert not one.frozen.any()


@pytest.mark.parametrize('rate', [100, 1000])
def test_a_joint_at_rest_whose_noise_ends_is_frozen(rate):
    """Nothing holds a joint without friction if its signal is lost at rest."""
    states = at_rest(np.random.default_rng(0), rate)
    k = 2 * rate
    states.q[k:, 0], states.v[k:, 0] = states.q[k, 0], states.v[k, 0]
    one = consistency()
    row, reason = next(alarms(one, states, np.zeros_like(states.q)))
    assert one.frozen.tolist() == [True] + [False] * (N - 1)
    assert 0.02 < (row - k) / rate < 0.07
    assert "'joint1' have not changed for" in reason


@pytest.mark.parametrize(('kind', 'moved', 'stands'), [
    ('revolute', 0.027, True), ('revolute', 0.033, False),
    ('prismatic', 0.009, True), ('prismatic', 0.011, False)])
def test_a_joint_stands_while_its_reference_is_near(kind, moved, stands):
    """Within 0.03 rad or 0.01 m; its velocity is zero with rounding."""
    one, q, v = consistency((kind,) * N), np.full(N, 0.7), np.full(N, 1e-16)
    reference = q + moved * np.clip(
        np.arange(1000) / 500.0, 0.0, 1.0)[:, None] * np.array([1.0, -1.0, 0.0])
    is_good = [one.update(k * SECOND // 500, q, v, row_of(reference, k)) for k in range(1000)]
    assert all(is_good) == stands


def test_a_joint_may_stick_as_far_as_dry_friction_can_hold_it():
    held, q = np.array([0.15, 0.0, 0.0]), np.full(N, 0.7)
    one = MotionConsistency(
        NAMES, KINDS, lambda at, error: (np.abs(error) <= held) & (at == q))
    reference = q + np.linspace(0.0, 0.2, 1000)[:, None] * np.array([1.0, 0.1, 0.0])
    is_good = [one.update(k * SECOND // 500, q, np.zeros(N), row_of(reference, k))
               for k in range(1000)]
    assert reference[is_good.index(False), 0] - q[0] == pytest.approx(0.15, abs=5e-3)


@pytest.mark.parametrize(('speed', 'rate'), [(0.01, 500), (0.05, 125), (0.3, 1000)])
def test_coarse_encoders_repeat_samples_of_a_slow_joint(speed, rate):
    """The reference is ahead by 20 ms; positions by 1 mrad and velocities by 0.01 rad/s."""
    t = np.arange(0.0, 4.0, FINE)
    v = speed * np.sin(np.pi * np.maximum(t - 1.0, 0.0))[:, None] * np.ones(N)
    q = np.cumsum(FINE * v, axis=0)
    times = regular(t, rate)[:-1]
    ahead = sampled(t, q, v, np.minimum(times + 0.02, t[-1])).q
    states = sampled(t, q, v, times)
    no_alarm(States(
        states.stamps, 1e-3 * np.round(1e3 * states.q), 0.01 * np.round(1e2 * states.v)), ahead)


@pytest.mark.parametrize('speed', [0.2, 1.0])
@pytest.mark.parametrize(('usual', 'allowed'), [(0, 0.01), (20, 0.04), (40, 0.08), (55, 0.11)])
def test_a_driver_may_repeat_a_sample_twice_as_long_as_usual(usual, allowed, speed):
    """And until a joint with this velocity, less 0.02 rad/s, has moved by 3 mrad; in ms."""
    v, every = speed * np.minimum(np.arange(2000) / 1000.0, 1.0)[:, None], max(usual, 1)
    begin = 1500 // every * every
    rows = np.minimum(np.arange(2000) // every * every, begin)
    row, reason = next(alarms(consistency(('revolute',)), States(
        np.arange(2000) * SECOND // 1000, 1e-3 * np.cumsum(v, axis=0)[rows], v[rows])))
    expected = allowed + 0.003 / (speed - 0.02)
    assert -1e-6 < 1e-3 * (row - begin) - expected <= 0.007
    assert f'have not changed for {row - begin} ms: velocity {speed:.2g}, reference' in reason


def test_a_driver_that_repeats_samples_for_more_than_60_ms_is_not_known():
    rows = np.arange(1000) // 65 * 65
    row, _ = next(alarms(consistency(('revolute',)), States(
        np.arange(1000) * SECOND // 1000, 1e-3 * rows[:, None], np.ones((1000, 1)))))
    assert row < 65
