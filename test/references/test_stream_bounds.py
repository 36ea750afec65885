# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Random streams: references are continuous and within limits, also between samples."""

from collections.abc import Iterator
import math
import random
from typing import NamedTuple

import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.references.jerk_profile import end, Extremes, extremes
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.references.reference_generator import ReferenceGenerator
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from sampled_references import ns, SECOND

NAMES = ('a', 'b', 'c')
N = len(NAMES)
SILENCE = 1.0
"""[s] after the last set-point."""
HULL = 1e-8
RATIO = 1.001
CONTINUOUS = 1e-7
"""Largest step of velocity and acceleration, in fractions of their limits, and of position."""

counts = pytest.mark.parametrize('count', [6, pytest.param(1_000, marks=pytest.mark.soak)])


class SetPoint(NamedTuple):
    time: float
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    def message(self, has_velocity: bool, has_acceleration: bool) -> JointTrajectory:
        return make_trajectory(
            NAMES, [0.0], [self.position], [self.velocity] if has_velocity else (),
            [self.acceleration] if has_acceleration else ())


def random_limits(r: random.Random) -> MotionLimits:
    v = np.array([10.0 ** r.uniform(-0.3, 0.5) for _ in NAMES])
    a = v / [r.uniform(0.2, 1.0) for _ in NAMES]
    jerk = a / [r.uniform(0.05, 0.2) for _ in NAMES]
    size = np.array([r.uniform(0.3, 1.0) for _ in NAMES])
    return MotionLimits(-size, size, v, a, jerk)


def random_stream(r: random.Random, limits: MotionLimits) -> Iterator[SetPoint]:
    """Yield sines with gaps, jitter and jumps, at 20 to 500 Hz, within the position limits."""
    period = 1.0 / r.choice([20.0, 50.0, 100.0, 200.0, 500.0])
    jitter, gaps, jumps = r.choice([0.0, 0.1, 0.5]), r.choice([0.0, 0.05]), r.choice([0.0, 0.02])
    omega, phase = r.uniform(0.5, 6.0), np.array([r.uniform(0.0, 7.0) for _ in NAMES])
    t = 0.0
    for _ in range(r.randint(5, 60)):
        x = omega * t + phase
        yield SetPoint(t, limits.upper * np.sin(x), limits.upper * omega * np.cos(x),
                       -limits.upper * omega**2 * np.sin(x))
        t += period * (1.0 + r.uniform(-jitter, jitter))
        if r.random() < gaps:
            t += period * r.randint(1, 12)
        if r.random() < jumps:
            phase = phase + r.uniform(-2.0, 2.0)


class Walk:
    """Exact extremes and continuity of the references that are followed."""

    def __init__(self, limits: MotionLimits) -> None:
        self._sizes = np.array([np.ones(N), limits.velocity, limits.acceleration])
        self._last: FloatArray | None = None

    def along(self, active: ActiveTrajectory, since_ns: int, until_ns: int) -> (
            Iterator[tuple[int, Extremes, float]]):
        """Yield joint, extremes and jerk of each segment; check that nothing steps."""
        while since_ns < until_ns:
            segment = active.segment(since_ns)
            end_ns, T = min(segment.end_ns, until_ns), segment.duration
            c = segment.coefficients[:, :N]
            assert not c[4:].any()
            jerk = 6.0 * c[3] / T**3
            first, last = np.empty((3, N)), np.empty((3, N))
            for j in range(N):
                begin = float(c[0, j]), float(c[1, j] / T), float(2.0 * c[2, j] / T**2)
                times = [(x - segment.begin_ns) / SECOND for x in (since_ns, end_ns)]
                state = end([(times[0], jerk[j])], *begin)
                yield j, extremes([(times[1] - times[0], jerk[j])], *state), float(jerk[j])
                first[:, j], last[:, j] = state, end([(times[1], jerk[j])], *begin)
            sampled = active.sample(since_ns)
            for values, expected, size in zip(sampled, first, self._sizes):
                assert (np.abs(values - expected) <= CONTINUOUS * size).all()
            if self._last is not None:
                assert (np.abs(first - self._last) <= CONTINUOUS * self._sizes).all()
            self._last, since_ns = last, end_ns


def walk(
    r: random.Random, limits: MotionLimits, has_velocity: bool, has_acceleration: bool = False,
) -> Iterator[tuple[int, Extremes, float, FloatArray]]:
    """Yield joint, extremes and jerk of all segments of a stream, and all goals until then."""
    one, checked = ReferenceGenerator(NAMES, (), limits), Walk(limits)
    start = 0.9 * limits.upper * [r.uniform(-1.0, 1.0) for _ in NAMES]
    points = list(random_stream(r, limits))
    goals = [start]
    for point, following in zip(points, [*points[1:], None]):
        if r.random() < 0.05:
            one.limits = limits.slower(r.choice([1.0, r.uniform(0.1, 1.0)]))
        goals.append(point.position)
        now_ns = ns(point.time)
        one.start(point.message(has_velocity, has_acceleration), now_ns, start, 0.0 * start)
        until = point.time + SILENCE if following is None else following.time
        for j, found, jerk in checked.along(one.active, now_ns, ns(until)):
            yield j, found, jerk, np.array(goals)[:, j]


@counts
def test_a_stream_of_positions_never_leaves_the_hull_of_its_set_points(count):
    for seed in range(count):
        r = random.Random(seed)
        limits = random_limits(r)
        for j, found, jerk, goals in walk(r, limits, False):
            assert goals.min() - HULL <= found.q_min <= found.q_max <= goals.max() + HULL
            check_limits(found, jerk, limits, j)


@counts
@pytest.mark.parametrize('has_acceleration', [False, True])
def test_a_moving_stream_stays_within_all_limits_also_after_its_end(count, has_acceleration):
    for seed in range(count):
        r = random.Random(seed)
        limits = random_limits(r)
        for j, found, jerk, _ in walk(r, limits, True, has_acceleration):
            assert limits.lower[j] - HULL <= found.q_min <= found.q_max <= limits.upper[j] + HULL
            check_limits(found, jerk, limits.whole, j)


def check_limits(found: Extremes, jerk: float, limits: MotionLimits, j: int) -> None:
    assert all(map(math.isfinite, found))
    assert max(-found.v_min, found.v_max) <= RATIO * limits.velocity[j]
    assert max(-found.a_min, found.a_max) <= RATIO * limits.acceleration[j]
    assert abs(jerk) <= RATIO * limits.jerk[j]
