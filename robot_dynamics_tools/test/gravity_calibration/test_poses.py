# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The poses for a calibration: within the limits, informative, and the same for a seed."""

from calibration_bench import poses_of, TOOL_LINKS
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.payload import make_payload
from robot_dynamics_tools.gravity_calibration.poses import select_poses
from robots import arm_without_gripper


@pytest.mark.parametrize('name', TOOL_LINKS)
def test_poses_and_their_approaches_are_within_the_limits(name):
    arm = arm_without_gripper(name)
    arm = arm.with_payloads([make_payload(TOOL_LINKS[name], 2.0)])
    poses = select_poses(arm, 10)
    assert poses.positions.shape == poses.gravity.shape == (10, arm.joint_count)
    # 0.1 rad for the approach, and 5 % of the range; ±π for a joint without limits
    lower, upper = np.clip([arm.limits.lower, arm.limits.upper], -20.0, 20.0)
    margin = 0.1 + 0.05 * np.where(upper - lower < 40.0, upper - lower, 0.0)
    assert (poses.positions >= lower + margin - 1e-9).all()
    assert (poses.positions <= upper - margin + 1e-9).all()
    np.testing.assert_allclose(poses.gravity, RigidBody(arm).gravity_batch(poses.positions))
    assert (abs(poses.gravity) <= 0.6 * arm.limits.effort).all()


def test_bounds_contain_the_approaches():
    arm = arm_without_gripper('xarm7')
    poses = select_poses(arm, 8, lower=np.full(7, -0.9), upper=np.full(7, 0.3)).positions
    assert poses.min() >= -0.8
    assert poses.max() <= 0.2


def test_selected_poses_are_more_informative_than_random_ones():
    """The variance of the gravity torque is the information on a scale, besides its offset."""
    arm = arm_without_gripper('xarm7')
    spread = np.log(select_poses(arm, 10).gravity[:, 1:].var(axis=0)).sum()
    rng = np.random.default_rng(1)
    q = rng.uniform(np.maximum(arm.limits.lower, -3.0), np.minimum(arm.limits.upper, 3.0), (
        50, 10, 7))
    random = [np.log(RigidBody(arm).gravity_batch(each)[:, 1:].var(axis=0)).sum() for each in q]
    assert spread > max(random)


def test_a_seed_gives_the_same_poses_in_a_short_order():
    arm = arm_without_gripper('xarm7')
    poses = poses_of(arm)
    np.testing.assert_array_equal(poses, poses_of(arm))
    assert not np.array_equal(poses, select_poses(arm, 12, seed=1).positions)

    def length(q: np.ndarray) -> float:
        return float(abs(np.diff(q, axis=0)).max(axis=1).sum())

    rng = np.random.default_rng(0)
    assert length(poses) < np.mean([length(rng.permutation(poses)) for _ in range(20)])


@pytest.mark.parametrize(('change', 'message'), [
    ({'count': 7}, 'count is 7, expected 8 to 20 poses'),
    ({'lower': np.zeros(7), 'upper': np.full(7, 0.15)},
     "the joint 'joint1' has the bounds 0.1 and 0.05 for a pose, expected a range of more than "
     '0.2'),
    ({'load': 200.0}, 'of 4000 random poses need at most 60 % of the effort limits, expected 12'),
    ({'lower': [0.0]}, 'lower has 1 value'),
])
def test_what_permits_no_poses_is_refused(change, message):
    load = make_payload('link7', change.get('load', 0.0))
    arm = arm_without_gripper('xarm7').with_payloads([load])
    with pytest.raises(InvalidInputError, match=message):
        select_poses(arm, change.get('count', 12), change.get('lower'), change.get('upper'))
