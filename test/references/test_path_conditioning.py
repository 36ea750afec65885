# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Paths without velocities get velocities; infeasible trajectories are rejected."""

from functools import cache
from itertools import pairwise
import re
from typing import Any

from controller_bench import ARM, NAMES
from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.references.motion_limits import MotionLimits, WorkspaceInertia
from robot_dynamics.references.path_conditioning import feasible_trajectory
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.trajectories.quintics import quintic_point_to_point, quintic_via_points
from robot_dynamics.trajectories.segments import TrajectorySegments
from sampled_segment import sample_segment

DYNAMICS = ArmDynamics(ARM)
TOLERANCE = 1.0001
"""Largest ratio to a limit at the points and between them."""

laws = settings(max_examples=20)
angles = st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=2).map(np.array)


@cache
def limits() -> MotionLimits:
    return WorkspaceInertia(DYNAMICS).motion_limits(ARM.limits.effort, ARM.limits.effort / 0.1)


def conditioned(sent: JointTrajectory, **options: Any) -> tuple[JointTrajectory, float]:
    return feasible_trajectory(DYNAMICS, sent, limits(), **options)


def path(times: list[float], q: Any, v: Any = ()) -> JointTrajectory:
    return make_trajectory(NAMES, times, np.asarray(q).tolist(), v, (), NAMES)


def dense(found: JointTrajectory) -> list[tuple[FloatArray, FloatArray]]:
    """Return position and velocity of each segment, (m, n) each."""
    parts = []
    for p0, p1 in pairwise(found.points):
        t0, t1 = p0.time_from_start, p1.time_from_start
        rows = [sample_segment(t, t0, p0, t1, p1) for t in np.linspace(t0, t1, 60).tolist()]
        parts.append((np.array([row[0] for row in rows]), np.array([row[1] for row in rows])))
    return parts


def assert_within_limits(found: JointTrajectory) -> None:
    """Compare velocity, acceleration and jerk with the limits, at 60 samples of each segment."""
    segments = TrajectorySegments(found)
    T = np.diff(segments.times)[:, np.newaxis, np.newaxis]
    c, powers = segments.coefficients, np.vander(np.linspace(0.0, 1.0, 60), 6, increasing=True)
    for limit in (limits().velocity, limits().acceleration, limits().jerk):
        c = c[:, 1:] * np.arange(1, c.shape[1])[:, np.newaxis] / T
        assert (np.abs(powers[:, :c.shape[1]] @ c) <= TOLERANCE * limit).all()


def assert_starts_and_ends_at_rest(found: JointTrajectory, sent: JointTrajectory) -> None:
    for end, original in ((found.points[i], sent.points[i]) for i in (0, -1)):
        assert end.position.tolist() == original.position.tolist()
        assert not end.velocity.any()
        assert not end.acceleration.any()


@st.composite
def paths(draw: Any) -> JointTrajectory:
    count = draw(st.integers(2, 6))
    steps = draw(st.lists(st.floats(0.05, 2.0), min_size=count, max_size=count))
    q = draw(st.lists(angles, min_size=count, max_size=count))
    return path(np.cumsum(steps).tolist(), q)


# --- paths without velocities --------------------------------------------------------------------

@laws
@given(paths())
def test_a_path_of_positions_is_followed_within_the_limits(sent):
    """It passes its points, in the proportions of their times, without overshoot."""
    found, slowness = conditioned(sent)
    assert slowness >= 1.0
    first = sent.points[0].time_from_start
    assert found.points[0].time_from_start == first
    for point, original in zip(found.points, sent.points, strict=True):
        assert point.position.tolist() == original.position.tolist()
        assert point.time_from_start - first == pytest.approx(
            slowness * (original.time_from_start - first))
    assert_starts_and_ends_at_rest(found, sent)
    assert_within_limits(found)
    for q, _ in dense(found):
        assert (np.diff(q, axis=0) * np.sign(q[-1] - q[0]) >= -1e-9).all()
        assert (q >= np.minimum(q[0], q[-1]) - 1e-9).all()
        assert (q <= np.maximum(q[0], q[-1]) + 1e-9).all()


# --- paths of many points without velocities -----------------------------------------------------

def sampled(name: str, count: int) -> JointTrajectory:
    """Return so many points of a motion, in 4 s; of a noisy one, with positions ± 0.1 mrad."""
    t = np.linspace(0.0, 4.0, count)
    s = t / t[-1]
    smooth = 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5
    q = {
        'rest to rest': np.outer(smooth, [0.5, 0.8]),
        'sine': np.stack((0.5 * np.sin(0.5 * np.pi * t), 0.4 * np.cos(np.pi * t)), axis=1),
        'noisy': np.outer(smooth, [0.5, 0.8]) + np.random.default_rng(0).normal(
            0.0, 1e-4, (count, 2)),
        'corner': np.stack((np.minimum(t, 2.0), np.maximum(t, 2.0)), axis=1) / 5.0,
        'zigzag': np.cumsum(np.random.default_rng(1).uniform(-0.15, 0.15, (count, 2)), axis=0),
    }[name]
    return path(t.tolist(), q)


@pytest.mark.parametrize(('name', 'count', 'most'), [
    ('rest to rest', 20, 1.1), ('rest to rest', 300, 1.01), ('sine', 300, 1.3),
    ('noisy', 300, 1.1), ('corner', 100, 1.3), ('zigzag', 40, 10.0)])
def test_many_points_are_followed_closely_at_about_their_times(name, count, most):
    sent = sampled(name, count)
    found, slowness = conditioned(sent)
    assert 1.0 <= slowness < most
    assert_within_limits(found)
    assert_starts_and_ends_at_rest(found, sent)
    powers = np.vander(np.linspace(0.0, 1.0, 20), 6, increasing=True)
    positions = (powers @ TrajectorySegments(found).coefficients).reshape(-1, 2)
    q = np.array([point.position for point in sent.points])
    for one in q:
        assert np.abs(positions - one).max(axis=1).min() <= 0.0055
    assert (positions <= q.max(axis=0) + 1e-9).all()
    assert (positions >= q.min(axis=0) - 1e-9).all()


@pytest.mark.parametrize(('count', 'is_exact'), [(9, True), (10, False)])
def test_up_to_nine_points_are_passed_exactly(count, is_exact):
    q = np.cumsum(np.random.default_rng(1).uniform(-0.01, 0.01, (10, 2)), axis=0)
    sent = path((0.09 * np.arange(count)).tolist(), q[:count])
    found, _ = conditioned(sent)
    assert ([p.position.tolist() for p in found.points] == [
        p.position.tolist() for p in sent.points]) == is_exact


# --- trajectories with velocities ----------------------------------------------------------------

@laws
@given(angles, angles, st.floats(8.0, 20.0))
def test_a_feasible_trajectory_is_the_same_object(start, goal, duration):
    sent = quintic_via_points(NAMES, [0.0, 0.5 * duration, duration],
                              [start, 0.5 * (start + goal), goal])
    assume(efforts_along(DYNAMICS, sent).feasible)
    for slows_down in (False, True):
        found, slowness = conditioned(sent, slows_down=slows_down)
        assert found is sent
        assert slowness == 1.0


@pytest.mark.parametrize(('duration', 'quantity'), [(0.15, 'velocity'), (0.5, 'effort')])
def test_an_infeasible_trajectory_is_rejected_with_joint_time_and_ratio(duration, quantity):
    sent = quintic_point_to_point(NAMES, [0.0, 0.0], [1.5, 0.2], duration)
    with pytest.raises(TrajectoryError) as caught:
        conditioned(sent)
    found = re.search(
        r"the (\w+) of '(\w+)' is ([\d.]+) times its limit at ([\d.]+) s", str(caught.value))
    assert found[1] == quantity
    assert found[2] == 'joint1'
    assert float(found[3]) > 1.0
    assert 0.0 <= float(found[4]) <= duration
    if quantity == 'velocity':
        exact = 1.875 * 1.5 / duration / ARM.limits.velocity[0]
        assert float(found[3]) == pytest.approx(exact, rel=1e-2)
        assert float(found[4]) == pytest.approx(0.5 * duration, rel=1e-2)
    else:
        efforts = efforts_along(DYNAMICS, sent)
        assert float(found[3]) == pytest.approx(efforts.worst_ratio, rel=1e-2)
    assert 'slow_down' in str(caught.value)


@laws
@given(angles, angles, angles, st.floats(0.1, 1.0))
def test_an_infeasible_trajectory_that_is_slowed_down_has_the_same_path(
    start, via, goal, duration,
):
    # Near these poses gravity takes up to 100 N·m of the 150 N·m.
    sent = quintic_via_points(NAMES, [0.0, 0.6 * duration, duration], [start, via, goal])
    found, slowness = conditioned(sent, slows_down=True)
    assert found.duration == pytest.approx(slowness * sent.duration)
    for p0, p1, r0, r1 in zip(sent.points, sent.points[1:], found.points, found.points[1:]):
        for phase in np.linspace(0.0, 1.0, 7).tolist():
            t = (1.0 - phase) * p0.time_from_start + phase * p1.time_from_start
            expected = sample_segment(t, p0.time_from_start, p0, p1.time_from_start, p1)
            actual = sample_segment(slowness * t, r0.time_from_start, r0, r1.time_from_start, r1)
            # The times are whole nanoseconds, in which the arm moves by up to 10 nrad.
            assert actual.position == pytest.approx(expected.position, abs=1e-8)
            assert slowness * actual.velocity == pytest.approx(expected.velocity, abs=1e-6)
    assert efforts_along(DYNAMICS, found).worst_ratio <= 1.0 + 1e-5
    for _, v in dense(found):
        assert (np.abs(v) <= TOLERANCE * ARM.limits.velocity).all()
    if slowness > 1.1:  # it is not slowed down more than needed
        faster = make_trajectory(
            NAMES, [p.time_from_start * slowness / 1.1 for p in sent.points],
            [p.position for p in sent.points],
            [p.velocity * 1.1 / slowness for p in sent.points if p.velocity is not None],
            [p.acceleration * (1.1 / slowness)**2
             for p in sent.points if p.acceleration is not None], NAMES)
        with pytest.raises(TrajectoryError):
            conditioned(faster)


def test_a_lower_effort_scale_leaves_less():
    sent = quintic_point_to_point(NAMES, [0.0, 0.0], [0.3, 0.1], 2.0)
    ratio = efforts_along(DYNAMICS, sent).worst_ratio
    assert conditioned(sent, effort_limit_fraction=1.01 * ratio)[0] is sent
    with pytest.raises(TrajectoryError, match='effort'):
        conditioned(sent, effort_limit_fraction=0.99 * ratio)


def test_what_is_not_feasible_at_a_hundredth_of_the_speed_is_rejected():
    sent = quintic_point_to_point(NAMES, [0.0, 0.0], [0.3, 0.1], 2.0)
    with pytest.raises(TrajectoryError, match='at any speed'):
        conditioned(sent, effort_limit_fraction=0.01, slows_down=True)
    way = 10.0 / 1.875  # [rad] that a quintic covers in 1 s at the velocity limit
    for factor in (95.0, 105.0):
        sent = quintic_point_to_point(NAMES, [0.0, 0.0], [0.0, way], 1.0 / factor)
        if factor < 100.0:
            assert conditioned(sent, slows_down=True)[1] == pytest.approx(factor, rel=0.05)
        else:
            with pytest.raises(TrajectoryError, match='not feasible at any speed'):
                conditioned(sent, slows_down=True)


@pytest.mark.filterwarnings('error')
def test_the_smallest_number_is_a_position_like_others():
    sent = make_trajectory(NAMES, [0.0, 1.0, 2.0, 3.0], [[0.1, 0.0], [5e-324, 0.0], [0.0, 0.0],
                                                         [-0.1, 0.0]])
    assert conditioned(sent)[0].duration == pytest.approx(3.0)
