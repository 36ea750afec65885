# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Effort limits of a command: the load of the joint, with the compensation by the robot."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.safety.effort_bounds import EffortBounds, NOTHING, RobotEffort

LIMIT = np.array([10.0, 40.0, np.inf])
FAR = 1e6
"""An effort beyond all bounds."""

laws = settings(max_examples=80)


def vectors(size: float) -> st.SearchStrategy[np.ndarray]:
    numbers = st.floats(-size, size) | st.sampled_from([0.0, 10.0, -10.0, size, -size])
    return st.lists(numbers, min_size=3, max_size=3).map(np.array)


def compensating(gravity: np.ndarray) -> RobotEffort:
    return RobotEffort(gravity, 0.0)


# --- a robot that compensates gravity ------------------------------------------------------------

@laws
@given(vectors(200.0), vectors(100.0))
def test_command_and_joint_stay_within_the_limit_or_gravity_alone_exceeds_it(command, gravity):
    bounded, _ = EffortBounds(LIMIT).bounded(command, compensating(gravity))
    assert (np.abs(bounded) <= LIMIT).all()
    assert (np.abs(bounded + gravity) <= np.maximum(LIMIT, np.abs(gravity)) + 1e-9).all()


@laws
@given(vectors(100.0), st.sampled_from([1.0, -1.0]))
def test_a_robot_that_compensates_gravity_leaves_the_rest_of_the_limit(gravity, sign):
    """The largest command loads either the drive or the joint with its limit, and no less."""
    bounded, clamped = EffortBounds(LIMIT).bounded(np.full(3, sign * FAR), compensating(gravity))
    for j in (0, 1):
        load = max(sign * bounded[j], sign * (bounded[j] + gravity[j]))
        if sign * gravity[j] <= LIMIT[j]:
            assert load == pytest.approx(LIMIT[j], abs=1e-9)
        else:
            assert bounded[j] == 0.0
    assert clamped.tolist() == [True, True, False]


@laws
@given(vectors(200.0), vectors(100.0))
def test_what_is_within_the_bounds_is_unchanged(command, gravity):
    bounds, robot = EffortBounds(LIMIT), compensating(gravity)
    bounded, clamped = bounds.bounded(command, robot)
    again, none = bounds.bounded(bounded, robot)
    assert again.tolist() == bounded.tolist()
    assert not none.any()
    assert clamped.tolist() == (bounded != command).tolist()
    is_possible = (np.abs(command) <= LIMIT) & (
        np.abs(command + gravity) <= LIMIT - 1e-9)  # the sum is rounded
    assert not (clamped & is_possible).any()


# --- the scale of the limits ---------------------------------------------------------------------

@pytest.mark.parametrize(('hold', 'low', 'high'), [
    (3.0, -5.0, 5.0), (7.0, -5.0, 7.0), (-7.0, -7.0, 5.0), (12.0, -5.0, 10.0),
    (-12.0, -10.0, 5.0)])
def test_a_scaled_limit_extends_to_what_holds_the_arm(hold, low, high):
    bounds, holds = EffortBounds(np.array([10.0]), 0.5), np.array([hold])
    assert bounds.bounded(np.array([FAR]), NOTHING, holds)[0].tolist() == [high]
    assert bounds.bounded(np.array([-FAR]), NOTHING, holds)[0].tolist() == [low]
    assert bounds.bounded(np.array([FAR]), NOTHING)[0].tolist() == [10.0]
    assert bounds.bounded(np.array([-FAR]), NOTHING)[0].tolist() == [-10.0]


@given(st.lists(
    st.tuples(*(st.floats(width=32) for _ in range(3))), min_size=1, max_size=30),
    st.sampled_from([0.0, 0.25, 1.0]))
def test_efforts_within_the_scaled_limits_are_clear(efforts, scale):
    """The result must not depend on the efforts that were tested before."""
    bounds = EffortBounds(LIMIT, scale)
    for effort in efforts:
        is_within = all(
            math.isfinite(x) and abs(x) <= limit for x, limit in zip(effort, bounds.scaled))
        with np.errstate(invalid='ignore'):
            assert bounds.range.contains(list(effort)) == is_within
