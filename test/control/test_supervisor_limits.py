# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Faults of the supervisor: positions and velocities beyond their limits."""

import numpy as np
import pytest
from robot_dynamics.control.safety.ending import Ending
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import Mode
from supervised import answer, HOLD, make, PERIOD, PUSH, running, START


def test_overspeed_is_a_fault_that_ends_with_it():
    one = make(velocity=2.0)
    one.activate()
    assert answer(one, START, v=(0.0, 2.3)) is not None
    assert one.mode is Mode.RUNNING
    answer(one, START + PERIOD, v=(0.0, -2.5))
    assert one.mode is Mode.FAULT
    assert one.fault.name == 'overspeed'
    assert "velocity of 'elbow' is -2.5, 1.25 times its limit" in one.fault.message
    answer(one, START + 2 * PERIOD, v=(0.0, -2.0))
    assert one.mode is Mode.RUNNING


def test_a_joint_past_its_limit_is_a_fault_until_it_is_back_for_five_states():
    one = running(reach=1.0)
    answer(one, START + 0.01, q=(1.0087, -1.0087))
    assert one.mode is Mode.RUNNING
    answer(one, START + 0.02, q=(0.0, -1.00871))
    assert one.mode is Mode.FAULT
    assert one.fault.name == 'position_limit'
    assert "'elbow' is -1.00871, 0.00871 past its limit" in one.fault.message
    for k in range(4):
        answer(one, START + 0.03 + k * PERIOD)
    answer(one, START + 0.05, q=(1.1, 0.0))
    for k in range(4):
        answer(one, START + 0.06 + k * PERIOD)
        assert one.mode is Mode.FAULT
    answer(one, START + 0.07)
    assert one.mode is Mode.RUNNING
    assert one.fault_count == 1


@pytest.mark.parametrize(('name', 'states', 'slowness', 'is_released'), [
    ('following_error', 30, 1, True), ('following_error', 10, 1, False),
    ('following_error', 10, 25, False), ('frozen_joint', 30, 1, False)])
def test_a_joint_that_becomes_faster_against_its_damping_is_released(
    name, states, slowness, is_released,
):
    """
    After 24 ms of the states, also of a slow simulation.

    But not while a joint without a signal may drive it: then its damping is all that brakes.
    """
    one = running(HOLD, velocity=1.0, state_timeout=60.0)
    one.end(START, Ending.by(Fault(name, 'words', recovery=999)))
    for k in range(1, states + 1):
        v = np.array([1.1 + 0.01 * k, 0.0])
        effort = one.answer(
            START + slowness * k * PERIOD, np.zeros(2), v, PUSH, HOLD.copy, PERIOD,
            lambda *_, v=v: HOLD - 5.0 * v)
    assert (one.fault.name == 'wrong_drive') == is_released
    assert (effort[0] == 0.0) == is_released


def test_the_time_in_which_a_lost_arm_must_come_to_rest_is_that_of_the_states():
    """Of a simulation that is slower than the clock, 25 times here."""
    one, v = running(HOLD, velocity=1.0, state_timeout=60.0), np.array([0.11, 0.0])
    one.end(START, Ending.by(Fault('frozen_joint', 'words', recovery=999)))
    for k in range(1, 256):
        answer(one, START + 0.05 * k, PUSH, v=v, dt=PERIOD)
        assert k > 249 or not one.is_held_in_vain(v)
    assert one.is_held_in_vain(v)
    assert not one.is_held_in_vain(np.array([0.09, -0.09]))
