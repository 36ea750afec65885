# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The efforts of a trajectory: at its points, and along the motion against the limits."""

import numpy as np
from optional_library import library
import pytest
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.trajectories.efforts import efforts_along
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robot_dynamics.trajectories.limit_warnings import worst_in_words
from robot_dynamics.trajectories.quintics import quintic_point_to_point, quintic_via_points

NAMES = ('joint1', 'joint2')
DYNAMICS = ArmDynamics(load_arm(default_arm_urdf()))
LIMITS = np.array([150.0, 60.0])


def densely(path: JointTrajectory, count: int) -> tuple[np.ndarray, ...]:
    """Return times, position, velocity and acceleration at `count` samples of each segment."""
    rows = []
    for p0, p1 in zip(path.points, path.points[1:]):
        ends = [
            pair for pair in (
                (p0.position, p1.position), (p0.velocity, p1.velocity),
                (p0.acceleration, p1.acceleration))
            if pair[0] is not None and pair[1] is not None]
        t0, t1 = p0.time_from_start, p1.time_from_start
        t = t0 + (t1 - t0) * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, count)))
        way = library('scipy.interpolate').BPoly.from_derivatives(
            [t0, t1], [list(side) for side in zip(*ends)])
        v = way(t, 1)
        rows.append((t, way(t), np.where(np.abs(v) < 1e-9, 0.0, v), way(t, 2)))
    return tuple(np.concatenate(parts) for parts in zip(*rows))


def dense_ratios(
    dynamics: ArmDynamics, path: JointTrajectory, count: int = 4000,
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return times and |value| / limit, (m, n) each, from an independent interpolation."""
    t, q, v, a = densely(path, count)
    effort = dynamics.inverse_dynamics_batch(q, v, a)
    ratios = {'effort': np.abs(effort) / dynamics.arm.limits.effort}
    if dynamics.arm.actuators is not None:
        load = dynamics.arm.actuators.load(effort, v, a)
        ratios.update(current=load.current_ratio, voltage=load.voltage_ratio)
    return t, ratios


def random_path(random: np.random.Generator, points: int, fields: int) -> JointTrajectory:
    """Return a path with `fields` of position, velocity and acceleration; 4 means random."""
    times = np.cumsum(random.uniform(0.2, 1.5, points))
    q, v, a = random.normal(0.0, [[[1.5]], [[2.0]], [[8.0]]], (3, points, 2))
    v[-1] = 0.0
    has = random.integers(1, 4, points) if fields == 4 else np.full(points, fields)
    return make_trajectory(
        NAMES, times.tolist(), q.tolist(), [row.tolist() if k > 1 else [] for row, k in zip(
            v, has)], [row.tolist() if k > 2 else [] for row, k in zip(a, has)], NAMES)


@pytest.mark.parametrize('fields', [1, 2, 3, 4])
@pytest.mark.parametrize(('points', 'dry'), [(3, 0.0), (3, 5.0), (8, 5.0)])
def test_the_worst_place_is_that_of_the_whole_motion(fields, points, dry):
    random = np.random.default_rng(10 * points + fields)
    dynamics = ArmDynamics(DYNAMICS.arm.with_friction(
        make_friction(NAMES, [1.0, 0.5], [dry, 0.5 * dry])))
    for _ in range(4):
        path = random_path(random, points, fields)
        result = efforts_along(dynamics, path)
        t, ratios = dense_ratios(dynamics, path)
        # Includes an acceleration of a point outside any segment, and the rest at the end.
        at_points = np.abs(result.efforts) / LIMITS
        rest = np.abs(dynamics.rigid_body.gravity(path.points[-1].position)) / LIMITS
        worst = max(ratios['effort'].max(), at_points.max(), rest.max())
        # With dry friction the largest effort is a one-sided limit that no sample reaches.
        assert result.worst_ratio == pytest.approx(worst, rel=1e-3 if dry else 1e-5)
        assert result.feasible == (result.worst_ratio <= 1.0)
        if fields == 3 and not dry and worst == ratios['effort'].max():  # smooth
            j = NAMES.index(result.worst_joint)
            at = np.interp(result.worst_time, t, ratios['effort'][:, j])
            assert at == pytest.approx(worst, rel=1e-4)


def test_many_turns_in_one_segment():
    """The effort of gravity has 60 maxima during the motion, of which one is the largest."""
    path = quintic_point_to_point(NAMES, [0.0, 0.0], [200.0, 37.0], 400.0)
    _, ratios = dense_ratios(DYNAMICS, path, 100_000)
    assert efforts_along(DYNAMICS, path).worst_ratio == pytest.approx(
        ratios['effort'].max(), rel=1e-5)


def test_one_quick_segment_among_thousands():
    """Between two of 6,000 points at rest the arm makes a small step, which is too fast."""
    times = 0.05 * np.arange(6000)
    q = np.column_stack([0.3 * np.sin(times), np.zeros_like(times)])
    q[3000:] = q[2999] + np.array([0.02, -0.03])
    v = np.gradient(q, 0.05, axis=0)
    v[2999:] = 0.0
    path = make_trajectory(
        NAMES, times.tolist(), q.tolist(), v.tolist(), np.zeros_like(q).tolist(), NAMES)
    result = efforts_along(DYNAMICS, path)
    assert (np.abs(result.efforts[2990:]) / LIMITS).max() < 0.5 * result.worst_ratio
    _, ratios = dense_ratios(DYNAMICS, JointTrajectory(NAMES, path.points[2990:3010]))
    assert result.worst_ratio == pytest.approx(ratios['effort'].max(), rel=1e-5)
    assert times[2999] < result.worst_time < times[3000]


@pytest.mark.parametrize(('points', 'motions'), [
    (([0.0], [[1.0, 0.5]]), [([1.0, 0.5], [0.0, 0.0], [0.0, 0.0])]),
    (([0.0, 0.5], [[0.4, 0.3], [1.0, -0.5]], [[0.1, 0.2], [0.0, 0.0]], [[3.0, 4.0]] * 2),
     [([0.4, 0.3], [0.1, 0.2], [3.0, 4.0]), ([1.0, -0.5], [0.0, 0.0], [3.0, 4.0])]),
    (([0.0, 0.5], [[0.0, 0.3], [1.0, -0.5]]),
     [([0.0, 0.3], [2.0, -1.6], [0.0, 0.0]), ([1.0, -0.5], [0.0, 0.0], [0.0, 0.0])]),
    (([0.0, 0.5], [[0.0, 0.0], [1.0, -0.5]], [[0.0, 0.0]] * 2),
     [([0.0, 0.0], [0.0, 0.0], [24.0, -12.0]), ([1.0, -0.5], [0.0, 0.0], [0.0, 0.0])]),
], ids=['held point', 'quintic', 'line', 'cubic'])
def test_a_point_has_the_motion_of_its_interpolation(points, motions):
    """A cubic begins with 6 (q1 - q0) / T²; after the last point the reference is at rest."""
    expected = [DYNAMICS.inverse_dynamics(*motion) for motion in motions]
    found = efforts_along(DYNAMICS, make_trajectory(NAMES, *points)).efforts
    assert found == pytest.approx(np.array(expected))


def test_without_limits_everything_is_feasible():
    urdf = planar_arm_urdf([5.0], [1.0], [0.5], [0.1]).replace('effort="1000.0"', 'effort="0"')
    dynamics = ArmDynamics(load_arm(urdf))
    assert np.isinf(dynamics.arm.limits.effort).all()
    result = efforts_along(dynamics, quintic_point_to_point(('joint1',), [0.0], [3.0], 0.01))
    assert result.feasible
    assert result.worst_ratio == 0.0
    assert result.worst_joint == 'joint1'
    assert worst_in_words(result) == ''


PATH = quintic_via_points(NAMES, (0.0, 0.7, 1.5), [[0.0, 0.0], [0.9, -0.4], [0.2, 1.0]])
AMPLE = {
    'torque_constant': [0.1, 0.1], 'gear_ratio': [100.0, 50.0], 'rotor_inertia': [1e-4, 1e-5],
    'resistance': [0.5, 0.5], 'efficiency': [0.8, 0.8], 'current_limit': [100.0],
    'voltage_limit': [1000.0]}


@pytest.mark.parametrize(('changes', 'limit', 'feasible'), [
    ({}, 'effort', True),
    ({'current_limit': [5.0, 100.0]}, 'current', False),
    ({'current_limit': [15.0, 100.0]}, 'current', True),
    ({'voltage_limit': [1000.0, 2.0]}, 'voltage', False),
])
def test_what_motors_lack_counts_too(changes, limit, feasible):
    actuators = make_actuators(NAMES, **{**AMPLE, **changes})
    dynamics = ArmDynamics(DYNAMICS.arm.with_actuators(actuators))
    result = efforts_along(dynamics, PATH)
    t, ratios = dense_ratios(dynamics, PATH, 8_000)
    worst = max(rows.max() for rows in ratios.values())
    i, j = np.argwhere(ratios[limit] == worst)[0]
    assert (result.worst_limit, result.feasible) == (limit, feasible)
    assert result.worst_ratio == pytest.approx(worst, rel=1e-4)
    assert result.worst_joint == NAMES[j]
    assert result.worst_time == pytest.approx(t[i], abs=1e-3)
    words = worst_in_words(result)
    motor = '' if limit == 'effort' else 'the motor of '
    assert words.startswith(
        f'{limit} of {motor}{NAMES[j]!r} is {result.worst_ratio:.3g} times its limit at ')
