# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Trajectories and set-points compared with the position and velocity limits of an arm.

Trajectories from messages: the order of joints, precision, and rejections.
"""

import array
from dataclasses import replace
import math
from pathlib import Path
import re
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
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.references.reference_generator import ReferenceGenerator
from robot_dynamics.trajectories.goal_limits import (
    check_points,
    motion_excesses,
    with_clipped_positions,
    with_clipped_velocity,
)
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from two_joint_trajectories import assert_same, EPOCH, JOINTS, laws, SECOND, trajectory

NAMES = ('joint1', 'joint2')
UNLIMITED = load_arm(default_arm_urdf())
ARM = replace(UNLIMITED, limits=replace(
    UNLIMITED.limits, lower=np.array([-1.0, -2.0]), upper=np.array([1.5, 2.0])))
"""Velocity limits of 10 rad/s."""

few = settings(max_examples=30)
vectors_of_four = st.lists(st.floats(-60.0, 60.0), min_size=4, max_size=4)


def through(*positions: Any, velocities: Any = ()) -> JointTrajectory:
    return make_trajectory(
        NAMES, [1.0 * i for i in range(len(positions))], positions, velocities, (), NAMES)


@pytest.mark.parametrize(('sent', 'words'), [
    (through([50.0, 0.0]),
     'points[0].positions (joint1) is 50, expected a value within its limits [-1, 1.5]'),
    (through([0.0, 0.0], [0.0, -2.1]),
     'points[1].positions (joint2) is -2.1, expected a value within its limits [-2, 2]'),
    (through([0.0, 0.0], velocities=[[0.0, 1e9]]),
     'points[0].velocities (joint2) is 1e+09, expected a value within its limits [-10, 10]'),
    (through([0.0, 0.0], [0.5, 0.0], [0.6, 0.0],
                velocities=[[0.0, 0.0], [-10.1, 0.0], [0.0, 0.0]]),
     'points[1].velocities (joint1) is -10.1, expected a value within its limits [-10, 10]'),
    (through([0.0, 0.0], [2.0, 0.0], [3.0, 3.0]), '3 values are beyond a limit'),
])
def test_a_point_beyond_a_limit_is_named(sent, words):
    with pytest.raises(TrajectoryError) as raised:
        check_points(ARM, sent)
    assert words in str(raised.value)
    assert 'infeasible_trajectory' in str(raised.value)


def test_the_start_of_a_trajectory_may_be_where_the_arm_stands():
    start = 1.5 + 0.0086  # [rad] within half a degree
    check_points(ARM, through([start, 0.0], [1.0, 0.0]))
    for sent in (through([start, 0.0]), through([1.0, 0.0], [start, 0.0]),
                 through([1.5 + 0.0088, 0.0], [1.0, 0.0])):
        with pytest.raises(TrajectoryError, match='joint1'):
            check_points(ARM, sent)


def test_points_at_the_limits_pass_whatever_their_rounding():
    check_points(ARM, through([1.5 + 1e-9, -2.0], velocities=[[10.0, -10.0 - 1e-9]]))


def test_joints_without_limits_go_anywhere():
    check_points(UNLIMITED, through([50.0, -900.0]))
    assert motion_excesses(UNLIMITED, through([0.0, 0.0], [5.0, -5.0])) == []


@few
@given(vectors_of_four)
def test_clipped_trajectories_pass_and_are_as_near_as_can_be(numbers):
    q = np.array(numbers).reshape(2, 2)
    sent = through(*q, velocities=[[1.0, 2.0], [0.0, 0.0]])
    found = with_clipped_positions(ARM, sent)
    check_points(ARM, found)
    for before, after in zip(sent.points, found.points):
        expected = np.clip(before.position, ARM.limits.lower, ARM.limits.upper)
        assert after.position.tolist() == expected.tolist()
        assert after.velocity.tolist() == np.where(
            expected == before.position, before.velocity, 0.0).tolist()
        assert after.time_from_start == before.time_from_start


@few
@given(vectors_of_four)
def test_a_set_point_with_lowered_velocity_passes(numbers):
    v = np.array(numbers[:2])
    found = with_clipped_velocity(ARM, through([0.0, 0.0], velocities=[v]))
    check_points(ARM, found)
    assert found.points[0].velocity.tolist() == np.clip(v, -10.0, 10.0).tolist()
    sent = through([0.0, 0.0])
    assert with_clipped_velocity(ARM, sent) is sent


def test_a_motion_is_judged_between_its_points():
    fast = make_trajectory(NAMES, [0.0, 0.1], [[0.0, 0.0], [0.0, 1.5]], (), (), NAMES)
    assert motion_excesses(ARM, fast) == [
        "velocity of 'joint2' is 15 at 0 s, outside its limits [-10, 10]"]
    # from 0 at 3 rad/s to rest at 1.5 rad within 1 s: q = 3 s − 1.5 s², exactly at the limit
    at_limit = through([0.0, 0.0], [1.5, 0.0], velocities=[[3.0, 0.0], [0.0, 0.0]])
    assert motion_excesses(ARM, at_limit) == []


def test_the_extrema_of_a_motion_are_exact():
    """The cubic 12 s (1 − s)² has its maximum 16/9 at s = 1/3."""
    beyond = through([0.0, 0.0], [0.0, 0.0], velocities=[[12.0, 0.0], [0.0, 0.0]])
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
    one.follow(through([0.5, 0.5]), 0)
    for sent in (through([50.0, 0.0]), through([0.0, 0.0], velocities=[[1e9, 0.0]]),
                 through([0.0, 0.0], [0.0, 50.0])):
        with pytest.raises(TrajectoryError, match='beyond|expected a value within its limits'):
            one.follow(sent, 0)
    assert reached(one) == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize('is_conditioned', [False, True])
@pytest.mark.parametrize(('sent', 'goal'), [
    (through([50.0, 0.0]), [1.5, 0.0]),
    (through([0.0, 0.0], [0.0, -50.0]), [0.0, -2.0])])
def test_positions_are_clipped_if_so_chosen(is_conditioned, sent, goal):
    one = controller(conditions_references=is_conditioned, slows_down=True, clips_positions=True)
    one.follow(sent, 0)
    assert reached(one) == pytest.approx(goal)


def test_slowing_down_lowers_velocities_and_leaves_positions():
    one = controller(conditions_references=True, slows_down=True)
    with pytest.raises(TrajectoryError, match='joint1'):
        one.follow(through([50.0, 0.0]), 0)
    one.follow(through([0.1, 0.0], velocities=[[1e9, 0.0]]), 0)
    one.follow(through([0.0, 0.0], [0.5, 0.0], [1.0, 0.0],
                          velocities=[[0.0, 0.0], [20.0, 0.0], [0.0, 0.0]]), 0)
    assert one.followed.slowness > 1.9


@laws
@given(order=st.permutations(range(4)), fields=st.integers(1, 3), span=st.integers(0, 3 * SECOND))
def test_the_order_of_the_joints_in_a_message_does_not_matter(order, fields, span):
    joints = ('a', 'b', 'c', 'd')
    rows = np.random.default_rng(7).uniform(-1.0, 1.0, (3, 3, 4))
    rows[1, -1] = 0.0
    given_rows = [rows[k] if k < fields else () for k in range(3)]
    mixed_rows = [rows[k][:, order] if k < fields else () for k in range(3)]
    times, before = (0.5, 1.0, 2.0), Reference(*np.zeros((3, 4)))
    straight = make_trajectory(joints, times, *given_rows, joints)
    mixed = make_trajectory([joints[i] for i in order], times, *mixed_rows, joints)
    assert mixed.joint_names == joints
    left, right = (
        ActiveTrajectory(t, EPOCH, EPOCH, before).sample(EPOCH + span) for t in (straight, mixed))
    assert_same(left, right, 0.0)


def test_rows_come_as_a_message_holds_them():
    mine = np.array((0.3, 0.4))
    path = trajectory(
        (1.0, 2.0, 3.0),
        [array.array('d', (0.1, 0.2)), mine, (1, 2)],
        [array.array('d', (1.0, 2.0)), array.array('d'), (0.0, 0.0)],
        [None, (), []],
        names=('elbow', 'shoulder'))
    mine[:] = 9.0
    assert [p.time_from_start for p in path.points] == [1.0, 2.0, 3.0]
    np.testing.assert_array_equal(path.points[1].position, (0.4, 0.3))
    np.testing.assert_array_equal(path.points[0].position, (0.2, 0.1))
    np.testing.assert_array_equal(path.points[0].velocity, (2.0, 1.0))
    assert path.points[1].velocity is None
    assert all(p.acceleration is None for p in path.points)
    assert path.duration == 3.0
    assert not path.is_set_point


GOOD = {
    'names': JOINTS, 'times': (1.0, 2.0), 'q': ((0.1, 0.2), (0.3, 0.4)),
    'v': ((0.1, 0.2), (0.0, 1.1e-7)), 'a': ((0.1, 0.2), (0.3, 0.4)),
}
REFUSALS = [
    ({'names': ()}, "joint_names is empty, expected ['shoulder', 'elbow']"),
    ({'names': ('shoulder', 'wrist')},
     "joint_names has 'wrist', expected only joints of this arm: ['shoulder', 'elbow']"),
    ({'names': ('elbow',)},
     "joint_names is ['elbow'], which lacks ['shoulder'], expected all of ['shoulder', 'elbow']"),
    ({'names': ('elbow', 'shoulder', 'elbow')},
     "joint_names has 'elbow' twice, expected each name once"),
    ({'times': ()}, 'points is empty, expected at least one point'),
    ({'times': (-0.5, 1.0)}, 'points[0].time_from_start is -0.5, expected a number in '),
    ({'times': (0.0, math.nan)}, 'points[1].time_from_start is nan, expected a finite number'),
    ({'times': (1.0, 1.0)}, 'points[1].time_from_start is 1.0 s, expected more than the 1.0 s of '
                            'points[0], by 1 ns or more'),
    ({'times': (1.0, 1.0 + 2e-10)}, 'points[1].time_from_start is 1.0000000002 s'),
    ({'q': ()}, 'points[0].positions is empty, expected 2 values, one for each of '
                "['shoulder', 'elbow']: a point needs its positions"),
    ({'q': ((0.1, 0.2),)}, 'positions has 1 rows, expected 2, one for each point'),
    ({'q': ((0.1, 0.2), (0.3,))}, 'points[1].positions has 1 values, expected 2, one for each of '
                                  "['shoulder', 'elbow']"),
    ({'q': (0.1, 0.2)}, 'points[0].positions has an array of shape (), expected 2'),
    ({'q': ((0.1, math.nan), (0.3, 0.4))},
     'points[0].positions[1] (elbow) is nan, expected a finite number'),
    ({'q': ((0.1, 0.2), (0.3, 1e308))},
     'points[1].positions[1] (elbow) is 1e+308, expected a number in [-1e+09, 1e+09]'),
    ({'v': ((0.1, 0.2), (0.0, 0.3))},
     'points[1].velocities[1] (elbow) is 0.3, expected 0 at the last point, where the arm '
     'has to be at rest'),
    ({'v': ((0.1, 0.2), (0.0, 1.3e-7))}, 'points[1].velocities[1] (elbow) is 1.3e-07'),
    ({'v': ()}, 'points[0].velocities is empty although accelerations are given, expected 2 '
     'values, one for'),
    ({'a': ((0.1, 0.2), (0.0,))}, 'points[1].accelerations has 1 values, expected 2'),
]


@pytest.mark.parametrize(('change', 'words'), REFUSALS, ids=[words for _, words in REFUSALS])
def test_a_refusal_names_point_field_value_and_expectation(change, words):
    assert isinstance(trajectory(**GOOD), JointTrajectory)
    with pytest.raises(TrajectoryError) as refusal:
        trajectory(**{**GOOD, **change})
    assert words in str(refusal.value)


def test_the_documented_words_are_the_words():
    page = (Path(__file__).parents[2] / 'docs' / 'trajectories.md').read_text(encoding='utf-8')
    table = page.split('## Rejected trajectories')[1].split('\n## ')[0]
    documented = re.findall(r'^\|[^|]+\| `(.+)` \|$', table, re.MULTILINE)
    spoken = set()
    for change, _ in REFUSALS:
        with pytest.raises(TrajectoryError) as refusal:
            trajectory(**{**GOOD, **change})
        spoken.add(str(refusal.value))
    with pytest.raises(TrajectoryError) as refusal:
        ReferenceGenerator(JOINTS).start(
            trajectory(), 10 * SECOND, (0.0, 0.0), (0.0, 0.0), stamp_ns=7 * SECOND)
    spoken.add(str(refusal.value))
    urdf = default_arm_urdf().replace('joint1', 'shoulder').replace('joint2', 'elbow').replace(
        'type="continuous"', 'type="revolute"').replace('<limit ', '<limit lower="-2" upper="2" ')
    for change in ({'q': ((0.1, 0.2), (0.3, 2.5))}, {'v': ((0.1, 11.0), (0.0, 0.0))}):
        with pytest.raises(TrajectoryError) as refusal:
            check_points(load_arm(urdf), trajectory(**{**GOOD, **change}))
        spoken.add(str(refusal.value))
    unread = [words for words in documented  # by test_cdr_templates
              if words.endswith('would delay control') or 'cannot be read' in words]
    assert (len(documented), len(unread)) == (5, 1)
    assert [words for words in documented if words not in spoken] == unread


def test_the_index_in_a_refusal_is_the_senders():
    with pytest.raises(TrajectoryError, match=r'velocities\[0\] \(elbow\) is 0.3'):
        trajectory(v=((0.0, 0.0), (0.3, 0.0)), names=('elbow', 'shoulder'))
