# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The person who guides an arm by hand in `safe_motion`, along the trajectories of other modes."""

from benchmarks.safe_motion_plant import Plant
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory

HAND_GUIDING = 'hand_guiding'
STIFFNESS, DAMPING = 100.0, 20.0
"""[1/s²] and [1/s] of the hand, per inertia of the arm."""
STRENGTH = 10.0
"""Largest push, as acceleration of a joint [rad/s²], beyond its dry friction."""
HELD = 0.8
"""
Share of an effort limit that gravity and the push take at most: an arm that is stopped can hold
the hand.
"""
YIELD = 0.02
"""
[rad] from the target at which the hand pushes with the true dry friction of a joint, damped like
the spring: it does not push a joint that is ahead, and holds a light one that breaks away.
"""
STEP = 1e-3
"""[s] for which a push is constant; the hold is implicit in the velocity after it."""
HASTE = 1.5
"""Speed of the hand, by that of hand guiding, which it exceeds."""
PATIENCE = 1.0
"""[s] after which the hand releases the arm at the end of its way."""
AT_REST = 1e-3
"""[rad/s]"""
COASTING, FADING = 8.0, 1.0
"""[s] in which a released arm may come to rest, and then until a compensation has faded."""


class Hand:
    """A spring and a damper between the joints and a target, which is as fast as a person."""

    def __init__(self, arm: ArmModel) -> None:
        limits, n = arm.limits, arm.joint_count
        self.dry = arm.friction.at_rest.static
        self.rotors = np.zeros((n, n))
        self._effort, self._speed = limits.effort, HASTE * np.minimum(0.5 * limits.velocity, 1.0)
        self._target: FloatArray | None = None
        self._times, self._points = np.zeros(1), np.full((1, n), np.nan)
        self._last = self._release = 0.0

    def follow(self, trajectory: JointTrajectory, time: float, q: FloatArray) -> None:
        """Take the arm, or continue, along the points of a trajectory; ignore a repeated goal."""
        points = np.array([point.position for point in trajectory.points])
        if np.array_equal(points[-1], self._points[-1]):
            return
        if self._target is None:
            self._target, self._last = q, time
        self._points = points
        self._times = time + np.array([point.time_from_start for point in trajectory.points])
        self._release = self._times[-1] + PATIENCE

    def has_ended(self, time: float, v: FloatArray) -> bool:
        """Return whether the hand has released an arm that rests, or waits no longer."""
        return time > self._release + COASTING or (
            self._target is None and bool(np.abs(v).max() < AT_REST))

    def effort(self, time: float, plant: Plant) -> FloatArray:
        """Return the push (n,) at an arm, whose load the person feels."""
        q, v = plant.q, plant.v
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
        M, grip, lead = plant.body.mass_matrix(q), self.dry / YIELD, DAMPING / STIFFNESS
        ahead = self._target - q - lead * v
        push = M @ np.clip(STIFFNESS * ahead, -STRENGTH, STRENGTH)
        coupling = np.abs(np.linalg.inv(M + self.rotors)) @ grip
        hold = grip * ahead / (1.0 + STEP * (STEP + lead) * coupling)
        return self.held(push + np.clip(hold, -self.dry, self.dry), plant)

    def bearable(self, push: FloatArray, plant: Plant) -> FloatArray:
        """Return the share of a push (n,) of others that is not stronger than a person."""
        a = np.linalg.solve(plant.body.mass_matrix(plant.q) + self.rotors, push)
        return self.held(push * min(1.0, STRENGTH / float(np.abs(a).max())), plant)

    def held(self, push: FloatArray, plant: Plant) -> FloatArray:
        """Return the share of a push (n,) that the arm can hold when it has stopped."""
        gravity = plant.body.gravity(plant.q)
        spare = HELD * self._effort - np.where(push > 0.0, -gravity, gravity)
        return np.asarray(push * min(1.0, max(0.0, np.min(
            spare / np.maximum(np.abs(push), 1e-9)))))
