# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The damping of an arm in a fault, with late states of light wrists."""

from lock_step_loop import LockStep, smooth_arm
import numpy as np
import pytest
from robot_dynamics.control.safety.ending import Ending
from robot_dynamics.control.safety.faults import Fault

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
