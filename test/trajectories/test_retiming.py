# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Retiming: fastest timings and slow-downs within all limits, and requests that are rejected."""

from dataclasses import replace
import re
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from retimed import (
    distance_from_lines,
    frictionless,
    hinge,
    INERTIA,
    largest_ratio,
    OPEN,
    poses,
    sampled,
    speed_up_and_down,
    with_friction_and_motors,
)
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.references.motion_limits import MotionLimits
from robot_dynamics.references.path_conditioning import feasible_trajectory
from robot_dynamics.trajectories import (
    efforts_along,
    JointTrajectory,
    make_trajectory,
    retime,
    Retiming,
)
from robot_dynamics.trajectories.quintics import quintic_point_to_point, quintic_via_points
from robot_dynamics.trajectories.segments import TrajectorySegments
from robots import arm_without_gripper

PLANAR = ArmDynamics(load_arm(default_arm_urdf()))
CORNER = [[0.0, 0.0], [0.8, 0.5], [0.2, 1.0]]
TWO = CORNER[:2]


def distance_from(request: JointTrajectory, result: JointTrajectory) -> float:
    path = sampled(request, max(9, 20_000 // len(request.points)))[0]
    return distance_from_lines(path, sampled(result, 4)[0][::7])


def planar(times: Any = (0.0, 1.0), q: Any = TWO, *rows: Any) -> JointTrajectory:
    return make_trajectory(PLANAR.arm.joint_names, times, q, *rows)


# --- invariants ----------------------------------------------------------------------------------

def request_of(form: str, arm: ArmModel, q: np.ndarray) -> JointTrajectory:
    t = np.arange(float(len(q)))
    if form == 'quintics':
        return quintic_via_points(arm.joint_names, t, q)
    v = np.zeros_like(q)
    return make_trajectory(arm.joint_names, t, q, v, v if form == 'rests' else ())


def check(dynamics: ArmDynamics, request: JointTrajectory, share: float = 1.0) -> Retiming:
    """Check the invariants of the fastest timing, and return it."""
    result = retime(dynamics, request, effort_limit_fraction=share)
    trajectory = result.trajectory
    assert largest_ratio(dynamics.arm, trajectory, share) < 1.0 + 2e-5
    assert efforts_along(dynamics, trajectory).worst_ratio <= share * (1.0 + 2e-6)
    ends = [trajectory.points[i] for i in (0, -1)]
    for end, before in zip(ends, (request.points[0], request.points[-1])):
        assert end.velocity == pytest.approx(0.0, abs=1e-12)
        assert end.position == pytest.approx(before.position, abs=1e-9)
    assert distance_from(request, trajectory) < 1e-6
    open_limits = MotionLimits(*np.full((5, dynamics.arm.joint_count), OPEN))
    followed, slowness = feasible_trajectory(dynamics, trajectory, open_limits, share)
    assert (followed, slowness) == (trajectory, 1.0)  # the node does not reject it
    slow = retime(dynamics, request, 'slow_down', effort_limit_fraction=share)
    assert result.duration <= slow.duration * (1.0 + 1e-4)
    assert largest_ratio(dynamics.arm, slow.trajectory, share) < 1.0 + 1e-4
    assert len(result.limiting_joint) == len(result.limited_quantity) == len(trajectory.points)
    make_trajectory(trajectory.joint_names, *zip(*(
        (p.time_from_start, p.position, p.velocity) for p in trajectory.points)))
    return result


@pytest.mark.parametrize(('name', 'kind'), [('panda', 'stribeck'), ('z1', 'motors')])
@settings(max_examples=2)
@given(st.integers(0, 2**32), st.sampled_from(['quintics', 'cubics', 'rests']))
def test_limits_hold_on_robots(name, kind, seed, form):
    rng = np.random.default_rng(seed)
    arm = arm_without_gripper(name)
    q = poses(arm, rng.integers(2, 5), rng, 0.5)
    gravity = np.abs(ArmDynamics(frictionless(arm)).gravity_batch(q)).max(axis=0)
    limit = np.where(np.isfinite(arm.limits.effort), arm.limits.effort, 50.0)
    arm = with_friction_and_motors(arm, kind, 0.3 * np.maximum(limit - 1.2 * gravity, 0.0))
    try:
        result = check(ArmDynamics(arm), request_of(form, arm, q), 0.9)
    except TrajectoryError as error:
        assert 'due to gravity' in str(error)  # noqa: PT017
    else:
        assert np.percentile(result.limit_ratio, 50) > 0.98


def test_a_joint_that_rests_has_no_friction():
    arm = load_arm(default_arm_urdf())
    arm = arm.with_friction(make_friction(arm.joint_names, coulomb=5.0))
    q = [[0.1, 0.4], [0.9, 0.4], [0.3, 0.4]]
    check(ArmDynamics(arm), quintic_via_points(arm.joint_names, [0, 1, 2], q))


def test_a_joint_that_turns_back_within_a_piece_rests_there():
    path = make_trajectory(['hinge'], [0.0, 1.0], [[0.0], [0.5]], [[3.0], [0.0]])
    segments = TrajectorySegments(path)
    top = segments.sample(np.zeros(1001, dtype=int), np.linspace(0, 1, 1001)).position.max()
    result = retime(ArmDynamics(hinge()), path)
    ways = np.array([top, top - 0.5])
    assert result.duration == pytest.approx(np.sum(2.0 * np.sqrt(ways * INERTIA / 2.0)), rel=1e-4)


# --- paths without velocities --------------------------------------------------------------------

def test_corners_are_rejected():
    with pytest.raises(TrajectoryError, match=re.escape(
            "points[1].positions is a corner of the path: its direction changes by 1.89 rad, most "
            "at joint 'joint1', expected at most 0.35 rad")):
        retime(PLANAR, planar(range(3), CORNER))


def test_corners_are_rounded_within_the_tolerance_and_larger_ones_are_quicker():
    path, duration = planar(range(3), CORNER), OPEN
    for tolerance in (0.02, 0.1):
        result = retime(PLANAR, path, corner_tolerance=tolerance)
        q = sampled(result.trajectory)[0]
        miss = np.linalg.norm(q - np.array(CORNER[1]), axis=1).min()
        assert 0.5 * tolerance < miss <= tolerance
        assert distance_from(path, result.trajectory) <= tolerance
        assert largest_ratio(PLANAR.arm, result.trajectory) < 1.0 + 2e-5
        assert result.duration < duration
        duration = result.duration


def test_a_dense_path_with_a_corner():
    t = np.linspace(0.0, 2.0, 301)
    q = np.stack([np.interp(t, [0, 1, 2], column) for column in np.transpose(CORNER)], axis=1)
    path = planar(t, q)
    with pytest.raises(TrajectoryError, match=re.escape('points[150].positions is a corner')):
        retime(PLANAR, path)
    dense, sparse, repeated = (
        retime(PLANAR, one, corner_tolerance=0.02).duration for one in (
            path, planar(range(3), CORNER), planar(range(6), np.repeat(CORNER, 2, axis=0))))
    assert dense == pytest.approx(sparse, rel=1e-3)
    assert repeated == pytest.approx(sparse, rel=1e-6)


def test_a_path_rests_where_it_turns_back():
    path = make_trajectory(['hinge'], [0, 1, 2], [[0.0], [1.0], [0.5]])
    with pytest.raises(TrajectoryError, match=r'points\[1\].* is a corner .* by 3.14 rad'):
        retime(ArmDynamics(hinge()), path)
    result = retime(ArmDynamics(hinge()), path, corner_tolerance=0.01)
    expected = sum(2.0 * np.sqrt(way * INERTIA / 2.0) for way in (1.0, 0.5))
    assert result.duration == pytest.approx(expected, rel=1e-4)
    assert max(point.position[0] for point in result.trajectory.points) == pytest.approx(1.0)


# --- uniform slow-downs --------------------------------------------------------------------------

@pytest.mark.parametrize('duration', [0.2, 0.5, 5.0])
def test_the_slow_down_is_the_smallest(duration):
    path = quintic_point_to_point(PLANAR.arm.joint_names, [0.0, 0.0], [1.0, 0.5], duration)
    result = retime(PLANAR, path, 'slow_down')
    if duration == 5.0:  # feasible
        assert result.ratio == 1.0
        assert np.array_equal(*([point.position for point in one.points] for one in (
            path, result.trajectory)))
        return
    reaches = max(result.limit_ratio.max(),
                  efforts_along(PLANAR, result.trajectory).worst_ratio,
                  np.max(np.abs(sampled(result.trajectory, 999)[1]) / PLANAR.arm.limits.velocity))
    assert reaches == pytest.approx(1.0, abs=1e-4)
    assert result.duration == pytest.approx(result.ratio * duration)


# --- rejected requests ---------------------------------------------------------------------------

@pytest.mark.parametrize(('request_', 'options', 'words'), [
    (planar, {'method': 'quick'}, "method is 'quick', expected one of ['fastest', 'slow_down']"),
    (planar, {'corner_tolerance': -1.0}, 'corner_tolerance is -1'),
    (planar, {'effort_limit_fraction': 1.5}, 'effort_limit_fraction is 1.5'),
    (planar, {'acceleration_limits': [1.0, 0.0]}, "acceleration_limits of 'joint2' is 0"),
    (planar, {'effort_rate_limits': [1.0, 0.0]}, "effort_rate_limits of 'joint2' is 0"),
    (planar, {'method': 'slow_down'}, 'points[0].velocities is empty, expected velocities'),
    (lambda: planar([0.0], TWO[:1]), {}, 'points has 1 point, expected at least 2'),
    (lambda: planar([0, 1], TWO[:1] * 2), {}, 'points are all at the same position [0.0, 0.0]'),
    (lambda: planar([0, 1], TWO, [[0.0, 0.0], []]), {}, 'points[1].velocities is empty, but'),
])
def test_bad_requests_are_rejected_by_name(request_, options, words):
    with pytest.raises(InvalidInputError, match=re.escape(words)):
        retime(PLANAR, request_(), **options)


@pytest.mark.parametrize('method', ['fastest', 'slow_down'])
def test_gravity_beyond_a_limit_is_rejected(method):
    arm = PLANAR.arm.with_payloads([make_payload('tool0', 12.0)])
    path = planar([0, 1], [[0.0, 0.0], [1.5, 0.0]], [[0.0, 0.0]] * 2)
    ratio = abs(ArmDynamics(arm).gravity([1.5, 0.0])[0]) / 150.0
    with pytest.raises(TrajectoryError, match=re.escape(
            f"the effort of 'joint1' due to gravity is {ratio:.4g} times its limit at rest at "
            'points[1]')):
        retime(ArmDynamics(arm), path, method)


def limited(**limits: Any) -> ArmModel:
    """Return the planar arm with other limits and without gravity."""
    return replace(PLANAR.arm.with_gravity([0, 0, 0]), limits=replace(PLANAR.arm.limits, **limits))


@pytest.mark.parametrize(('arm', 'path', 'words'), [
    (PLANAR.arm.with_payloads([make_payload('tool0', 6.0)]), [[-0.2, 0.0], [3.2, 0.0]],
     r"'joint1' due to gravity .* near points\[[01]\]"),
    (hinge().with_friction(make_friction(['hinge'], coulomb=2.5)), [[0.0], [1.5]],
     '1.25 times its limit in slow motion'),
    (hinge(OPEN), [[0.0], [1.5]], 'the arm has no limit of velocity, effort, current'),
    (limited(effort=np.full(2, OPEN), velocity=np.array([OPEN, 1.0])), [[0.0, 0.3], [1.0, 0.3]],
     r"no limit applies to the motion of \['joi"),
    (limited(velocity=np.array([1.0, 0.0])), TWO, "the velocity limit of 'joint2' is 0"),
    (limited(effort=np.array([1.0, 0.0])), TWO, "the effort limit of 'joint2' is 0"),
])
def test_what_no_timing_satisfies_is_rejected(arm, path, words):
    with pytest.raises(TrajectoryError, match=words):
        retime(ArmDynamics(arm), make_trajectory(arm.joint_names, [0.0, 1.0], path))


def test_without_other_limits_those_of_the_acceleration_suffice():
    path = quintic_point_to_point(['hinge'], [0.0], [1.5], 3.0)
    assert retime(ArmDynamics(hinge(OPEN)), path, acceleration_limits=4.0).duration == (
        pytest.approx(speed_up_and_down(4.0, 4.0), rel=3e-5))


def test_positions_beyond_limits_are_warnings():
    arm = hinge(velocity=1.0)
    path = make_trajectory(['hinge'], [0.0, 1.0], [[0.0], [6.0]])
    warning, = retime(ArmDynamics(arm), path).warnings
    assert warning.startswith("position of 'hinge' is 6 at ")
