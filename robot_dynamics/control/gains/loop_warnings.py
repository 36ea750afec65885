# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Warnings about settings with which the control loop can oscillate, with numbers."""

from collections.abc import Iterator

import numpy as np
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.gains.gain_scaling import slowest_rate
from robot_dynamics.control.laws.error_feedback import LEAST_RATIO


def loop_warnings(controller: Controller) -> Iterator[str]:
    """Yield one sentence for each setting of the loop that can make this arm oscillate."""
    options, gains = controller.options, controller.options.gains
    with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
        damping = np.where(gains.kp > 0.0, gains.kd / (2.0 * np.sqrt(gains.kp)), np.inf)
    for name, ratio in zip(controller.arm.joint_names, damping.tolist()):
        if ratio >= LEAST_RATIO:
            continue
        yield (f'The damping ratio of {name!r} is {ratio:.2g} (gains), expected at least '
               f'{LEAST_RATIO:g}: its tracking error oscillates.')
    if not options.conditions_references:
        yield ('condition_references is false: a step of a reference causes a step of the effort, '
               'and references may exceed the limits of the arm.')
    rate = slowest_rate(controller.laws.loop_gains)
    if not options.scales_gains and rate > 0.0:
        yield (f'scale_gains is false: the loop can oscillate at joint state rates below '
               f'{rate:.0f} Hz.')
