# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Joint-by-joint tracking of a segment equals the feedback law applied to a sample of it."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import wrap_angle, wrap_to_pi
from robot_dynamics.control.control_law import ErrorFeedback, Gains, make_gains
from robot_dynamics.control.segment_tracking import FEW, TrackingLaw
from robot_dynamics.trajectories.follower import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

SECOND = 1_000_000_000


def segment_of(n: int, kind: str, rng: np.random.Generator) -> ActiveTrajectory:
    names = [f'joint{j}' for j in range(n)]
    p, v, a = rng.uniform(-3.0, 3.0, (3, 2, n))
    v[-1] = 0.0  # the end position is held
    p, v, a = p.tolist(), v.tolist(), a.tolist()
    trajectory = make_trajectory(
        names, (0.0, 2.0), p, v if kind != 'linear' else (), a if kind == 'quintic' else (), names)
    return ActiveTrajectory(trajectory, SECOND, SECOND, Reference(*np.zeros((3, n))))


@settings(deadline=None, derandomize=True, max_examples=100)
@given(
    n=st.integers(1, FEW), kind=st.sampled_from(['linear', 'cubic', 'quintic']),
    joint=st.sampled_from(['revolute', 'continuous', 'prismatic']), seed=st.integers(0, 2**32 - 1),
    phase=st.floats(0.0, 0.999), has_damping=st.booleans())
def test_it_commands_the_acceleration_of_the_feedback_law(
    n: int, kind: str, joint: str, seed: int, phase: float, has_damping: bool,
) -> None:
    rng = np.random.default_rng(seed)
    active = segment_of(n, kind, rng)
    kp, kd = rng.uniform(0.1, 400.0, (2, n))
    feedback = ErrorFeedback(
        Gains(kp, kd * has_damping), [joint] * n)
    q, v = rng.uniform(-9.0, 9.0, (2, n))
    now = SECOND + round(2e9 * phase)
    segment = active.segment(now)
    assert segment is not None
    tracked = TrackingLaw(segment, feedback).at(now, q, v)
    reference = active.sample(now)
    assert tracked.acceleration == pytest.approx(
        feedback.acceleration(reference, q, v), rel=1e-9, abs=1e-8)
    assert tracked.velocity == pytest.approx(
        feedback.reference_velocity(reference, q), rel=1e-9, abs=1e-8)


def test_a_segment_is_active_from_the_arrival_to_the_end() -> None:
    names = ['joint']
    trajectory = make_trajectory(names, (0.0, 1.0, 3.0), [[0.0], [1.0], [2.0]], (), (), names)
    late = ActiveTrajectory(trajectory, 0, SECOND // 2, Reference(*np.full((3, 1), 7.0)))
    assert late.segment(SECOND // 4) is None
    assert late.sample(SECOND // 4).position.tolist() == [7.0]
    first = late.segment(SECOND // 2)
    assert first is not None
    assert first is late.segment(SECOND - 1)
    assert late.sample(SECOND // 2).position.tolist() == [0.5]
    assert late.segment(SECOND // 4) is None  # also if the clock jumps back
    second = late.segment(SECOND)
    assert second is not None
    assert second is not first
    assert second.phase(2 * SECOND) == 0.5
    assert late.segment(3 * SECOND) is None


@pytest.mark.parametrize('size', [1e-3, 1.0, 3.0, math.pi, 4.0, 30.0, 1e6])
def test_one_angle_is_wrapped_as_many_are(size: float) -> None:
    for angle in (size, -size):
        assert wrap_angle(angle) == pytest.approx(float(wrap_to_pi(np.array(angle))), abs=1e-9)


@pytest.mark.parametrize('place', [math.inf, -math.inf, math.nan, 1e308])
def test_an_overflow_gives_non_finite_values_and_does_not_raise(place: float) -> None:
    active = segment_of(2, 'quintic', np.random.default_rng(0))
    segment = active.segment(SECOND)
    assert segment is not None
    feedback = ErrorFeedback(make_gains(['a', 'b']), ['continuous', 'revolute'])
    tracked = TrackingLaw(segment, feedback).at(
        SECOND, np.full(2, place), np.full(2, -place))
    assert not np.isfinite(tracked.acceleration[1])
