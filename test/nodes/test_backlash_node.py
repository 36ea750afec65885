# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Backlash in the running `simulated_arm`, answered with a constant effort."""

from closed_loop import NAMES
from lock_stepped_arm import lock_stepped, LockStepped
import numpy as np
import pytest
from ros_harness import has_stamp

GAP = 0.02
GEARED = {
    'actuator.torque_constant': [0.1], 'actuator.gear_ratio': [100.0],
    'actuator.rotor_inertia': [1e-5], 'actuator.backlash': [GAP], 'joints': NAMES,
    'initial_position': [1.0, 0.5]}


def motor_offsets(arm: LockStepped, steps: int = 60) -> np.ndarray:
    """Return the offsets (steps, 2) of the motors from the measured joints during the motion."""
    arm.motors.wait_matched()
    found = []
    for _ in range(steps):
        motor = arm.motors.wait_for(has_stamp(arm.state.header.stamp))
        assert list(motor.name) == NAMES
        found.append(np.subtract(motor.position, arm.state.position))
        arm.step([20.0, 5.0])
    return np.array(found)


def test_joint_and_motor_are_apart_by_the_gap(client):
    """The links rest on their gears; under an opposite torque the motors cross the gap."""
    with lock_stepped(client, '/at_joint', **GEARED) as arm:
        offsets = motor_offsets(arm)
    # The arm falls forward, g(q) < 0, so that at first the motors are behind the joints.
    assert offsets[0] == pytest.approx([-0.5 * GAP] * 2, abs=1e-10)
    assert offsets[-1] == pytest.approx([0.5 * GAP] * 2, abs=1e-10)
    assert np.abs(offsets).max() <= 0.5 * GAP + 1e-10
    assert np.abs(offsets[:, 0]).min() < 0.4 * GAP  # observed while the motor crosses the gap


def test_encoders_at_the_motor_do_not_see_the_gap(client):
    with lock_stepped(client, '/at_motor', **GEARED, encoders='motor') as arm:
        assert np.abs(motor_offsets(arm)).max() == 0.0
