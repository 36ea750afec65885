# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Stiffness and bounds of a Cartesian impedance, and their defaults."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.error_feedback import DEFAULT_DAMPING_RATIO, per_joint
from robot_dynamics.control.laws.impedance import LEAST_DAMPING_RATIO
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.task_space.frame_kinematics import FrameKinematics, last_link
from robot_dynamics.validation import check_scalar, LARGEST_VALUE

TRANSLATION_STIFFNESS, ROTATION_STIFFNESS = 500.0, 30.0
"""Defaults [N/m] and [N·m/rad]."""
NULL_SPACE_FREQUENCY, LARGEST_NULL_SPACE_FREQUENCY = 10.0, 30.0
"""[rad/s]"""
FORCE_LIMIT, TORQUE_LIMIT = 100.0, 30.0
"""Defaults [N] and [N·m]."""
LARGEST_WRENCH = 1e4


class Cartesian(NamedTuple):
    """
    A Cartesian impedance at a frame of an arm.

    `stiffness` (6,) is that of translations along the axes of the base frame [N/m], then of
    rotations [N·m/rad]. `null_space_frequency` [rad/s] is the natural frequency of the posture;
    `force_limit` [N] and `torque_limit` [N·m] bound the spring.
    """

    arm: ArmModel
    frame: str
    stiffness: FloatArray
    damping_ratio: float
    null_space_frequency: float
    force_limit: float
    torque_limit: float

    def kinematics(self) -> FrameKinematics:
        """Return new forward kinematics of the frame, for one thread."""
        return FrameKinematics(self.arm, self.frame)


def make_cartesian(
    arm: ArmModel, frame: str = '', translation_stiffness: npt.ArrayLike = TRANSLATION_STIFFNESS,
    rotation_stiffness: float = ROTATION_STIFFNESS, damping_ratio: float = DEFAULT_DAMPING_RATIO,
    null_space_frequency: float = NULL_SPACE_FREQUENCY, force_limit: float = FORCE_LIMIT,
    torque_limit: float = TORQUE_LIMIT,
) -> Cartesian:
    """
    Return a Cartesian impedance; an empty `frame` is the last link that most joints move.

    The stiffness of translations is one number, or one per axis of the base frame. Raises
    InvalidInputError for an unknown frame, and for a value out of its range.
    """
    name = frame or last_link(arm)
    arm.link_frame(name, 'cartesian.frame')
    K = per_joint('cartesian.translation_stiffness', translation_stiffness, ('x', 'y', 'z'))
    k = check_scalar(
        'cartesian.rotation_stiffness', rotation_stiffness, 0.0, LARGEST_VALUE)
    return Cartesian(
        arm, name, np.array([*K, k, k, k]),
        check_scalar('cartesian.damping_ratio', damping_ratio, LEAST_DAMPING_RATIO, 1e4),
        check_scalar('cartesian.null_space_frequency', null_space_frequency, 0.0,
                     LARGEST_NULL_SPACE_FREQUENCY),
        check_scalar('cartesian.force_limit', force_limit, 0.0, LARGEST_WRENCH),
        check_scalar('cartesian.torque_limit', torque_limit, 0.0, LARGEST_WRENCH))
