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
from dataclasses import dataclass
from functools import cached_property
import math
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.laws.error_feedback import DEFAULT_NATURAL_FREQUENCY

POSITION_MARGIN = 0.01
"""[rad] or [m] before a position limit from which no effort accelerates the joint towards it."""
LONGEST_STEP = 0.05
"""Longest time [s] for which one effort may change at the rate limit since the last effort."""
_FAR = 1.0
"""Largest distance [rad] or [m] for which a position counts as far from all limits."""


@dataclass(frozen=True, eq=False)
class EffortLimits:
    """
    Limits of n joints.

    `lower`, `upper` (n,) [rad] or [m] and `velocity` (n,) [rad/s] or [m/s] are infinite for joints
    without a limit. `rate` [N·m/s] or [N/s] is (n,) or one value for all joints.
    """

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    rate: FloatArray | float
    effort: FloatArray | float = math.inf
    """Largest effort (n,) or one for all joints, apart from `holding`."""
    direction: FloatArray | float = 1.0
    """Sign (n,) of the torque at the joint for a positive effort, or one for all joints."""

    @cached_property
    def soft_lower(self) -> FloatArray:
        """Return where the margin before the lower limits ends, (n,)."""
        return self.lower + POSITION_MARGIN

    @cached_property
    def soft_upper(self) -> FloatArray:
        """Return where the margin before the upper limits begins, (n,)."""
        return self.upper - POSITION_MARGIN

    def is_clear(self, q: FloatArray, v: FloatArray) -> bool:
        """
        Return whether neither a position limit nor a velocity limit acts at (q, v).

        Every joint is then before the margin of its position limits, and not above its velocity
        limit.
        """
        if not math.hypot(*v.tolist()) <= self._least_velocity and bool(
                (np.abs(v) > self.velocity).any()):
            return False
        values, (center, clearance) = q.tolist(), self._clear
        if math.dist(values, center) <= clearance:
            return True
        clearance = float(np.minimum(self.soft_upper - q, q - self.soft_lower).min())
        object.__setattr__(self, '_clear', (values, min(clearance, _FAR)))
        return clearance >= 0.0

    @cached_property
    def _least_velocity(self) -> float:
        return float(self.velocity.min(initial=math.inf))

    @cached_property
    def _clear(self) -> tuple[list[float], float]:
        """A position, and the distance from it up to which no position limit acts."""
        return [0.0] * len(self.lower), -1.0

    @cached_property
    def least_rate(self) -> float:
        """Return the smallest rate of all joints."""
        return float(np.min(self.rate))

    @cached_property
    def joint_rates(self) -> FloatArray:
        """Return the rate of each joint, (n,)."""
        return np.array(np.broadcast_to(self.rate, self.lower.shape))

    @cached_property
    def no_joint(self) -> BoolArray:
        """Return False for each joint, (n,)."""
        return np.zeros(len(self.lower), dtype=bool)


MotionEquation = Callable[
    [FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""Returns M(q) (n, n), and C(q, v) v + friction (n,)."""


class ActiveLimits(NamedTuple):
    """The joints (n,) whose effort each limit has changed."""

    position: BoolArray
    velocity: BoolArray
    rate: BoolArray


class EffortLimiter:
    """Keeps efforts within limits; remembers the last one for its rate of change."""

    def __init__(self, limits: EffortLimits) -> None:
        self.limits = limits
        self.last: FloatArray | None = None
        """The effort (n,) that was published last, or None."""
        self._last: FloatArray | None = None
        self._last_values: list[float] = []
        """The values of `_last`, which are `last` after an effort that was not limited."""
        self.active: ActiveLimits | None = None
        """The limits that have changed the last effort of `apply`, None for none."""

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
        limits, allowed = self.limits, effort
        by_position = by_velocity = by_rate = limits.no_joint
        is_clear = limits.is_clear(q, v)
        if not is_clear:
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
        if self.last is None:
            self.last, dt = holding(), 0.0
        moved = self.rate_limited(allowed, dt)
        if moved is not allowed:
            by_rate = moved != allowed
        has_changed = moved is not effort and bool((moved != effort).any())
        self.active = ActiveLimits(by_position, by_velocity, by_rate) if has_changed else None
        return moved

    def rate_limited(self, effort: FloatArray, dt: float) -> FloatArray:
        """
        Return the last effort changed toward `effort` (n,) as far as the rate limit allows in dt.

        `dt` [s] is the time since the last effort. The efforts of all joints cover the same
        fraction of their change: an effort between two efforts that accelerate the arm as intended
        also does so, whereas the inertia torques of the other joints would accelerate a joint
        whose effort lags behind.
        """
        last, dt = self.last, min(max(dt, 0.0), LONGEST_STEP)
        if last is None:
            self.last = effort
            return effort
        if last is not self._last:
            self._last, self._last_values = last, last.tolist()
        values = effort.tolist()
        distance = math.dist(values, self._last_values)
        if distance <= self.limits.least_rate * dt:  # no joint exceeds its rate limit
            self.last = self._last = effort
            self._last_values = values
            return effort
        change, rate = effort - last, self.limits.joint_rates
        with np.errstate(over='ignore'):
            longest = float(np.max(np.abs(change) / rate))
        self.last = effort if longest <= dt else last + (dt / longest) * change
        return self.last
