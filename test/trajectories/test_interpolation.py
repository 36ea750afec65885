# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Interpolation between two trajectory points: straight, cubic and quintic segments."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import TrajectoryPoint
from sampled_segment import sample_segment
from two_joint_trajectories import assert_same, laws, spans, vectors


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
