# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Positions and velocities beyond their limits: their faults, the way back, reversed drives."""

from dataclasses import replace

from lock_step_loop import LockStep, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.safety.ending import Ending
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar import default_arm_urdf
from supervised import answer, HOLD, make, PERIOD, PUSH, running, START

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


@pytest.mark.parametrize(('command', 'rate'), [
    ('computed_torque', 500), ('joint_impedance', 125), ('cartesian_impedance', 125)])
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


@pytest.mark.parametrize(('command', 'rate'), [
    ('computed_torque', 125), ('joint_impedance', 500), ('cartesian_impedance', 500),
    ('hand_guiding', 125)])
def test_a_joint_with_a_reversed_drive_is_released(command, rate):
    one = Reversed(smooth_arm('ur5'), q=np.array([0.0, -1.2, 1.2, -1.0, -1.2, 0.2]), rate=rate,
                   command=command, v=np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5]))
    trace = one.run(2.0)
    assert np.abs(trace.v[:, -1]).max() <= 3.0 * 3.2
    assert one.loop.supervisor.fault.name == 'wrong_drive'
    assert "'wrist_3_joint'" in one.loop.supervisor.fault.message
    assert np.nanmax(np.abs(trace.effort[trace.t > 1.5][:, -1])) == 0.0


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
