# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Trajectories and set-points compared with the position and velocity limits of an arm."""

from dataclasses import replace
from typing import Any

from controller_bench import update
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.goal_limits import (
    check_points,
    motion_excesses,
    with_clipped_positions,
    with_clipped_velocity,
)
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory

NAMES = ('joint1', 'joint2')
UNLIMITED = load_arm(default_arm_urdf())
ARM = replace(UNLIMITED, limits=replace(
    UNLIMITED.limits, lower=np.array([-1.0, -2.0]), upper=np.array([1.5, 2.0])))
"""Velocity limits of 10 rad/s."""

laws = settings(max_examples=30)
values = st.lists(st.floats(-60.0, 60.0), min_size=4, max_size=4)


def trajectory(*positions: Any, velocities: Any = ()) -> JointTrajectory:
    return make_trajectory(
        NAMES, [1.0 * i for i in range(len(positions))], positions, velocities, (), NAMES)


@pytest.mark.parametrize(('sent', 'words'), [
    (trajectory([50.0, 0.0]),
     'points[0].positions (joint1) is 50, expected a value within its limits [-1, 1.5]'),
    (trajectory([0.0, 0.0], [0.0, -2.1]),
     'points[1].positions (joint2) is -2.1, expected a value within its limits [-2, 2]'),
    (trajectory([0.0, 0.0], velocities=[[0.0, 1e9]]),
     'points[0].velocities (joint2) is 1e+09, expected a value within its limits [-10, 10]'),
    (trajectory([0.0, 0.0], [0.5, 0.0], [0.6, 0.0],
                velocities=[[0.0, 0.0], [-10.1, 0.0], [0.0, 0.0]]),
     'points[1].velocities (joint1) is -10.1, expected a value within its limits [-10, 10]'),
    (trajectory([0.0, 0.0], [2.0, 0.0], [3.0, 3.0]), '3 values are beyond a limit'),
])
def test_a_point_beyond_a_limit_is_named(sent, words):
    with pytest.raises(TrajectoryError) as raised:
        check_points(ARM, sent)
    assert words in str(raised.value)
    assert 'infeasible_trajectory' in str(raised.value)


def test_the_start_of_a_trajectory_may_be_where_the_arm_stands():
    start = 1.5 + 0.0086  # [rad] within half a degree
    check_points(ARM, trajectory([start, 0.0], [1.0, 0.0]))
    for sent in (trajectory([start, 0.0]), trajectory([1.0, 0.0], [start, 0.0]),
                 trajectory([1.5 + 0.0088, 0.0], [1.0, 0.0])):
        with pytest.raises(TrajectoryError, match='joint1'):
            check_points(ARM, sent)


def test_points_at_the_limits_pass_whatever_their_rounding():
    check_points(ARM, trajectory([1.5 + 1e-9, -2.0], velocities=[[10.0, -10.0 - 1e-9]]))


def test_joints_without_limits_go_anywhere():
    check_points(UNLIMITED, trajectory([50.0, -900.0]))
    assert motion_excesses(UNLIMITED, trajectory([0.0, 0.0], [5.0, -5.0])) == []


@laws
@given(values)
def test_clipped_trajectories_pass_and_are_as_near_as_can_be(numbers):
    q = np.array(numbers).reshape(2, 2)
    sent = trajectory(*q, velocities=[[1.0, 2.0], [0.0, 0.0]])
    found = with_clipped_positions(ARM, sent)
    check_points(ARM, found)
    for before, after in zip(sent.points, found.points):
        expected = np.clip(before.position, ARM.limits.lower, ARM.limits.upper)
        assert after.position.tolist() == expected.tolist()
        assert after.velocity.tolist() == np.where(
            expected == before.position, before.velocity, 0.0).tolist()
        assert after.time_from_start == before.time_from_start


@laws
@given(values)
def test_a_set_point_with_lowered_velocity_passes(numbers):
    v = np.array(numbers[:2])
    found = with_clipped_velocity(ARM, trajectory([0.0, 0.0], velocities=[v]))
    check_points(ARM, found)
    assert found.points[0].velocity.tolist() == np.clip(v, -10.0, 10.0).tolist()
    sent = trajectory([0.0, 0.0])
    assert with_clipped_velocity(ARM, sent) is sent


def test_a_motion_is_judged_between_its_points():
    fast = make_trajectory(NAMES, [0.0, 0.1], [[0.0, 0.0], [0.0, 1.5]], (), (), NAMES)
    assert motion_excesses(ARM, fast) == [
        "velocity of 'joint2' is 15 at 0 s, outside its limits [-10, 10]"]
    # from 0 at 3 rad/s to rest at 1.5 rad within 1 s: q = 3 s − 1.5 s², exactly at the limit
    at_limit = trajectory([0.0, 0.0], [1.5, 0.0], velocities=[[3.0, 0.0], [0.0, 0.0]])
    assert motion_excesses(ARM, at_limit) == []


def test_the_extrema_of_a_motion_are_exact():
    """The cubic 12 s (1 − s)² has its maximum 16/9 at s = 1/3."""
    beyond = trajectory([0.0, 0.0], [0.0, 0.0], velocities=[[12.0, 0.0], [0.0, 0.0]])
    assert motion_excesses(ARM, beyond) == [
        "position of 'joint1' is 1.77778 at 0.333333 s, outside its limits [-1, 1.5]",
        "velocity of 'joint1' is 12 at 0 s, outside its limits [-10, 10]"]


# --- the controller ------------------------------------------------------------------------------

def controller(**changes: Any) -> Controller:
    one = Controller(ARM, ControllerOptions(make_gains(NAMES), checks_goals=True, **changes))
    update(one, 1, np.zeros(2), np.zeros(2))
    return one


def reached(one: Controller) -> list[float]:
    """Return the final position of the reference."""
    return list(update(one, 1 + 10**11, np.zeros(2), np.zeros(2)).reference.position)


@pytest.mark.parametrize('is_conditioned', [False, True])
def test_a_rejected_set_point_leaves_the_reference(is_conditioned):
    one = controller(conditions_references=is_conditioned)
    one.follow(trajectory([0.5, 0.5]), 0)
    for sent in (trajectory([50.0, 0.0]), trajectory([0.0, 0.0], velocities=[[1e9, 0.0]]),
                 trajectory([0.0, 0.0], [0.0, 50.0])):
        with pytest.raises(TrajectoryError, match='beyond|expected a value within its limits'):
            one.follow(sent, 0)
    assert reached(one) == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize('is_conditioned', [False, True])
@pytest.mark.parametrize(('sent', 'goal'), [
    (trajectory([50.0, 0.0]), [1.5, 0.0]),
    (trajectory([0.0, 0.0], [0.0, -50.0]), [0.0, -2.0])])
def test_positions_are_clipped_if_so_chosen(is_conditioned, sent, goal):
    one = controller(conditions_references=is_conditioned, slows_down=True, clips_positions=True)
    one.follow(sent, 0)
    assert reached(one) == pytest.approx(goal)


def test_slowing_down_lowers_velocities_and_leaves_positions():
    one = controller(conditions_references=True, slows_down=True)
    with pytest.raises(TrajectoryError, match='joint1'):
        one.follow(trajectory([50.0, 0.0]), 0)
    one.follow(trajectory([0.1, 0.0], velocities=[[1e9, 0.0]]), 0)
    one.follow(trajectory([0.0, 0.0], [0.5, 0.0], [1.0, 0.0],
                          velocities=[[0.0, 0.0], [20.0, 0.0], [0.0, 0.0]]), 0)
    assert one.followed.slowness > 1.9
