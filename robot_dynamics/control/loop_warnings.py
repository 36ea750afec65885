# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Warnings about settings with which the control loop can oscillate, with numbers."""

from collections.abc import Iterator

import numpy as np
from robot_dynamics.control.gain_softening import crossover_frequency
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.stable_gains import slowest_rate
from robot_dynamics.trajectories.motion_limits import WorkspaceInertia

LEAST_DAMPING = 0.3
"""Damping ratio below which the tracking error oscillates noticeably."""


def loop_warnings(workspace: WorkspaceInertia, options: ControllerOptions) -> Iterator[str]:
    """Yield one sentence for each setting of the loop that can make this arm oscillate."""
    names, gains = workspace.arm.joint_names, options.gains
    with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
        damping = np.where(gains.kp > 0.0, gains.kd / (2.0 * np.sqrt(gains.kp)), np.inf)
    for name, ratio in zip(names, damping.tolist()):
        if ratio >= LEAST_DAMPING:
            continue
        yield (f'The damping ratio of {name!r} is {ratio:.2g} (gains), expected at least '
               f'{LEAST_DAMPING:g}: its tracking error oscillates.')
    if not options.conditions_references:
        yield ('condition_references is false: a step of a reference causes a step of the effort, '
               'and references may exceed the limits of the arm.')
    omega = crossover_frequency(gains)
    if options.softens_gains or omega == 0.0:
        return
    yield (f'soften_gains is false: the loop can oscillate at joint state rates below '
           f'{slowest_rate(gains):.0f} Hz.')
    effort = workspace.largest() @ gains.kp
    rate = np.broadcast_to(options.effort_rate, effort.shape)
    with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
        error = np.where(effort > 0.0, rate / omega / effort, np.inf)
    j = int(np.argmin(error))
    if np.isfinite(error[j]):
        yield (f'soften_gains is false: {names[j]!r} can oscillate after an error above '
               f'{error[j]:.2g} rad or m, as its effort may change by {rate[j]:g} per second.')
