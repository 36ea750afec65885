# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A joint that is pushed beyond its position limit, and one whose drive has the wrong sign."""

from dataclasses import replace

from lock_step_loop import LockStep, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar import default_arm_urdf

Q = np.array([0.8, 0.5])


def arm_with_limit(upper):
    arm = load_arm(default_arm_urdf())
    return replace(arm, limits=replace(
        arm.limits, lower=np.array([-9.0, -9.0]), upper=np.array([9.0, upper])))


def pushed(upper, command, rate, push=8.0):
    one = LockStep(arm_with_limit(upper), q=Q, rate=rate, command=command)
    one.push = lambda t: np.array([0.0, push * (1.0 < t < 1.6)])
    trace = one.run(4.0)
    return trace.q[:, 1] - Q[1], trace, one.loop


@pytest.mark.parametrize('command', ['computed_torque', 'joint_impedance', 'cartesian_impedance'])
@pytest.mark.parametrize('rate', [125, 500])
def test_a_limit_makes_the_arm_no_softer(command, rate):
    limited, trace, loop = pushed(0.515, command, rate)
    free, _, _ = pushed(9.0, command, rate)
    assert free.max() >= 0.02
    assert limited.max() <= 2.0 * free.max()
    assert Mode.FAULT in trace.mode
    assert trace.mode[-1] is Mode.RUNNING
    assert abs(limited[-1]) <= 0.005
    assert loop.supervisor.fault.name == 'position_limit'


@pytest.mark.parametrize('command', ['gravity_compensation', 'hand_guiding'])
def test_without_a_reference_the_joint_returns_slowly_to_its_limit(command):
    moved, trace, _ = pushed(0.515, command, 500)
    free, _, _ = pushed(9.0, command, 500)
    assert 0.02 <= moved.max() <= 0.5 * free.max()
    back = np.flatnonzero(moved <= 0.0237)[-1]
    assert trace.mode[back] is Mode.RUNNING
    assert abs(trace.v[back, 1]) <= 0.5


def test_an_arm_that_starts_beyond_a_limit_is_moved_back_by_hand_and_held_there():
    one = LockStep(arm_with_limit(0.4), q=Q)
    assert np.isnan(one.run(0.2).effort).all()
    one.q = np.array([0.8, 0.2])
    trace = one.run(1.0)
    assert not np.isnan(trace.effort[-2:]).all()
    assert np.abs(trace.q[-1] - [0.8, 0.2]).max() <= 0.01


class Reversed(LockStep):
    """The effort of the last joint acts with the opposite sign."""

    def _move(self, tau):
        super()._move(np.append(tau[:-1], -tau[-1]))


@pytest.mark.parametrize('command', [
    'computed_torque', 'joint_impedance', 'cartesian_impedance', 'hand_guiding'])
@pytest.mark.parametrize('rate', [125, 500])
def test_a_joint_with_a_reversed_drive_is_released(command, rate):
    one = Reversed(smooth_arm('ur5'), q=np.array([0.0, -1.2, 1.2, -1.0, -1.2, 0.2]), rate=rate,
                   command=command, v=np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5]))
    trace = one.run(2.0)
    assert np.abs(trace.v[:, -1]).max() <= 3.0 * 3.2
    assert one.loop.supervisor.fault.name == 'wrong_drive'
    assert "'wrist_3_joint'" in one.loop.supervisor.fault.message
    assert np.nanmax(np.abs(trace.effort[trace.t > 1.5][:, -1])) == 0.0
