# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Inverse kinematics near a given position, within position limits.

Damped least squares (Y. Nakamura, H. Hanafusa, J. Dynamic Systems, Measurement, and Control
108(3), 1986): Δq = Jᵀ (J Jᵀ + λ² I)⁻¹ e. λ² contains the squared error (T. Sugihara, IEEE Trans.
Robotics 27(5), 2011), so that steps are short far from the solution and at singularities. Joints
at a limit that would pass it are left out of a step.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.task_space.frame_kinematics import FrameKinematics, rotation_vector
from robot_dynamics.validation import LARGEST_VALUE

DISTANCE, ANGLE = 1e-4, 1e-3
"""[m] and [rad] from the pose within which it is reached."""
LENGTH, LITTLE = 0.3, 1e-3
"""[m] that weighs as much as 1 rad; the latter for arms with fewer than six joints."""
STEPS = 300
LARGEST_STEP = 0.3
"""[rad] or [m] of all joints together."""
LEAST_DAMPING = 1e-9
"""λ² without an error, relative to the mean square of the rows of J."""


def joints_at(
    arm: ArmModel, kinematics: FrameKinematics, start: FloatArray, translation: FloatArray,
    rotation: FloatArray,
) -> FloatArray:
    """
    Return a position (n,) near `start` (n,) at which the frame has this pose in the base frame.

    Arms with fewer than six joints reach the translation (3,) [m], with the rotation (3, 3) as
    near as that permits. Raises InvalidInputError with the residual if no position is found.
    """
    limits, n = arm.limits, arm.joint_count
    lower, upper = (np.clip(x, -LARGEST_VALUE, LARGEST_VALUE) for x in (
        limits.lower, limits.upper))
    length = LENGTH if n >= 6 else LITTLE
    weights = np.array([1.0, 1.0, 1.0, length, length, length])
    q = best = np.clip(start, lower, upper)
    least, distance, angle = np.inf, np.inf, np.inf
    for _ in range(STEPS):
        p, R, J = kinematics.jacobian(q)
        turn = rotation_vector(rotation @ R.T)
        e = weights * np.concatenate([translation - p, turn])
        if float(e @ e) < least:
            least, best = float(e @ e), q
            distance, angle = float(np.linalg.norm(translation - p)), float(np.linalg.norm(turn))
        if distance <= 0.1 * DISTANCE and angle <= 0.1 * ANGLE:
            break
        step = _step(weights[:, np.newaxis] * J, e, q, lower, upper)
        if not float(np.abs(step).max(initial=0.0)) > 1e-9:
            break
        q = np.clip(q + step, lower, upper)
    if distance <= DISTANCE and (angle <= ANGLE or n < 6):
        turns = np.where(np.array(arm.joint_kinds) == 'prismatic', 0.0, 2.0 * np.pi)
        nearer = best - turns * np.round((best - start) / (2.0 * np.pi))
        return np.where((nearer >= lower) & (nearer <= upper), nearer, best)
    raise InvalidInputError(
        f'pose of {kinematics.frame!r} is {distance:.3g} m and {angle:.3g} rad from the nearest '
        'pose that was found within the position limits, expected a pose in reach')


def _step(
    J: FloatArray, e: FloatArray, q: FloatArray, lower: FloatArray, upper: FloatArray,
) -> FloatArray:
    """Return Δq (n,), 0 at joints whose limit it would pass."""
    damping = LEAST_DAMPING * float((J * J).mean()) + 1e-2 * float(e @ e)
    step, free = np.zeros_like(q), np.ones(len(q), dtype=bool)
    for _ in range(len(q)):
        J_f = J[:, free]
        step[free] = J_f.T @ np.linalg.solve(J_f @ J_f.T + damping * np.eye(6), e)
        stuck = free & ((q >= upper) & (step > 0.0) | (q <= lower) & (step < 0.0))
        if not stuck.any():
            break
        free &= ~stuck
        step[~free] = 0.0
    return np.asarray(step * min(1.0, LARGEST_STEP / max(float(np.linalg.norm(step)), 1e-12)))
