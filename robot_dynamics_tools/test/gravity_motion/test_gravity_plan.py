# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The poses of `calibrate_gravity --move`, their order and the moves between them, without ROS."""

from pathlib import Path
import re

from controller_bench import ARM
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.gravity_motion.plan import (
    approach_of,
    make_plan,
    MotionSettings,
    position_bounds,
)
from robot_dynamics_tools.gravity_motion.poses import chosen_poses, gravity_share, PoseChoice
from robot_dynamics_tools.gravity_motion.preview import preview

URDF = default_arm_urdf()
LIMITED_URDF = URDF.replace('type="continuous"', 'type="revolute"').replace(
    '<limit ', '<limit lower="-1.5" upper="2.0" ')
SLIDING = LIMITED_URDF.replace('type="revolute"', 'type="prismatic"', 1)
LIMITED = load_arm(LIMITED_URDF)


def written(path: Path, text: str) -> PoseChoice:
    file = path / 'poses.yaml'
    file.write_text(text, encoding='utf-8')
    return PoseChoice(file, least=1)


# --- the moves -----------------------------------------------------------------------------------

def test_each_pose_is_held_from_both_sides():
    poses = np.array([[1.2, 0.3], [-0.8, 0.9], [0.1, -0.7]])
    plan = make_plan(LIMITED, np.array([0.4, 0.2]), poses, MotionSettings())
    here, held = plan.start, []
    for i, move in plan.moves():
        if move.hold:
            held.append((i, *np.sign(here - move.goal)))
            np.testing.assert_allclose(np.abs(here - move.goal), 0.1, rtol=1e-12)
            np.testing.assert_array_equal(move.goal, plan.poses[i])
            # a quintic over 0.1 rad, with a tenth of 0.5 rad/s at most
            assert move.duration == pytest.approx(1.875 * 0.1 / 0.05)
        here = move.goal
    assert held == [(i, side, side) for i in range(3) for side in (1.0, -1.0)]


def test_moves_stay_within_step_velocity_and_the_box_of_the_poses():
    poses = np.array([[1.2, 0.3], [-0.8, 0.9], [0.1, -0.7]])
    start = np.array([0.4, 0.2])
    plan = make_plan(LIMITED, start, poses, MotionSettings(step=0.3, velocity=0.25))
    goals = [start, *(move.goal for _, move in plan.moves())]
    ways = np.abs(np.diff(goals, axis=0))
    assert ways.max() <= 0.3 + 1e-12
    for way, (_, move) in zip(ways, plan.moves()):
        assert 1.875 * way.max() / move.duration <= 0.25 + 1e-12  # the peak of a quintic
    assert (np.min(goals, axis=0) >= poses.min(axis=0) - 0.1 - 1e-12).all()
    assert (np.max(goals, axis=0) <= poses.max(axis=0) + 0.1 + 1e-12).all()
    assert plan.seconds == pytest.approx(6 * 2.0 + sum(move.duration for _, move in plan.moves()))


def test_a_continuous_joint_does_not_wind_up():
    start = np.array([2.5 + 4.0 * np.pi, 0.0])
    poses = np.array([[-3.0, 0.0], [3.0, 0.0]])
    plan = make_plan(ARM, start, poses, MotionSettings(step=10.0))
    goals = np.array([plan.start, *(move.goal for _, move in plan.moves())])
    np.testing.assert_allclose(plan.start, [2.5, 0.0], atol=1e-12)
    np.testing.assert_array_equal(plan.poses, poses)
    assert np.abs(goals).max() <= 3.1 + 1e-12
    assert np.abs(np.diff(goals, axis=0)).max() <= 1.5  # the node takes the shortest angle


def test_defaults_follow_the_kind_of_the_joint():
    arm = load_arm(SLIDING)
    np.testing.assert_allclose(approach_of(arm, None), [0.02, 0.1])
    small = load_arm(SLIDING.replace('lower="-1.5" upper="2.0"', 'lower="0" upper="0.1"'))
    np.testing.assert_allclose(approach_of(small, None), 0.005)  # 0.05 of the range
    plan = make_plan(arm, np.zeros(2), np.zeros((1, 2)), MotionSettings())
    np.testing.assert_allclose(plan.step, [0.1, 0.5])
    np.testing.assert_allclose(plan.velocity, [0.1, 0.5])
    np.testing.assert_allclose(approach_of(arm, 0.05), 0.05)


# --- the poses -----------------------------------------------------------------------------------

def test_selected_poses_stay_within_ranges_and_efforts():
    weight = make_payload('link2', 2.0, (0.0, 0.0, 0.4))
    choice = PoseChoice(number=8, ranges=[['joint2', '-0.6', '0.9']])
    poses = chosen_poses(LIMITED, choice, np.array([0.2, 0.2]), weight)
    assert poses.shape == (8, 2)
    assert (np.abs(poses[:, 1] - 0.15) <= 0.55 + 1e-12).all()
    assert (np.abs(poses[:, 0] - 0.25) <= 1.55 + 1e-12).all()
    assert gravity_share(LIMITED, poses, weight).max() <= 0.8
    np.testing.assert_array_equal(
        poses, chosen_poses(LIMITED, choice, np.array([0.2, 0.2]), weight))


@pytest.mark.parametrize(('text', 'said'), [
    ('poses: []', 'has no list `poses` of 1 to 30 entries'),
    ('poses: [{joint1: 0}]', "pose 1 has ['joint1'], expected a position of each of"),
    ('poses: [{joint1: 0, joint2: 0}, {joint1: .nan, joint2: 0}]', 'pose 2, joint1 is nan'),
    ('poses: [{joint1: 0, joint2: 1.95}]', 'pose 1 has joint2 at 1.95, expected a value in '
                                           '[-1.4, 1.9]'),
])
def test_files_of_poses_are_checked(tmp_path, text, said):
    with pytest.raises(InvalidInputError, match=re.escape(said)):
        chosen_poses(LIMITED, written(tmp_path, text), approach_of(LIMITED, None), None)


def test_a_pose_that_the_arm_can_hardly_hold_is_rejected(tmp_path):
    choice = written(tmp_path, 'poses: [{joint2: 0, joint1: 0.4}, {joint1: 1.5707, joint2: 0}]')
    delta = approach_of(ARM, None)
    np.testing.assert_array_equal(
        chosen_poses(ARM, choice, delta, None), [[0.4, 0.0], [1.5707, 0.0]])
    weight = make_payload('link2', 4.0, (0.0, 0.0, 0.8))
    share = np.abs(ArmDynamics(ARM.with_payloads([weight])).gravity(
        np.array([1.5707, 0.0])))[0] / ARM.limits.effort[0]
    with pytest.raises(InvalidInputError) as raised:
        chosen_poses(ARM, choice, delta, weight)
    assert str(raised.value) == (
        f'gravity at pose 2 takes {100.0 * share:.0f} % of the effort limit of joint1 with 4 kg '
        'on link2, expected at most 80 %')


@pytest.mark.parametrize(('ranges', 'said'), [
    (['joint3', '0', '1'], "--range has joint 'joint3', expected one of: joint1, joint2"),
    (['joint1', '-45', '45'], '--range of joint1 is -45, expected a number in [-1.5, 2]'),
    (['joint1', '0.1', '0.2'], 'the range of joint1 is [0.1, 0.2], expected one of at least 0.2'),
])
def test_ranges_are_checked(ranges, said):
    with pytest.raises(InvalidInputError, match=re.escape(said)):
        position_bounds(LIMITED, [ranges], np.array([0.1, 0.1]))


@pytest.mark.parametrize(('settings', 'said'), [
    (MotionSettings(hold=1.49), '--hold is 1.49, expected a number in [1.5, 600]'),
    (MotionSettings(velocity=-1.0), '--velocity is -1, expected'),
])
def test_settings_are_checked(settings, said):
    with pytest.raises(InvalidInputError, match=re.escape(said)):
        make_plan(ARM, np.zeros(2), np.zeros((1, 2)), settings)


def test_the_preview_has_units_torques_and_the_duration():
    arm = load_arm(SLIDING)
    plan = make_plan(arm, np.zeros(2), np.array([[0.5, np.pi / 6.0]]), MotionSettings())
    weight = make_payload('link2', 1.0, (0.0, 0.0, 0.4))
    text = preview(plan, '/dynamics', weight, ['bag', 'bag-with-weight'])
    rows = [line.split() for line in text.splitlines()]
    assert ['pose', 'joint1', '[m]', 'joint2', '[deg]'] in rows
    assert ['1', '0.500', '30.0'] in rows
    for load in (None, weight):
        share = 100.0 * gravity_share(arm, plan.poses, load)[0]
        assert ['1', *(f'{value:.0f}' for value in share)] in rows
    assert "Gravity torque with 1 kg on 'link2' [% of the effort limit]" in text
    assert f'at least {2.0 * plan.seconds:.0f} s' in text
    assert 'Collisions are not checked' in text
