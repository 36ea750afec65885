# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The person who guides an arm by hand in `safe_motion`, along the trajectories of other modes."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory

HAND_GUIDING = 'hand_guiding'
STIFFNESS, DAMPING = 100.0, 20.0
"""[1/s²] and [1/s] of the hand, per inertia of the arm."""
STRENGTH = 10.0
"""Largest push, as acceleration of a joint [rad/s²], beyond its dry friction in motion."""
HASTE = 1.5
"""Speed of the hand, by that of hand guiding, which it exceeds."""
PATIENCE = 1.0
"""[s] after which the hand releases the arm at the end of its way."""


class Hand:
    """A spring and a damper between the joints and a target, which is as fast as a person."""

    def __init__(self, arm: ArmModel, q: FloatArray) -> None:
        limits = arm.limits
        self._body, self._dry = ArmDynamics(arm).rigid_body, arm.friction.at_rest.static
        self._speed = HASTE * np.minimum(0.5 * limits.velocity, 1.0)
        self._target: FloatArray | None = None
        self._times, self._points = np.zeros(1), np.zeros((1, len(q)))
        self._last = self._release = 0.0

    def follow(self, trajectory: JointTrajectory, time: float, q: FloatArray) -> None:
        """Take the arm, or continue, along the points of a trajectory."""
        if self._target is None:
            self._target, self._last = q, time
        self._times = time + np.array([point.time_from_start for point in trajectory.points])
        self._points = np.array([point.position for point in trajectory.points])
        self._release = self._times[-1] + PATIENCE

    @property
    def has_released(self) -> bool:
        """Whether the hand does not touch the arm."""
        return self._target is None

    def effort(self, time: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return the push (n,) at a state of the arm."""
        if self._target is None:
            return np.zeros_like(q)
        h, self._last = time - self._last, time
        goal = self._points[min(int(np.searchsorted(self._times, time)), len(self._points) - 1)]
        step = np.clip(goal - self._target, -h * self._speed, h * self._speed)
        self._target = self._target + step
        if time > self._release and not step.any():
            self._target = None
        if self._target is None:
            return np.zeros_like(q)
        e, e_dot = self._target - q, (step / h if h > 0.0 else step) - v
        push = np.clip(STIFFNESS * e + DAMPING * e_dot, -STRENGTH, STRENGTH)
        return np.asarray(self._body.mass_matrix(q) @ push + self._dry * np.sign(step))
