# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Inverse kinematics: the pose is reached within the limits, or refused with the residual."""

from hypothesis import given, settings
from hypothesis import strategies as st
from lock_step_loop import smooth_arm
import numpy as np
import pinocchio as pin
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.task_space import TaskSpace
from robot_dynamics.task_space.frame_kinematics import FrameKinematics, last_link, rotation_vector
from robot_dynamics.task_space.inverse_kinematics import joints_at

ROBOTS = ['default', 'ur5', 'panda']
DISTANCE, ANGLE = 1e-4, 1e-3  # [m], [rad] up to which a pose is reached


def bounds(arm: ArmModel) -> tuple[np.ndarray, np.ndarray]:
    return np.maximum(arm.limits.lower, -3.0), np.minimum(arm.limits.upper, 3.0)


@pytest.mark.parametrize('robot', ROBOTS)
def test_pose_and_jacobian_are_those_of_task_space(robot):
    arm = smooth_arm(robot)
    link = last_link(arm)
    kinematics, task = FrameKinematics(arm, link), TaskSpace(arm, link)
    for q in np.random.default_rng(0).uniform(*bounds(arm), (5, arm.joint_count)):
        state = task.at(q)
        p, R, J = kinematics.jacobian(q)
        assert p == pytest.approx(state.translation)
        assert pytest.approx(state.rotation) == R
        assert pytest.approx(state.jacobian) == J
        assert kinematics.pose(q)[0] == pytest.approx(p)


@pytest.mark.parametrize('robot', ROBOTS)
@settings(max_examples=20)
@given(seed=st.integers(0, 100_000))
def test_a_pose_nearby_is_reached_within_the_limits(robot, seed):
    arm, rng = smooth_arm(robot), np.random.default_rng(seed)
    kinematics, (lower, upper) = FrameKinematics(arm, last_link(arm)), bounds(arm)
    start = rng.uniform(lower, upper)
    p, R = kinematics.pose(np.clip(start + rng.uniform(-0.1, 0.1, len(start)), lower, upper))
    q = joints_at(arm, kinematics, start, p, R)
    assert ((q >= arm.limits.lower) & (q <= arm.limits.upper)).all()
    reached, turned = kinematics.pose(q)
    assert np.linalg.norm(reached - p) <= DISTANCE
    assert arm.joint_count < 6 or np.linalg.norm(rotation_vector(turned @ R.T)) <= ANGLE


def test_no_joint_makes_more_than_half_a_turn():
    arm = smooth_arm('ur5')  # its joints have two turns
    kinematics, rng = FrameKinematics(arm, last_link(arm)), np.random.default_rng(5)
    found = 0
    for start, goal in rng.uniform(-3.0, 3.0, (15, 2, 6)):
        try:
            q = joints_at(arm, kinematics, start, *kinematics.pose(goal))
        except InvalidInputError:
            continue
        found += 1
        assert np.abs(q - start).max() <= np.pi + 1e-9
    assert found > 7


def test_two_joints_reach_a_translation_with_any_rotation():
    arm = smooth_arm('default')
    kinematics, start = FrameKinematics(arm, 'tool0'), np.array([0.8, 0.5])
    p, R = kinematics.pose(start + 0.1)
    q = joints_at(arm, kinematics, start, p, pin.exp3(np.array([0.0, 0.0, 1.0])) @ R)
    assert kinematics.pose(q)[0] == pytest.approx(p, abs=DISTANCE)


@pytest.mark.parametrize('robot', ['panda', 'default'])
def test_a_pose_out_of_reach_is_refused_with_its_distance(robot):
    arm = smooth_arm(robot)
    kinematics = FrameKinematics(arm, last_link(arm))
    with pytest.raises(InvalidInputError, match=r'is (\d|\.)+ m and .* rad from the nearest pose'):
        joints_at(arm, kinematics, np.full(arm.joint_count, 0.3), np.full(3, 9.0), np.eye(3))
