# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Limits of velocity, acceleration and jerk for references that an arm can follow.

The equation of motion M(q) q̈ + C(q, q̇) q̇ + g(q) = τ limits the acceleration by the effort
limits minus gravity, and the jerk by the rate limit of the effort: M(q) q⃛ ≈ τ̇. Both are
evaluated at poses over the whole workspace, so that one set of limits is valid in the whole
workspace:

    Σ_k |M_ik(q)| a_k <= β (τ_i − |g_i(q)| − τ_f,i),    Σ_k |M_ik(q)| j_k <= β τ̇_i    for all i, q

with the friction τ_f at the velocity limit. The rest, 1 − β, is for feedback and Coriolis torques.
β is FRACTION, which is also the fraction of the velocity limit.
"""

from dataclasses import dataclass, replace
import math

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.regressor import random_states
from robot_dynamics.model.unchecked_rigid_body import UncheckedRigidBody

FRACTION = 0.5
"""Fraction of the velocity limit, of the remaining effort and of its rate, for a reference."""
WHOLE_FRACTION = 0.88
"""Fraction of the velocity limit for a motion that the sender has planned."""
WHOLE_EFFORT = 1.0 - 0.5 * (1.0 - FRACTION)
"""β of such a motion, and of a stop at a position limit: it leaves half as much for feedback."""
LEAST_FRACTION = 0.1
"""
Fraction of the effort limit that gravity must leave; poses with less are excluded.

The drives cannot hold the arm in these poses, so that it does not reach them. The limits are
scaled by the fraction of the remaining poses, so that a load does not increase them.
"""
DEFAULT_VELOCITY = 1.0
"""Velocity limit [rad/s] or [m/s] of a joint without a limit in the URDF."""
SPEED_UP_TIME = 0.2
"""Shortest time [s] in which a joint reaches its reference velocity, or stops."""
JERK_TIME = SPEED_UP_TIME / 4.0
"""Shortest time [s] in which a joint reaches its reference acceleration: half of the shortest
change of the velocity has a constant acceleration."""
SLOWEST_FRACTION = 1e-3
"""Smallest acceleration and jerk, as fractions of the values from the two times above."""
_POSES, _STOP_POSES = 40, 4


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """
    Limits of the reference of n joints, each (n,), in rad or m, and s.

    `lower` and `upper` limit the position and may be infinite; `velocity`, `acceleration` and
    `jerk` are positive and finite. The reference brakes with those of `braking`, and moves with
    the lower limits of `lowered`.
    """

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray

    scale: float = 1.0
    """Fraction of the velocities at which motions are planned."""
    brake: tuple[FloatArray, FloatArray] | None = None
    """Acceleration and jerk (n,) with which the reference brakes, None for those above."""

    def slower(self, scale: float) -> 'MotionLimits':
        """Return the limits for motions of 1/scale times the duration, with the same braking."""
        return replace(self, scale=scale * self.scale)

    @property
    def lowered(self) -> 'MotionLimits':
        """The limits of a motion of 1/scale times the duration."""
        s = self.scale
        return MotionLimits(self.lower, self.upper, s * self.velocity, s**2 * self.acceleration,
                            s**3 * self.jerk)

    @property
    def braking(self) -> 'MotionLimits':
        """The limits with which the reference brakes."""
        if self.brake is None:
            return self
        a, jerk = self.brake
        return replace(self, acceleration=a, jerk=jerk, brake=None)

    def with_braking(
        self, body: UncheckedRigidBody, effort: FloatArray, effort_rate: FloatArray,
        q: FloatArray, v: FloatArray,
    ) -> 'MotionLimits':
        """
        Return the limits with the braking that the poses of a stop from (q, v) permit, (n,) each.

        An arm that is weak in some poses brakes slowly with limits for the whole workspace. In a
        stop gravity counts with its sign. A stop of less than SPEED_UP_TIME has the same limits
        everywhere.
        """
        fastest = np.abs(v) / SPEED_UP_TIME
        moves = fastest > self.acceleration
        if not moves.any():
            return self
        a = np.where(moves, fastest, 0.0)
        jerk, pose = a / JERK_TIME, q
        for _ in range(_STOP_POSES):
            mass, g = np.abs(body.mass_matrix(pose))[np.newaxis], body.gravity(pose)
            free = effort + np.where(moves, np.sign(v) * g, -np.abs(g))
            a = _shared(mass, FRACTION * np.maximum(free, LEAST_FRACTION * effort), a)
            jerk = _shared(mass, FRACTION * effort_rate, jerk)
            pose = q + 0.5 * v * np.abs(v) / np.maximum(a, self.acceleration)
        return replace(
            self, brake=(np.maximum(a, self.acceleration), np.maximum(jerk, self.jerk)))

    @property
    def whole(self) -> 'MotionLimits':
        """The limits of a motion that the sender has planned, with less reserve for feedback."""
        share = WHOLE_EFFORT / FRACTION
        return replace(
            self, velocity=WHOLE_FRACTION / FRACTION * self.velocity,
            acceleration=share * self.acceleration, jerk=share * self.jerk)


def _shared(mass: FloatArray, available: FloatArray, most: FloatArray) -> FloatArray:
    """
    Return x (n,) with |M| x <= available (poses, n), and at most `most` (n,).

    `mass` is |M| (poses, n, n). The elements have the same proportions as the values of each joint
    moving alone.
    """
    own = np.diagonal(mass, axis1=1, axis2=2)
    alone = np.min(available / np.maximum(own, 1e-9), axis=0, initial=math.inf)
    x = np.minimum(alone, most)
    needed = mass @ x
    with np.errstate(divide='ignore', invalid='ignore'):
        scale = np.min(np.where(needed > 0.0, available / needed, math.inf), initial=1.0)
    return np.asarray(np.maximum(scale * x, SLOWEST_FRACTION * most))


class WorkspaceInertia:
    """M(q) and g(q) of one arm at sampled poses of its workspace."""

    def __init__(self, dynamics: ArmDynamics) -> None:
        body = dynamics.unchecked.rigid_body
        poses = random_states(dynamics.arm, _POSES)[0]
        self.dynamics = dynamics
        self.matrices: FloatArray = np.array([body.mass_matrix(q) for q in poses])
        """M(q) at each pose."""
        self.mass: FloatArray = np.abs(self.matrices)
        self.gravity: FloatArray = np.array([np.abs(body.gravity(q)) for q in poses])

    def heavier(self, other: 'WorkspaceInertia') -> 'WorkspaceInertia':
        """Return the larger values at each pose, for the transition between two loads."""
        both = object.__new__(WorkspaceInertia)
        both.dynamics = self.dynamics
        both.matrices = np.concatenate((self.matrices, other.matrices))
        both.mass = np.maximum(self.mass, other.mass)
        both.gravity = np.maximum(self.gravity, other.gravity)
        return both

    def motion_limits(self, effort: FloatArray, effort_rate: FloatArray) -> MotionLimits:
        """
        Return the limits of a reference that the effort can follow.

        `effort` (n,) [N·m] or [N] and `effort_rate` (n,) [N·m/s] or [N/s] are the limits of the
        command, infinite for no limit.
        """
        arm, limits = self.dynamics.arm, self.dynamics.arm.limits
        friction, known = arm.friction, np.isfinite(limits.velocity)
        resistance = friction.at_rest.static + friction.viscous * np.where(
            known, limits.velocity, DEFAULT_VELOCITY)
        remaining = np.maximum(effort - self.gravity - resistance, LEAST_FRACTION * effort)
        is_held: BoolArray = np.all(self.gravity <= (1.0 - LEAST_FRACTION) * effort, axis=1)
        if is_held.any():
            remaining[~is_held] = math.inf
            remaining *= float(is_held.mean())
        velocity = np.where(known, FRACTION * limits.velocity, DEFAULT_VELOCITY)
        acceleration = _shared(self.mass, FRACTION * remaining, velocity / SPEED_UP_TIME)
        jerk = _shared(self.mass, FRACTION * effort_rate, acceleration / JERK_TIME)
        return MotionLimits(limits.lower, limits.upper, velocity, acceleration, jerk)
