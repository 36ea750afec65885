# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A joint that rests away from the end of its reference is named, with the probable cause."""

from lock_step_loop import FIRST_STAMP, MS, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.rest import shortfall
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

START = np.array([0.7, 0.5])
GOAL = np.array([0.8, 0.7])


def rests_at(
    position: np.ndarray, coulomb: float = 0.0, patience: float = 0.51,
) -> str:
    """Return the shortfall of an arm that rests at a position `patience` [s] after its motion."""
    arm = smooth_arm('default')
    arm = arm.with_friction(make_friction(arm.joint_names, coulomb=[coulomb]))
    loop = ControlLoop.of_arm(arm)
    # A motion of the arm that stops short; its sensors have noise.
    k, last_ns = 0, FIRST_STAMP + 200 * MS
    while FIRST_STAMP + k * MS <= last_ns:
        if k == 200:
            loop.follow(make_trajectory(arm.joint_names, [0.0], [GOAL]))
            last_ns = loop.controller.trajectory.end_ns + round(1e9 * patience)
        reference = loop.reference
        q = START if reference is None else reference.position
        way = np.minimum(np.abs(q - START), np.abs(position - START))
        q = START + np.sign(position - START) * way
        loop.answer(FIRST_STAMP + k * MS, q + 1e-9 * (k % 7), None)
        k += 2
    assert loop.supervisor.fault_count == 0
    return shortfall(loop.controller)


def test_a_joint_at_its_goal_is_not_named():
    assert rests_at(GOAL) == ''
    assert rests_at(GOAL - [0.0, 0.0099]) == ''
    assert rests_at(GOAL - [0.0, 0.0101]) != ''


def test_a_joint_is_not_named_within_half_a_second_after_its_motion():
    assert rests_at(GOAL - [0.0, 0.1], patience=-0.2) == ''
    assert rests_at(GOAL - [0.0, 0.1], patience=0.49) == ''
    assert rests_at(GOAL - [0.0, 0.1], patience=0.51) != ''


@pytest.mark.parametrize(('missing', 'coulomb', 'cause'), [
    (0.03, 1.5, 'dry friction can hold it'),
    (0.03, 0.0, 'dry friction, which the model lacks, can hold it'),
    (0.15, 0.0, 'a load that the model does not contain')])
def test_a_joint_that_does_not_arrive_is_named(missing, coulomb, cause):
    words = rests_at(GOAL - [0.0, missing], coulomb=coulomb)
    assert words.startswith(
        f"'joint2' rests {1e3 * missing:.3g} mrad from its goal, expected at most 10 mrad")
    assert cause in words
    assert 'stiffness' in words
    assert 'N·m/rad' in words


def test_all_joints_that_do_not_arrive_are_named():
    words = rests_at(GOAL - [0.02, 0.1])
    assert words.startswith("'joint2' rests")
    assert '(joint1 too)' in words
