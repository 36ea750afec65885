# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A joint that rests away from the end of its reference is named, with the probable cause."""

from lock_step_loop import FIRST_STAMP, LockStep, MS, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.rest import shortfall
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

START = np.array([0.7, 0.5])
GOAL = np.array([0.8, 0.7])


def rests_at(position: np.ndarray, patience: float = 0.51, speed: float = 0.0) -> str:
    """
    Return the shortfall of an arm that rests at a position `patience` [s] after its motion.

    In the last 0.1 s its joints move away from there at a speed [rad/s].
    """
    arm = smooth_arm('default')
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
        moved = max(FIRST_STAMP + k * MS - last_ns + 100 * MS, 0) if k > 200 else 0
        q = START + np.sign(position - START) * way + 1e-9 * moved * speed
        loop.answer(FIRST_STAMP + k * MS, q + 1e-9 * (k % 7), None)
        k += 2
    assert loop.supervisor.fault_count == 0
    return shortfall(loop.controller, loop.drives)


@pytest.mark.parametrize(('away', 'patience', 'speed', 'is_named'), [
    (0.0, 0.51, 0.0, False), (0.0099, 0.51, 0.0, False), (0.0101, 0.51, 0.0, True),
    (0.1, -0.2, 0.0, False), (0.1, 0.49, 0.0, False), (0.1, 0.51, 0.0, True),
    (0.1, 0.51, 0.015, True), (0.1, 0.51, 0.03, False), (0.1, 0.51, -0.03, False)])
def test_a_joint_that_rests_10_mrad_away_for_half_a_second_is_named(
        away, patience, speed, is_named):
    assert bool(rests_at(GOAL - [0.0, away], patience, speed)) == is_named


@pytest.mark.parametrize('missing', [0.03, 0.15])
def test_neither_friction_nor_a_load_is_named_before_the_drive_is_known(missing):
    words = rests_at(GOAL - [0.0, missing])
    assert words.startswith(
        f"'joint2' rests {1e3 * missing:.3g} mrad from its goal, expected at most 10 mrad")
    assert words.endswith(
        'the drive is not known (status drive): its effort, the model or friction holds it')
    assert 'stiffness' in words
    assert 'N·m/rad' in words


@pytest.mark.parametrize(('push', 'coulomb', 'cause'), [
    (2.5, 1.5, 'dry friction can hold it'),
    (2.5, 0.0, 'dry friction, which the model lacks, can hold it'),
    (20.0, 0.0, 'a load that the model does not contain')])
def test_the_cause_is_named_once_a_motion_has_confirmed_the_drive(push, coulomb, cause):
    arm = smooth_arm('default')
    known = arm.with_friction(make_friction(arm.joint_names, coulomb=[coulomb]))
    one = LockStep(known, true_arm=arm, q=START, friction_compensation='none')
    one.run(0.5)
    one.follow(GOAL + 0.5)
    one.run(1.0)
    assert one.loop.drives.verdicts()[1].verdict == 'agrees'
    one.push = lambda t: np.array([0.0, push])
    one.run(2.0)
    assert cause in shortfall(one.loop.controller, one.loop.drives)


def test_all_joints_that_do_not_arrive_are_named():
    words = rests_at(GOAL - [0.02, 0.1])
    assert words.startswith("'joint2' rests")
    assert '(joint1 too)' in words
