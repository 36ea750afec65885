# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Interpolation between two trajectory points: straight, cubic and quintic segments.

Generated trajectories: point to point, and through via points. Extrema of polynomials on [0, 1]
bound all samples and are attained.
"""

from itertools import pairwise
import math
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.trajectories.extrema import derivative, extrema
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, TrajectoryPoint
from robot_dynamics.trajectories.quintics import quintic_point_to_point, quintic_via_points
from sampled_segment import sample_segment
from two_joint_trajectories import assert_same, EPOCH, JOINTS, laws, REST, SECOND, spans, vectors


def point(q: Any, v: Any = None, a: Any = None, t: float = 0.0) -> TrajectoryPoint:
    q, v, a = (None if x is None else np.array(x, dtype=float) for x in (q, v, a))
    return TrajectoryPoint(t, q, v, a)


@laws
@given(q0=vectors, v0=vectors, a0=vectors, q1=vectors, v1=vectors, a1=vectors,
       T=st.floats(0.5, 3.0), s=st.floats(0.0, 1.0))
def test_a_quintic_equals_the_solution_of_its_linear_system(q0, v0, a0, q1, v1, a1, T, s):
    def rows(t):
        powers = np.polynomial.polynomial.polyvander(t, 5)
        first = np.array([k * t**(k - 1) if k else 0.0 for k in range(6)])
        second = np.array([k * (k - 1) * t**(k - 2) if k > 1 else 0.0 for k in range(6)])
        return np.vstack((powers, first, second))

    system = np.vstack((rows(0.0), rows(T)))
    c = np.linalg.solve(system, np.vstack((q0, v0, a0, q1, v1, a1)))
    expected = Reference(*(rows(s * T) @ c))
    found = sample_segment(s * T, 0.0, point(q0, v0, a0), T, point(q1, v1, a1))
    assert_same(found, expected, 1e-8)


@laws
@given(q0=vectors, v0=vectors, q1=vectors, v1=vectors, T=spans, s=st.floats(0.0, 1.0))
def test_a_cubic_has_the_ends_of_its_points_and_a_linear_acceleration(q0, v0, q1, v1, T, s):
    p0, p1 = point(q0, v0), point(q1, v1)
    begin, end = (sample_segment(t, 0.0, p0, T, p1) for t in (0.0, T))
    scale = 1e-11 * (1.0 + 1.0 / T**2 + T)
    np.testing.assert_allclose(begin[:2], (q0, v0), atol=scale)
    np.testing.assert_allclose(end[:2], (q1, v1), atol=scale)
    between = sample_segment(s * T, 0.0, p0, T, p1).acceleration
    np.testing.assert_allclose(
        between, (1.0 - s) * begin.acceleration + s * end.acceleration, rtol=1e-9, atol=scale)


@pytest.mark.parametrize(('p0', 'p1'), [
    (point([0.0, 1.0]), point([4.0, 3.0])),
    (point([0.0, 1.0], [9.0, 9.0]), point([4.0, 3.0])),
    (point([0.0, 1.0]), point([4.0, 3.0], [9.0, 9.0], [9.0, 9.0])),
])
def test_without_a_velocity_at_both_ends_the_way_is_straight(p0, p1):
    found = sample_segment(0.5, 0.0, p0, 2.0, p1)
    assert_same(found, Reference(np.array([1.0, 1.5]), np.array([2.0, 1.0]), np.zeros(2)))


def test_without_an_acceleration_at_both_ends_the_way_is_cubic():
    q0, v0, q1, v1, a1 = [0.0, 1.0], [0.3, 0.1], [1.0, 2.0], [0.2, -0.4], [5.0, 5.0]
    mixed = sample_segment(0.7, 0.0, point(q0, v0), 2.0, point(q1, v1, a1))
    assert_same(mixed, sample_segment(0.7, 0.0, point(q0, v0), 2.0, point(q1, v1)))


@laws
@given(q0=vectors, q1=vectors, T=spans, s=st.floats(0.0, 1.0))
def test_point_to_point_is_the_fifth_order_time_scaling(q0, q1, T, s):
    path = quintic_point_to_point(JOINTS, q0, q1, T)
    active = ActiveTrajectory(path, EPOCH, EPOCH, REST)
    span = round(s * T * SECOND)
    t = span / SECOND / T
    scaling = 10 * t**3 - 15 * t**4 + 6 * t**5
    found = active.sample(EPOCH + span).position
    np.testing.assert_allclose(found, q0 + scaling * (q1 - q0), atol=1e-6)


def segment_polynomials(path: JointTrajectory, joint: int) -> list[np.polynomial.Polynomial]:
    """Return one polynomial of the time since the start per segment, fitted to samples."""
    found = []
    for p0, p1 in pairwise(path.points):
        T = p1.time_from_start - p0.time_from_start
        t = np.linspace(0.0, T, 6)
        q = [sample_segment(x, 0.0, p0, T, p1).position[joint] for x in t]
        found.append(np.polynomial.Polynomial.fit(t, q, 5, domain=(0.0, T)))
    return found


VIA_TIMES = (0.5, 1.2, 2.0, 3.5, 4.0)
VIA_POSITIONS = ((0.0, 1.0), (0.5, -0.3), (0.2, 0.8), (1.0, 0.0), (0.4, 0.1))


def test_via_points_are_met_and_jerk_and_snap_are_continuous():
    """With rest at both ends this is the path of the least squared jerk."""
    path = quintic_via_points(JOINTS, VIA_TIMES, VIA_POSITIONS)
    np.testing.assert_array_equal([p.position for p in path.points], VIA_POSITIONS)
    for end in (path.points[0], path.points[-1]):
        np.testing.assert_array_equal((end.velocity, end.acceleration), np.zeros((2, 2)))
    for joint in (0, 1):
        for left, right in pairwise(segment_polynomials(path, joint)):
            for order in range(5):
                before = left.deriv(order)(left.domain[1]) if order else left(left.domain[1])
                after = right.deriv(order)(0.0) if order else right(0.0)
                assert before == pytest.approx(after, rel=1e-7, abs=1e-7), (joint, order)


@pytest.mark.parametrize(('times', 'words'), [
    ((1.0,), '1 point, expected at least a start and a goal'),
    ((0.0, 0.0), r'points\[1\].time_from_start is'),
    ((0.0, math.nan), r'points\[1\].time_from_start is')])
def test_one_via_point_and_bad_times_are_refused(times, words):
    with pytest.raises(TrajectoryError, match=words):
        quintic_via_points(JOINTS, times, ((0.0, 1.0), (1.0, 1.0))[:len(times)])


many = settings(max_examples=100)
DENSE = np.linspace(0.0, 1.0, 2001)

coefficients = st.one_of(
    st.floats(-10.0, 10.0), st.sampled_from([0.0, 1.0, -1.0, 1e-9, -1e-9, 1e-300, 5e-324, 1e9]))
polynomials = st.integers(1, 6).flatmap(
    lambda m: arrays(np.float64, (m, 1), elements=coefficients))


def evaluated(c: FloatArray, s: FloatArray) -> FloatArray:
    """Return the values (k, n) of polynomials c (m, n) at phases (k,)."""
    values: FloatArray = np.vander(s, len(c), increasing=True) @ c
    return values


def assert_exact(c: FloatArray) -> None:
    found, scale = extrema(c), np.abs(c).sum(axis=0)
    samples, rounding = evaluated(c, DENSE), 1e-14 * scale
    assert ((found.phases >= 0.0) & (found.phases <= 1.0)).all()
    assert (samples.min(axis=0) >= found.values[0] - rounding).all()
    assert (samples.max(axis=0) <= found.values[1] + rounding).all()
    for phases, values in zip(found.phases, found.values):
        attained = np.diagonal(evaluated(c, phases))
        assert (np.abs(attained - values) <= rounding).all()


@many
@given(polynomials)
def test_extrema_bound_the_polynomial_and_are_attained(c):
    assert_exact(c)


@pytest.mark.parametrize('c', [
    [0.0] * 6, [3.0] + [0.0] * 5, [0.0, 1.0] + [0.0] * 4, [1.0, -4.0, 4.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 1.0, 0.0, 0.0], [0.0, 1.0, -3.0, 3.0, -1.0, 1e-300],
    [-1.0 / 32.0, 5.0 / 16.0, -5.0 / 4.0, 5.0 / 2.0, -5.0 / 2.0, 1.0],  # (s − 1/2)⁵
    [1.0 / 16.0, -0.5, 1.5, -2.0, 1.0, 1e-16],  # (s − 1/2)⁴
    [0.0, 0.0, 0.0, 10.0, -15.0, 6.0], [1e9, 1e-6, -1e-6, 0.0, 0.0, 0.0],
])
def test_degenerate_polynomials(c):
    assert_exact(np.array(c)[:, np.newaxis])


@pytest.mark.parametrize('size', [5e-324, 1e-200, 1e200, 1.7e308])
def test_coefficients_of_any_size_give_numbers(size):
    signs = np.random.default_rng(2).choice([-1.0, 0.0, 1.0], (200, 6, 1))
    with np.errstate(all='raise', under='ignore'):
        found = extrema(size * signs)
    assert ((found.phases >= 0.0) & (found.phases <= 1.0)).all()
    assert not np.isnan(found.values).any()


def test_the_derivative_is_the_slope():
    c = np.random.default_rng(3).standard_normal((6, 4))
    step = 1e-6
    slope = (evaluated(c, DENSE + step) - evaluated(c, DENSE - step)) / (2.0 * step)
    assert evaluated(derivative(c), DENSE) == pytest.approx(slope, abs=1e-7)
