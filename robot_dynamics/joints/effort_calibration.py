# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The effort of a drive: scale and offset between the driver's effort and the torque at the joint.

A driver computes torques from currents with its own torque constants, and its sensors have an
offset. Its effort e, on the joint side of the gearbox, therefore differs from the torque τ at the
joint:

    τ = s (e − o)

Wrong torque constants give s ≠ 1, an opposite sign gives s < 0; o is the driver's effort at zero
torque. The command and the report have their own s and o (`effort.command_scale`,
`effort.report_scale`): a driver may convert only one of them. Efforts that the robot adds on its
own (`effort_convention`) pass the drive with the command: e is their sum.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.parameter_field import per_joint_values

LEAST_SCALE, LARGEST_SCALE = 0.2, 5.0
"""Range of the magnitude of s: another value is an error of unit, not of a torque constant."""
LARGEST_OFFSET = 0.2
"""Largest offset as a fraction of the effort limit."""


@dataclass(frozen=True, eq=False)
class EffortCalibration:
    """
    The command or the report of the drives of n joints; checked by `make_effort_calibration`.

    `scale` s (n,) is the torque at the joint per unit of the driver's effort, `offset` o (n,)
    [N·m] or [N] the driver's effort at zero torque. `limit` L (n,) [N·m] or [N] is the effort
    limit of the URDF, which applies to the driver's effort; infinite for no limit. `covariance`
    (2n, 2n) is that of s, then o; None if both are exact.
    """

    scale: FloatArray
    offset: FloatArray
    limit: FloatArray
    covariance: FloatArray | None = None

    def torque(self, effort: FloatArray) -> FloatArray:
        """Return the torque at the joints (..., n) for the driver's effort."""
        return np.asarray(self.scale * (effort - self.offset))

    def effort(self, torque: FloatArray) -> FloatArray:
        """Return the driver's effort (..., n) for the torque at the joints."""
        return np.asarray(torque / self.scale + self.offset)

    def command(self, torque: FloatArray) -> FloatArray:
        """Return the driver's effort (..., n) for a torque, never beyond the effort limit."""
        return np.minimum(np.maximum(self.effort(torque), -self.limit), self.limit)

    def torque_error_covariance(self) -> FloatArray:
        """
        Return the covariance (2n, 2n) of the errors of `torque`.

        The torque of a joint is τ + ε τ + δ, with the relative error ε of the scale and the error
        δ of the offset as a torque. The order is ε of all joints, then δ.
        """
        if self.covariance is None:
            return np.zeros((2 * len(self.scale), 2 * len(self.scale)))
        slope = np.concatenate([1.0 / self.scale, -self.scale])
        return np.asarray(self.covariance * np.outer(slope, slope))

    def torque_limit(self, fraction: float = 1.0) -> FloatArray:
        """
        Return the largest torque (n,) in both directions within a fraction of the effort limit.

        This is min(L, |s| (L − |o|)) with the effort limit L × fraction, at least 0.
        """
        limit = self.limit.copy()
        limit[np.isfinite(limit)] *= fraction
        return np.maximum(
            np.minimum(limit, np.abs(self.scale) * (limit - np.abs(self.offset))), 0.0)


def drive_quantities(joint_names: Sequence[str]) -> list[str]:
    """Return the names of the quantities of a covariance, in its order."""
    return [f'{name}({joint})' for name in ('scale', 'offset') for joint in joint_names]


def make_effort_calibration(
    joint_names: Sequence[str], scale: npt.ArrayLike = (), offset: npt.ArrayLike = (),
    limit: npt.ArrayLike = np.inf, covariance: FloatArray | None = None,
    direction: str = 'command',
) -> EffortCalibration | None:
    """
    Return checked drives, None if s is exactly 1 and o exactly 0 at every joint.

    `direction` is `command` or `report`, for the names in messages.

    `scale` and `offset` are empty (1 and 0), one number for all joints, or one value per joint;
    `limit` is one effort limit [N·m] or [N] or one per joint, may be infinite, and is not checked.
    `covariance` (2n, 2n) is already checked (`validation.covariance_root`). Raises
    InvalidInputError for another number of values, for a scale whose magnitude is outside
    LEAST_SCALE to LARGEST_SCALE, and for an offset beyond LARGEST_OFFSET of the effort limit.
    """
    n = len(joint_names)
    of_scale, of_offset = f'effort.{direction}_scale', f'effort.{direction}_offset'
    s = per_joint_values(of_scale, scale, joint_names, np.ones(n))
    o = per_joint_values(of_offset, offset, joint_names, np.zeros(n))
    limits = np.full(n, limit, dtype=np.float64)
    for name, factor, zero, most in zip(joint_names, s.tolist(), o.tolist(), limits.tolist()):
        if not LEAST_SCALE <= abs(factor) <= LARGEST_SCALE:
            raise InvalidInputError(
                f'{of_scale} of {name!r} is {factor:g}, expected a magnitude in '
                f'[{LEAST_SCALE:g}, {LARGEST_SCALE:g}]')
        bound = LARGEST_OFFSET * most
        if abs(zero) > bound:
            raise InvalidInputError(
                f'{of_offset} of {name!r} is {zero:g}, expected a number in '
                f'[{-bound:g}, {bound:g}], {100.0 * LARGEST_OFFSET:g} % of the effort limit '
                f'{most:g}')
    if covariance is None and (s == 1.0).all() and not o.any():
        return None
    return EffortCalibration(s, o, limits, covariance)
