# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A reference that ends in motion: each joint stops at once, within its limits."""

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.references.jerk_profile import Bounds, duration, extremes, stop
from robot_dynamics.references.reference_generator import ReferenceGenerator
from robot_dynamics.trajectories.quintics import quintic_via_points
from sampled_references import at, generator, laws, NAMES, NOW, ns, samples, SECOND, ZERO

BOUNDS = [Bounds(-1.0, 1.0, -5.0, 5.0, 90.0)] * 2
CURVE = quintic_via_points(
    NAMES, [0.0, 1.0, 2.0, 3.0, 4.0],
    [[0.0, 0.0], [0.5, 0.6], [1.2, 0.4], [1.5, -0.4], [0.8, -0.6]])


def end_of(one: ReferenceGenerator) -> float:
    return (one.active.end_ns - NOW) / SECOND


# --- along a path --------------------------------------------------------------------------------

@laws
@given(st.floats(0.05, 3.9))
def test_a_stop_on_a_path_is_the_earliest_stop_of_each_joint(t):
    one = generator()
    one.start(CURVE, NOW, ZERO, ZERO)
    before = at(one, t)
    one.stop(ns(t), ZERO, ZERO)
    for old, new in zip(before, at(one, t)):
        assert new == pytest.approx(old, abs=1e-9)
    end = end_of(one)
    found = samples(one, t, end + 0.1, 400)
    assert not found.v[-1].any()
    assert (np.abs(found.a) <= np.maximum(5.0, np.abs(before.acceleration)) + 1e-6).all()
    assert found.jerk <= 1.001 * 90.0
    for j, bounds in enumerate(BOUNDS):
        # A joint that accelerates continues to do so until the jerk has removed its acceleration.
        path = stop(before.velocity[j], before.acceleration[j], bounds)
        assert duration(path) <= end - t + 1e-6
        exact = extremes(path, before.position[j], before.velocity[j], before.acceleration[j])
        q = found.q[:, j]
        assert exact.q_min - 1e-9 <= q.min() <= q.max() <= exact.q_max + 1e-9
        assert (q.min(), q.max()) == pytest.approx((exact.q_min, exact.q_max), abs=1e-4)


@laws
@given(st.floats(0.2, 3.5), st.floats(0.05, 0.95))
def test_a_second_stop_during_a_stop_changes_nothing(t, fraction):
    one = generator()
    one.start(CURVE, NOW, ZERO, ZERO)
    one.stop(ns(t), ZERO, ZERO)
    first = end_of(one)
    again = t + fraction * (first - t)
    expected = samples(one, again, first + 0.01, 100)
    one.stop(ns(again), ZERO, ZERO)
    assert end_of(one) == pytest.approx(first, abs=1e-6)
    for old, new in zip(expected, samples(one, again, first + 0.01, 100)):
        assert new == pytest.approx(old, abs=1e-5)


# --- from a measured state -----------------------------------------------------------------------

@laws
@given(st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4))
def test_a_stop_from_a_measured_state_is_within_the_limits(state):
    one, q, v = generator(), np.array(state[:2]), np.array(state[2:])
    one.stop(NOW, q, v)
    found = samples(one, 0.0, max(end_of(one), 1e-3))
    assert found.q[0].tolist() == q.tolist()
    assert found.v[0] == pytest.approx(v, abs=1e-12)
    assert (np.abs(found.v) <= np.abs(v) + 1e-9).all()
    assert np.abs(found.a).max() <= 1.001 * 5.0
    assert found.jerk <= 1.001 * 90.0
    assert not found.v[-1].any()


def test_a_stop_without_limits_holds_the_position_at_once():
    one = ReferenceGenerator(NAMES, (), None)
    one.start(CURVE, NOW, ZERO, ZERO)
    before = at(one, 1.0)
    one.stop(ns(1.0), ZERO, ZERO)
    after = at(one, 1.5)
    assert after.position.tolist() == before.position.tolist()
    assert not after.velocity.any()
