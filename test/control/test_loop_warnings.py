# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Warnings about gains and options with which a loop can oscillate."""

from robot_dynamics.control.controller import Controller
from robot_dynamics.control.gains.gain_scaling import slowest_rate
from robot_dynamics.control.gains.loop_warnings import loop_warnings
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar.urdf import default_arm_urdf

ARM = load_arm(default_arm_urdf())
GAINS = make_gains(ARM.joint_names)
RATE = ARM.limits.effort / 0.1

def warnings_of(**options: object) -> list[str]:
    return list(loop_warnings(
        Controller(ARM, ControllerOptions(**options))))  # type: ignore[arg-type]


def test_the_default_parameters_are_no_reason_to_warn():
    assert not warnings_of(
        gains=GAINS, scales_gains=True, conditions_references=True, effort_rate=RATE)


def test_settings_that_can_oscillate_are_named_with_numbers():
    weak = make_gains(ARM.joint_names, damping_ratio=[1.0, 0.1])
    safe = {'scales_gains': True, 'conditions_references': True, 'effort_rate': RATE}
    damping, = warnings_of(gains=weak, **safe)
    assert damping.startswith("The damping ratio of 'joint2' is 0.1")
    unconditioned, = warnings_of(gains=GAINS, **{**safe, 'conditions_references': False})
    assert unconditioned.startswith('condition_references is false')
    slow, = warnings_of(gains=GAINS, **{**safe, 'scales_gains': False})
    one = Controller(ARM, ControllerOptions(GAINS))
    assert f'below {slowest_rate(one.laws.loop_gains):.0f} Hz' in slow

