# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A demonstration motion for any arm: smooth, within all limits, and different for every joint.

The arm leaves a start pose, swings every joint about this pose, each with its own pattern, and
returns to rest at the start. The amplitudes follow from the limits of position, velocity and
effort, and from the duration. Collisions are not checked.
"""

from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from robot_dynamics.trajectories.quintics import quintic_via_points
from robot_dynamics.validation import check_scalar, check_vector
from robot_dynamics_tools.excitation.excitation_limits import (
    effort_ratio,
    ExcitationLimits,
    room,
    start_pose,
)

LIMIT_FRACTION = 0.6
"""Used fraction of the velocity limits, and of the effort limits if gravity takes less."""
POSITION_MARGIN = 0.05
"""Fraction of a joint's range that is kept free at each end."""
LARGEST_SWING = 0.8
"""Largest amplitude [rad] about the start pose, for joints with a large range."""
LARGEST_PRISMATIC_SWING = 0.3
"""[m] likewise."""
LARGEST_ACCELERATION = 6.0
"""Largest acceleration [rad/s²] or [m/s²]."""
SHORTEST_DURATION = 0.5
"""[s]"""
PEAK_VELOCITY = 1.875
"""Largest velocity of a quintic from rest to rest over 1 in 1 s."""
PEAK_ACCELERATION = 10.0 / 3.0**0.5
"""Largest acceleration of a quintic from rest to rest over 1 in 1 s."""

_SECONDS_PER_SWING = 1.6
_SAMPLES = 400
_SMALLEST_SCALE = 1e-3
# Via-points of the swing; each joint begins at a different entry.
_SWINGS = np.array((1.0, -0.9, 0.3, -0.6, 0.8, -0.3))


@dataclass(frozen=True, eq=False)
class ReferenceMotion:
    """
    A motion that starts and ends at rest at `start` (n,), and its efforts.

    `effort_ratio` is the largest ratio of an effort to its limit, at `worst_joint`.
    """

    start: FloatArray
    trajectory: JointTrajectory
    effort_ratio: float
    worst_joint: str


def make_reference_motion(
    arm: ArmModel, duration: float, start: FloatArray | None = None,
) -> ReferenceMotion:
    """
    Return a motion of `duration` [s] for this arm, from `start` (n,), or from `start_pose`.

    Positions keep a distance of POSITION_MARGIN from their limits. Velocities and efforts stay
    below LIMIT_FRACTION of their limits. If gravity at the start pose already takes a larger
    fraction of an effort limit, the efforts stay below the mean of that fraction and 1. Raises
    InvalidInputError for a duration below SHORTEST_DURATION, a start outside the limits, or an arm
    that cannot compensate its own gravity.
    """
    T = check_scalar('duration', duration, SHORTEST_DURATION)
    dynamics = ArmDynamics(arm)
    q0 = start_pose(dynamics) if start is None else _checked_start(arm, start)
    holding = dynamics.gravity(q0)
    gravity = effort_ratio(holding, arm.limits.effort)
    if gravity >= 1.0:
        worst = int(np.argmax(np.abs(holding) / arm.limits.effort))
        raise InvalidInputError(
            f'arm {arm.name!r} cannot compensate its own gravity: joint '
            f'{arm.joint_names[worst]!r} needs {gravity:.2f} times its effort limit of '
            f'{arm.limits.effort[worst]:g} at the start pose, expected less than 1')
    allowed = max(LIMIT_FRACTION, 0.5 * (gravity + 1.0) if gravity > LIMIT_FRACTION else 0.0)
    pattern = _pattern(arm.joint_count, T)
    swing, scale = _swing_within_limits(arm, q0, pattern, T), 1.0
    while True:
        motion = motion_along(arm, _trajectory(arm, q0, pattern, scale * swing, T))
        if motion.effort_ratio <= allowed or scale < _SMALLEST_SCALE:
            return motion
        scale *= 0.85


def rest_to_rest_seconds(
    distance: FloatArray, velocity: FloatArray,
    acceleration: FloatArray | float = LARGEST_ACCELERATION,
) -> float:
    """
    Return the duration [s] of a quintic from rest to rest over `distance` (n,) [rad] or [m].

    No joint exceeds its `velocity` (n,) [rad/s] or [m/s], or `acceleration` [rad/s²] or [m/s²];
    the duration is at least SHORTEST_DURATION.
    """
    d = np.abs(distance)
    return float(max(
        SHORTEST_DURATION, np.max(PEAK_VELOCITY * d / velocity, initial=0.0),
        np.sqrt(np.max(PEAK_ACCELERATION * d / acceleration, initial=0.0))))


def motion_along(arm: ArmModel, trajectory: JointTrajectory) -> ReferenceMotion:
    """
    Return a given trajectory together with its efforts on this arm.

    Raises InvalidInputError if it has only one point, or starts outside the limits.
    """
    if trajectory.is_set_point:
        raise InvalidInputError('the trajectory has 1 point, expected at least 2')
    q0 = _checked_start(arm, trajectory.points[0].position)
    dynamics = ArmDynamics(arm)
    q, v, a = _sample(trajectory)
    peaks = np.abs(dynamics.inverse_dynamics_batch(q, v, a)).max(axis=0)
    worst = int(np.argmax(peaks / arm.limits.effort))
    return ReferenceMotion(
        q0, trajectory, effort_ratio(peaks, arm.limits.effort), arm.joint_names[worst])


def sample_trajectory(trajectory: JointTrajectory, times: FloatArray) -> Reference:
    """Return position, velocity and acceleration, each (samples, n), at `times` [s] from 0."""
    first = trajectory.points[0].position
    active = ActiveTrajectory(trajectory, 0, 0, Reference(first, *np.zeros((2, len(first)))))
    samples = [active.sample(round(1e9 * t)) for t in times.tolist()]
    return Reference(*(np.array(rows) for rows in zip(*samples)))


def _checked_start(arm: ArmModel, start: FloatArray) -> FloatArray:
    q0 = check_vector('start', start, arm.joint_count, arm.joint_names)
    for name, value, low, high in zip(arm.joint_names, q0, arm.limits.lower, arm.limits.upper):
        if not low <= value <= high:
            raise InvalidInputError(
                f'start of {name!r} is {value:g}, expected a position in [{low:g}, {high:g}]')
    return q0


def _pattern(n: int, duration: float) -> FloatArray:
    """Return the via-points in units of the swing, (points, n), 0 at both ends."""
    swings = max(1, min(len(_SWINGS), round(duration / _SECONDS_PER_SWING) - 1))
    pattern = np.zeros((swings + 2, n))
    for j in range(n):
        pattern[1:-1, j] = (-1.0)**j * np.roll(_SWINGS, -j)[:swings]
    return pattern


def _trajectory(
    arm: ArmModel, q0: FloatArray, pattern: FloatArray, swing: FloatArray, T: float,
) -> JointTrajectory:
    times = np.linspace(0.0, T, len(pattern))
    return quintic_via_points(arm.joint_names, times.tolist(), q0 + pattern * swing)


def _sample(trajectory: JointTrajectory) -> Reference:
    times: FloatArray = np.linspace(0.0, trajectory.duration, _SAMPLES, dtype=np.float64)
    return sample_trajectory(trajectory, times)


def _swing_within_limits(
    arm: ArmModel, q0: FloatArray, pattern: FloatArray, T: float,
) -> FloatArray:
    """Return the largest amplitude of each joint (n,); the whole motion is linear in it."""
    n, limits = arm.joint_count, arm.limits
    below, above = room(arm, q0, POSITION_MARGIN)
    allowed = ExcitationLimits(
        q0, np.maximum(below, 0.0), np.maximum(above, 0.0), LIMIT_FRACTION * limits.velocity,
        np.full(n, LARGEST_ACCELERATION), limits.effort)
    swing = np.where([kind == 'prismatic' for kind in arm.joint_kinds],
                     LARGEST_PRISMATIC_SWING, LARGEST_SWING)
    return np.minimum(swing, allowed.largest_scale(
        *_sample(_trajectory(arm, np.zeros(n), pattern, np.ones(n), T))))
