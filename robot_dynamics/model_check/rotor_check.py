# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Rotors that the model lacks: effort limits that would accelerate a joint faster than a drive does.

A drive accelerates its own rotor by at most its peak torque divided by its reflected inertia J.
The effort limit of a joint is about this torque: if it divided by M_jj is far above the
acceleration of any drive, M_jj lacks the rotor, and J is at least M_jj times the ratio of both.

Strain-wave drives reach 17 to 730 rad/s² (Harmonic Drive, manuals of the FHA-C and FHA-C mini
series, maximum torque and inertia on the output side of 21 actuators; 1.8 N·m and 0.0026 kg·m² for
the fastest). Beyond `LARGEST_ACCELERATION` the rotor of such a drive is at least 3.4 times M_jj.
Planetary drives of walking robots reach 8,600 rad/s² (88 N·m, 0.0102 kg·m², gear ratio 14.3): the
finding is then true of a rotor of at least 0.3 M_jj.
"""

from collections.abc import Iterator

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model_check.finding import Finding, WARNING
from robot_dynamics.model_check.mass_matrix_check import SMALLEST_INERTIA

LARGEST_ACCELERATION = 2_500.0
"""Effort limit / smallest M_jj [rad/s²] above which M_jj lacks the rotor of the drive."""


def check_rotors(arm: ArmModel, least: FloatArray) -> Iterator[Finding]:
    """
    Yield the joints whose effort limit is too large for their inertia.

    `least` (n,) [kg·m²] is the smallest M_jj over the positions within the limits, with rotors as
    far as they are known. Joints without an effort limit or inertia are skipped, and prismatic
    joints: the inertia of a rotor behind a spindle varies too much with its lead for a bound.
    """
    known = arm.reflected_inertia
    for j, (name, limit) in enumerate(zip(arm.joint_names, arm.limits.effort)):
        if arm.joint_kinds[j] == 'prismatic' or not np.isfinite(limit) or (
                not least[j] > max(SMALLEST_INERTIA, limit / np.finfo(float).max)):
            continue
        acceleration = limit / least[j]
        if acceleration > LARGEST_ACCELERATION:
            advice = (
                'check actuator.reflected_inertia (data sheet, or ros2 dynamics identify) and the '
                'effort limit') if known[j] else (
                'set the reflected inertia of the rotor with actuator.reflected_inertia (data '
                'sheet, or ros2 dynamics identify)')
            yield Finding(
                'rotors', WARNING, name,
                f'effort limit of joint {name!r}, {limit:.4g} N·m, divided by its smallest '
                f'inertia M_jj, {least[j]:.3g} kg·m², is {acceleration:.3g} rad/s², expected at '
                f'most {LARGEST_ACCELERATION:g}: no drive with a gearbox accelerates so; {advice}')
