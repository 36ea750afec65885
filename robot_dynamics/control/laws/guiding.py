# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Options of hand guiding, and their defaults."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.error_feedback import per_joint
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.validation import is_empty, LARGEST_VALUE

DEFAULT_SHARE, LARGEST_SHARE = 0.6, 0.7
"""Of the friction that hand guiding compensates; below 1 of friction given 1.4 times too large."""
USUAL_SPEED, SPEED_SHARE = {'prismatic': 0.25}, 0.5
"""Default speed limit: [m/s] of prismatic joints, and the largest share of the velocity limit."""
USUAL_TURN = 1.0
"""The same for other joints [rad/s]."""
DEFAULT_FEEDBACK_GAIN, LARGEST_FEEDBACK_GAIN, FEEDBACK_SHARE = 0.3, 0.5, 0.25
"""Of `~/force_feedback`: gains, and the largest effort as a share of the effort limit."""
UNLIMITED_FEEDBACK = 1.0
"""Largest effort [N·m] or [N] of `~/force_feedback` at a joint without an effort limit."""
ROTOR = 200.0
"""Effort limit by the usual rotor [rad/s²] or [m/s²]: 145 at a Panda, 330 at a UR10."""


class Guiding(NamedTuple):
    """
    Options of hand guiding, (n,) each.

    `friction_share` is the compensated share of friction; `speed` [rad/s] or [m/s] the speed above
    which a joint is braked; `lower` and `upper` [rad] or [m] are the position limits;
    `feedback_limit` [N·m] or [N] is the largest effort of a force feedback, after its gain;
    `rotors` [kg·m²] or [kg] are the usual ones of joints whose rotors the model lacks.
    """

    friction_share: FloatArray
    speed: FloatArray
    lower: FloatArray
    upper: FloatArray
    feedback_gain: FloatArray
    feedback_limit: FloatArray
    rotors: FloatArray


def make_guiding(
    arm: ArmModel, friction_share: npt.ArrayLike = DEFAULT_SHARE, speed: npt.ArrayLike = (),
    feedback_gain: npt.ArrayLike = DEFAULT_FEEDBACK_GAIN,
) -> Guiding:
    """
    Return options; each argument is one number for all joints, or one value per joint.

    An empty `speed` is half of the velocity limit, and at most 1 rad/s or 0.25 m/s. Raises
    InvalidInputError for another number of values, a negative one, a share above LARGEST_SHARE, or
    a gain above LARGEST_FEEDBACK_GAIN.
    """
    names, limits = arm.joint_names, arm.limits
    usual = np.array([USUAL_SPEED.get(kind, USUAL_TURN) for kind in arm.joint_kinds])
    share, gain = (
        _at_most(f'hand_guiding.{field}', value, most, arm) for field, value, most in (
            ('friction_share', friction_share, LARGEST_SHARE),
            ('feedback_gain', feedback_gain, LARGEST_FEEDBACK_GAIN)))
    most = np.minimum(SPEED_SHARE * limits.velocity, usual) if is_empty(speed) else per_joint(
        'hand_guiding.speed', speed, names)
    lower, upper = np.clip((limits.lower, limits.upper), -LARGEST_VALUE, LARGEST_VALUE)
    is_limited = np.isfinite(limits.effort)
    return Guiding(
        share, most, lower, upper, gain,
        np.where(is_limited, FEEDBACK_SHARE * limits.effort, UNLIMITED_FEEDBACK),
        np.where(is_limited & (arm.reflected_inertia == 0.0), limits.effort / ROTOR, 0.0))


def _at_most(field: str, value: npt.ArrayLike, most: float, arm: ArmModel) -> FloatArray:
    values = per_joint(field, value, arm.joint_names)
    for name, one in zip(arm.joint_names, values):
        if one > most:
            raise InvalidInputError(f'{field} of {name!r} is {one:g}, expected at most {most:g}')
    return values
