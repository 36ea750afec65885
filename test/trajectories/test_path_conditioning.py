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

"""Paths without velocities get velocities; infeasible trajectories are rejected."""

from functools import cache
from itertools import pairwise
import re
from typing import Any

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.interpolation import sample_segment
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.trajectories.motion_limits import MotionLimits, WorkspaceInertia
from robot_dynamics.trajectories.path_conditioning import feasible_trajectory, SLOWEST
from robot_dynamics.trajectories.quintics import quintic_point_to_point, quintic_via_points

NAMES = ('joint1', 'joint2')
ARM = load_arm(default_arm_urdf())
TOLERANCE = 1.04
"""Ratio to a limit between the points, where conditioning samples less densely; 1.026 measured."""

laws = settings(deadline=None, derandomize=True, max_examples=40)
angles = st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=2).map(np.array)


@cache
def dynamics() -> ArmDynamics:
    return ArmDynamics(ARM)


@cache
def limits() -> MotionLimits:
    return WorkspaceInertia(dynamics()).motion_limits(ARM.limits.effort, ARM.limits.effort / 0.1)


def conditioned(sent: JointTrajectory, **options: Any) -> tuple[JointTrajectory, float]:
    return feasible_trajectory(dynamics(), sent, limits(), **options)


def path(times: list[float], q: Any, v: Any = ()) -> JointTrajectory:
    return make_trajectory(NAMES, times, np.asarray(q).tolist(), v, (), NAMES)


def dense(found: JointTrajectory) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Return position, velocity and acceleration of each segment, (m, n) each."""
    parts = []
    for p0, p1 in pairwise(found.points):
        t0, t1 = p0.time_from_start, p1.time_from_start
        rows = [sample_segment(t, t0, p0, t1, p1) for t in np.linspace(t0, t1, 60).tolist()]
        q, v, a = (np.array(x) for x in zip(*rows))
        parts.append((q, v, a))
    return parts


@st.composite
def paths(draw: Any) -> JointTrajectory:
    count = draw(st.integers(2, 6))
    steps = draw(st.lists(st.floats(0.05, 2.0), min_size=count, max_size=count))
    q = draw(st.lists(angles, min_size=count, max_size=count))
    return path(np.cumsum(steps).tolist(), q)


# --- paths without velocities --------------------------------------------------------------------

@laws
@given(paths())
def test_a_path_of_positions_passes_its_points_and_rests_at_both_ends(
    sent: JointTrajectory,
) -> None:
    found, slowness = conditioned(sent)
    assert slowness >= 1.0
    assert len(found.points) == len(sent.points)
    for point, original in zip(found.points, sent.points):
        assert point.position.tolist() == original.position.tolist()
    for end in (found.points[0], found.points[-1]):
        assert end.velocity is not None
        assert end.acceleration is not None
        assert not end.velocity.any()
        assert not end.acceleration.any()


@laws
@given(paths())
def test_a_path_of_positions_keeps_the_proportions_of_its_times(sent: JointTrajectory) -> None:
    found, slowness = conditioned(sent)
    first = sent.points[0].time_from_start
    assert found.points[0].time_from_start == first
    for point, original in zip(found.points, sent.points):
        assert point.time_from_start - first == pytest.approx(
            slowness * (original.time_from_start - first))


@laws
@given(paths())
def test_a_path_of_positions_does_not_overshoot_its_points(sent: JointTrajectory) -> None:
    found, _ = conditioned(sent)
    for q, _, _ in dense(found):
        sign = np.sign(q[-1] - q[0])
        assert (np.diff(q, axis=0) * sign >= -1e-9).all()
        assert (q >= np.minimum(q[0], q[-1]) - 1e-9).all()
        assert (q <= np.maximum(q[0], q[-1]) + 1e-9).all()


@laws
@given(paths())
def test_a_path_of_positions_is_within_the_limits(sent: JointTrajectory) -> None:
    found, _ = conditioned(sent)
    for _, v, a in dense(found):
        assert (np.abs(v) <= TOLERANCE * limits().velocity).all()
        assert (np.abs(a) <= TOLERANCE * limits().acceleration).all()


def test_a_slow_path_of_positions_is_not_slowed_down() -> None:
    found, slowness = conditioned(path([1.0, 5.0, 9.0], [[0.0, 0.0], [0.2, 0.1], [0.3, 0.3]]))
    assert slowness == 1.0
    assert [p.time_from_start for p in found.points] == [1.0, 5.0, 9.0]


# --- trajectories with velocities ----------------------------------------------------------------

@laws
@given(angles, angles, st.floats(8.0, 20.0))
def test_a_feasible_trajectory_is_the_same_object(
    start: FloatArray, goal: FloatArray, duration: float,
) -> None:
    sent = quintic_via_points(NAMES, [0.0, 0.5 * duration, duration],
                              [start, 0.5 * (start + goal), goal])
    assume(efforts_along(dynamics(), sent).feasible)
    for slows_down in (False, True):
        found, slowness = conditioned(sent, slows_down=slows_down)
        assert found is sent
        assert slowness == 1.0


@pytest.mark.parametrize(('duration', 'quantity'), [(0.15, 'velocity'), (0.5, 'effort')])
def test_an_infeasible_trajectory_is_rejected_with_joint_time_and_ratio(
    duration: float, quantity: str,
) -> None:
    sent = quintic_point_to_point(NAMES, [0.0, 0.0], [1.5, 0.2], duration)
    with pytest.raises(TrajectoryError) as caught:
        conditioned(sent)
    found = re.search(
        r"the (\w+) of '(\w+)' is ([\d.]+) times its limit at ([\d.]+) s", str(caught.value))
    assert found is not None
    assert found[1] == quantity
    assert found[2] == 'joint1'
    assert float(found[3]) > 1.0
    assert 0.0 <= float(found[4]) <= duration
    if quantity == 'velocity':
        exact = 1.875 * 1.5 / duration / ARM.limits.velocity[0]
        assert float(found[3]) == pytest.approx(exact, rel=1e-2)
        assert float(found[4]) == pytest.approx(0.5 * duration, rel=1e-2)
    else:
        efforts = efforts_along(dynamics(), sent)
        assert float(found[3]) == pytest.approx(efforts.worst_ratio, rel=1e-2)
    assert 'slow_down' in str(caught.value)


@laws
@given(angles, angles, angles, st.floats(0.1, 1.0))
def test_an_infeasible_trajectory_that_is_slowed_down_has_the_same_path(
    start: FloatArray, via: FloatArray, goal: FloatArray, duration: float,
) -> None:
    # Near these poses gravity takes up to 100 N·m of the 150 N·m.
    sent = quintic_via_points(NAMES, [0.0, 0.6 * duration, duration], [start, via, goal])
    found, slowness = conditioned(sent, slows_down=True)
    assert found.duration == pytest.approx(slowness * sent.duration)
    for p0, p1, r0, r1 in zip(
            sent.points, sent.points[1:], found.points, found.points[1:]):
        for phase in np.linspace(0.0, 1.0, 7).tolist():
            t = (1.0 - phase) * p0.time_from_start + phase * p1.time_from_start
            expected = sample_segment(t, p0.time_from_start, p0, p1.time_from_start, p1)
            actual = sample_segment(
                slowness * t, r0.time_from_start, r0, r1.time_from_start, r1)
            assert actual.position == pytest.approx(expected.position, abs=1e-9)
            assert slowness * actual.velocity == pytest.approx(expected.velocity, abs=1e-6)
    assert efforts_along(dynamics(), found).worst_ratio <= 1.0 + 1e-5
    for _, v, _ in dense(found):
        assert (np.abs(v) <= TOLERANCE * ARM.limits.velocity).all()


@laws
@given(angles, angles, angles, st.floats(0.1, 1.0))
def test_it_is_not_slowed_down_more_than_needed(
    start: FloatArray, via: FloatArray, goal: FloatArray, duration: float,
) -> None:
    sent = quintic_via_points(NAMES, [0.0, 0.6 * duration, duration], [start, via, goal])
    _, slowness = conditioned(sent, slows_down=True)
    if slowness > 1.1:
        faster = make_trajectory(
            NAMES, [p.time_from_start * slowness / 1.1 for p in sent.points],
            [p.position for p in sent.points],
            [p.velocity * 1.1 / slowness for p in sent.points if p.velocity is not None],
            [p.acceleration * (1.1 / slowness)**2
             for p in sent.points if p.acceleration is not None], NAMES)
        with pytest.raises(TrajectoryError):
            conditioned(faster)


def test_a_lower_effort_scale_leaves_less() -> None:
    sent = quintic_point_to_point(NAMES, [0.0, 0.0], [0.3, 0.1], 2.0)
    ratio = efforts_along(dynamics(), sent).worst_ratio
    assert conditioned(sent, effort_scale=1.01 * ratio)[0] is sent
    with pytest.raises(TrajectoryError, match='effort'):
        conditioned(sent, effort_scale=0.99 * ratio)


def test_what_no_speed_makes_feasible_is_rejected() -> None:
    sent = quintic_point_to_point(NAMES, [0.0, 0.0], [0.3, 0.1], 2.0)
    with pytest.raises(TrajectoryError, match='not feasible at any speed'):
        conditioned(sent, effort_scale=0.01, slows_down=True)
    assert SLOWEST >= 10.0
