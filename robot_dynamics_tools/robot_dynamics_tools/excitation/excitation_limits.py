# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The part of an arm's limits that an excitation motion may use, and the resulting amplitude.

Position, velocity and acceleration of a joint are linear in its amplitude, so that the largest
amplitude follows directly. Efforts are not linear in the amplitude; they are checked. The motion
begins at a pose well within the limits.
"""

from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.worst_gravity import search_box
from robot_dynamics.validation import check_scalar, check_vector

LARGEST_SWING = np.pi
"""Largest distance [rad] or [m] from the start, for joints without position limits."""
# Start positions of the joints within their ranges: from the middle, in units of half the range.
_START_PATTERN = (0.25, 1.0 / 6.0)
_START_SCALES = (1.0, 0.5, 0.25, 0.0, -0.25, -0.5, -1.0)


@dataclass(frozen=True, eq=False)
class ExcitationLimits:
    """
    The limits of a motion from `start`, each (n,), infinite for no limit.

    `below` and `above` are the largest distances of the positions from the start [rad or m], > 0.
    """

    start: FloatArray
    below: FloatArray
    above: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    effort: FloatArray

    def largest_scale(self, x: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the largest factors (n,) of a motion x = q − start; x, v and a are (m, n)."""
        n = len(self.start)
        scale = np.full(n, np.inf)
        for used, limit in (
                (x.max(axis=0), self.above), (-x.min(axis=0), self.below),
                (np.abs(v).max(axis=0), self.velocity),
                (np.abs(a).max(axis=0), self.acceleration)):
            moves = used > 0.0
            scale[moves] = np.minimum(scale, limit / np.where(moves, used, 1.0))[moves]
        return np.where(np.isfinite(scale), scale, 0.0)


def motion_limits(
    dynamics: ArmDynamics, start: FloatArray | None = None, position_margin: float = 0.05,
    velocity_scale: float = 0.6, effort_scale: float = 0.8, acceleration: float = 6.0,
) -> ExcitationLimits:
    """
    Return the limits of a motion from `start` (n,), or from a default pose without `start`.

    `position_margin` is the fraction of a joint's range that is kept free at each end, both scales
    are the used fractions of those limits. `acceleration` [rad/s²] or [m/s²] is the limit itself,
    because a URDF has no acceleration limit.
    Raises InvalidInputError for a fraction outside (0, 1], for a start at which a joint cannot
    move within its limits, and if the gravity torque at the start exceeds the allowed effort.
    """
    arm = dynamics.arm
    margin = check_scalar('position_margin', position_margin, 0.0, 0.49)
    velocity = check_scalar('velocity_scale', velocity_scale, 0.0, 1.0, exclusive_minimum=True)
    effort = check_scalar('effort_scale', effort_scale, 0.0, 1.0, exclusive_minimum=True)
    check_scalar('acceleration', acceleration, 0.0, exclusive_minimum=True)
    limits, n = arm.limits, arm.joint_count
    q0 = start_pose(dynamics) if start is None else check_vector(
        'start', start, n, arm.joint_names)
    below, above = room(arm, q0, margin)
    for name, q, down, up in zip(arm.joint_names, q0, below, above):
        if not (down > 0.0 and up > 0.0):
            raise InvalidInputError(
                f'start of {name!r} is {q:g}, expected a position between {q - down:g} and '
                f'{q + up:g}, where it can move, or a list of joints without this joint')
    allowed = effort * limits.effort
    holding = np.abs(dynamics.gravity(q0))
    if (holding >= allowed).any():
        j = int(np.argmax(holding / allowed))
        raise InvalidInputError(
            f'joint {arm.joint_names[j]!r} needs {holding[j]:.4g} to hold the arm at the start, '
            f'expected less than the allowed effort of {allowed[j]:.4g}: another start, or a '
            'larger effort_scale')
    return ExcitationLimits(
        q0, np.minimum(below, LARGEST_SWING), np.minimum(above, LARGEST_SWING),
        velocity * limits.velocity, np.full(n, acceleration), allowed)


def room(arm: ArmModel, q: FloatArray, margin: float) -> tuple[FloatArray, FloatArray]:
    """Return the distances (n,) from q down and up to the limits, less `margin` of the range."""
    span = arm.limits.upper - arm.limits.lower
    kept = margin * np.where(np.isfinite(span), span, 0.0)
    return q - arm.limits.lower - kept, arm.limits.upper - kept - q


def start_pose(dynamics: ArmDynamics) -> FloatArray:
    """
    Return a pose (n,) well within the limits whose gravity torque is noticeable but feasible.

    Of a few poses about the middle of all ranges, the first one is chosen whose gravity takes at
    most half of every effort limit; if there is no such pose, the pose with the smallest ratio.
    """
    arm = dynamics.arm
    low, high = search_box(arm)
    pattern = np.resize(_START_PATTERN, arm.joint_count)
    poses = [0.5 * (low + high + scale * pattern * (high - low)) for scale in _START_SCALES]
    ratios = [effort_ratio(dynamics.gravity(q), arm.limits.effort) for q in poses]
    return next((q for q, ratio in zip(poses, ratios) if ratio <= 0.5),
                poses[int(np.argmin(ratios))])


def effort_ratio(efforts: FloatArray, limit: FloatArray) -> float:
    """Return the largest ratio of efforts (…, n) to their limits (n,)."""
    return float(np.max(np.abs(efforts) / limit, initial=0.0))
