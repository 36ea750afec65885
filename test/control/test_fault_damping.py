# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The damping of an arm in a fault, with late states of light wrists."""

from lock_step_loop import LockStep, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.safety.ending import Ending
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.undamped_joints import UndampedJoints
from simulated_arms import default_dynamics

Q = [-1.308, 4.685, 2.899, 1.793, 3.163, -0.263]
V = [-0.09, 0.16, 0.164, 0.164, 0.218, -0.218]
"""State of the Kinova with aligned wrist axes: 2 N·m/rad of gravity on 2e-4 kg·m²."""


@pytest.mark.parametrize(('command', 'rate', 'delay'), [
    ('computed_torque', 30, 0), ('computed_torque', 100, 8), ('cartesian_impedance', 30, 8)])
def test_late_gravity_does_not_drive_a_light_wrist(command, rate, delay):
    """With g at the measured position a wrist reached 14 times its velocity limit at 30 Hz."""
    arm = smooth_arm('kinova')
    one = LockStep(arm, q=np.array(Q), rate=rate, delay=delay, command=command)
    one.run(1.0)
    one.v = np.array(V)
    one.loop.end(one.now, Ending.by(Fault('test', '', latched=True)))
    trace = one.run(0.6)
    assert (np.abs(trace.v) <= 1.2 * arm.limits.velocity).all()


@pytest.mark.parametrize(('limit', 'faster', 'effort', 'is_released'), [
    (2.9, 0.06, -1.0, True), (2.9, 0.04, -1.0, False), (2.9, 0.06, 1.0, False),
    (3.1, 0.06, -1.0, False)])
def test_a_joint_is_released_that_becomes_faster_by_0_05_rad_s_in_24_ms_against_its_effort(
        limit, faster, effort, is_released):
    """A joint above its velocity limit; its speed is 3 rad/s."""
    one = UndampedJoints(1)
    found = [one.take(0.004 * k, np.array([3.0 + faster * k / 6.0]), np.array([effort]),
                      np.array([limit])) for k in range(7)]
    assert found[:6] == 6 * [-1]
    assert (found[6] == 0) == is_released


def test_a_joint_released_while_faults_of_the_motion_recur_is_named():
    """The joint had no effort any more, and the message said that the arm is damped."""
    loop, t, q = ControlLoop.of_arm(default_dynamics().arm), 0.0, 0.0
    messages = []
    for fastest in 4 * [12.2] + [18.0]:  # the limit is 10 rad/s
        for v in np.r_[np.zeros(100), np.arange(0.0, fastest, 0.3), np.arange(fastest, 0.0, -0.3)]:
            t, q = t + 0.005, q + 0.005 * v
            loop.answer(round(1e9 * t), np.array([q, 0.0]) + 1e-9 * t, np.array([v, 0.0]))
            fault = loop.supervisor.fault
            messages.append('' if fault is None else f'{fault.name}: {fault.message}')
    assert any('again while the arm is only held: it is damped' in words for words in messages)
    assert messages[-1].startswith("wrong_drive: 'joint1' becomes faster")
