# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Limits of the effort of each joint, applied before the effort is sent to a real arm.

`holding` is the command that holds the arm: g(q), as far as the robot does not add it on its own.
Beyond `holding`, the efforts do not accelerate a joint toward a position limit that it is about to
pass, or beyond its velocity limit; the acceleration of the other joints stays as it is. The rate
limit is applied last and has priority: if a joint reaches a limit while an effort acts toward it,
this effort is reduced at the rate limit (100 N·m in 0.1 s at the default), not in one step. A step
would jerk gears and links, a drive that monitors the torque rate would report an error, and noise
around the limit would cause a step at every state. Neither the position limit nor the velocity
limit brakes the joint.

For comparison: libfranka bounds the torque rate at 1000 N·m/s; the joint limits of ros2_control
report a fault 0.0087 rad past a limit.
"""

from collections.abc import Callable
import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.error_feedback import DEFAULT_NATURAL_FREQUENCY
from robot_dynamics.control.safety.faults import STATE_TIMEOUT

POSITION_MARGIN = 0.01
"""[rad] or [m] before a position limit from which no effort accelerates the joint towards it."""
_FAR = 1e6
"""Largest distance from the ends of a range that is used."""


class Range:
    """
    The values (n,) from `low` to `high`, which may be infinite.

    Values are mostly near the last ones that were compared: within `clearance` of `center`, all
    are in the range.
    """

    def __init__(self, low: FloatArray, high: FloatArray) -> None:
        self.low, self.high = low, high
        self.center, self.clearance = [0.0] * len(low), -1.0

    def contains(self, values: list[float]) -> bool:
        """Return whether n values are finite and in the range."""
        if math.dist(values, self.center) <= self.clearance:
            return True
        x = np.array(values)
        clearance = float(np.minimum(self.high - x, x - self.low).min(initial=_FAR))
        if not clearance >= 0.0:
            return False
        self.center, self.clearance = values, 0.999 * clearance  # not beyond it by rounding
        return True


class EffortLimits:
    """
    Limits of n joints.

    `lower`, `upper` (n,) [rad] or [m] and `velocity` (n,) [rad/s] or [m/s] are infinite for joints
    without a limit. `rate` (n,) [N·m/s] or [N/s]. `effort` is the largest one (n,), or one for all
    joints, apart from `holding`. `direction` is the sign (n,) of the torque at the joint for a
    positive effort, or one for all joints.
    """

    def __init__(
        self, lower: FloatArray, upper: FloatArray, velocity: FloatArray,
        rate: FloatArray | float, effort: FloatArray | float = math.inf,
        direction: FloatArray | float = 1.0,
    ) -> None:
        """`rate` may be one value for all joints."""
        self.lower, self.upper, self.velocity, self.effort = lower, upper, velocity, effort
        self.direction = direction
        self.rate: FloatArray = np.array(np.broadcast_to(rate, lower.shape))
        self.least_rate = float(self.rate.min(initial=math.inf))
        self.soft_lower, self.soft_upper = lower + POSITION_MARGIN, upper - POSITION_MARGIN
        """Ends of the margins before the position limits, (n,)."""
        self.clear = Range(np.concatenate((self.soft_lower, -velocity)),
                           np.concatenate((self.soft_upper, velocity)))
        """Positions and velocities (2 n,) at which no limit acts."""


MotionEquation = Callable[
    [FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""Returns M(q) (n, n), and C(q, v) v + friction (n,)."""


class EffortLimiter:
    """Keeps efforts within limits; remembers the last one for its rate of change."""

    def __init__(self, limits: EffortLimits) -> None:
        self.limits = limits
        self.last: FloatArray | None = None
        """The effort (n,) that was published last, or None."""
        self._last: FloatArray | None = None
        self._last_values: list[float] = []
        """The values of `_last`, which are `last` after an effort that was not limited."""
        self.active: tuple[str, ...] = ()
        """The limits that have changed the last effort of `apply`."""

    def apply(
        self, effort: FloatArray, holding: Callable[[], FloatArray], q: FloatArray,
        v: FloatArray, dt: float, equation: MotionEquation | None = None,
    ) -> FloatArray:
        """
        Return the effort that may be published dt [s] after the last effort.

        `holding` returns the command (n,) that holds the arm still, which is the first effort.
        `effort`, q and v are (n,). `equation` returns M(q) (n, n), and C(q, v) v with the
        compensation of friction (n,), by default the unit matrix and 0: joints that do not move
        each other.
        """
        limits, allowed, active = self.limits, effort, tuple[str, ...]()
        if not limits.clear.contains([*q.tolist(), *v.tolist()]):
            still = holding()
            M, passive = (np.eye(len(q)), np.zeros_like(q)) if equation is None else (
                equation(q, v))
            a = np.linalg.solve(M, effort - still - passive)
            braking = -DEFAULT_NATURAL_FREQUENCY * v  # of a joint that moves away from a limit
            by_position = ((a > np.maximum(braking, 0.0)) & (q > limits.soft_upper)) | (
                (a < np.minimum(braking, 0.0)) & (q < limits.soft_lower))
            by_velocity = (np.abs(v) > limits.velocity) & (a * v > 0.0)
            is_held = by_position | by_velocity
            if is_held.any():
                most = np.maximum(np.maximum(np.abs(still), np.abs(effort)), limits.effort)
                allowed = np.clip(
                    still + passive + M @ np.where(is_held, 0.0, a), -most, most)
                active = (('position limit',) if by_position.any() else ()) + (
                    ('velocity limit',) if by_velocity.any() else ())
        if self.last is None:
            self.last, dt = holding(), 0.0
        moved = self.rate_limited(allowed, dt)
        if moved is not allowed and (moved != allowed).any():
            active = (*active, 'effort rate')
        self.active = active if moved is not effort and (moved != effort).any() else ()
        return moved

    def rate_limited(self, effort: FloatArray, dt: float) -> FloatArray:
        """
        Return the last effort changed toward `effort` (n,) as far as the rate limit allows in dt.

        `dt` [s] is the time since the last effort, of which STATE_TIMEOUT counts. The efforts of
        all joints cover the same fraction of their change: an effort between two efforts that
        accelerate the arm as intended also does so, whereas the inertia torques of the other
        joints would accelerate a joint whose effort lags behind.
        """
        last, dt = self.last, min(max(dt, 0.0), STATE_TIMEOUT)
        if last is None:
            self.last = effort
            return effort
        if last is not self._last:
            self._last, self._last_values = last, last.tolist()
        values = effort.tolist()
        if math.dist(values, self._last_values) <= self.limits.least_rate * dt:
            self.last, self._last, self._last_values = effort, effort, values
            return effort  # no joint exceeds its rate limit
        change = effort - last
        with np.errstate(over='ignore'):
            longest = float(np.max(np.abs(change) / self.limits.rate))
        self.last = effort if longest <= dt else last + (dt / longest) * change
        return self.last
