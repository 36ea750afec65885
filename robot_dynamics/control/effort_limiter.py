# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
What an effort may be, joint by joint, before it goes to a real arm.

Beyond what holds the arm (`hold`, g(q) as far as the robot does not add it itself), no effort
pushes a joint on toward a position limit that it is about to pass, nor faster than its velocity
limit. What is left changes no faster than the rate limit, which has the last word: a push that
stands when its joint comes to a limit is taken back at that rate, 100 N·m in 0.1 s at the default,
and not at once. A step would jerk gears and links, a drive that watches the rate ends in an error,
and noise about the limit would make steps of every state. Neither limit brakes.

Figures of the field: libfranka bounds the torque rate at 1000 N·m/s; ros2_control's joint limits
fault 0.0087 rad past a limit.
"""

from dataclasses import dataclass
from functools import cached_property
import math
from operator import gt
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray

LONGEST_STEP = 0.05
"""[s] of change of effort that is allowed at once, however long ago the last effort was."""


@dataclass(frozen=True, eq=False)
class EffortLimits:
    """
    Limits of n joints.

    `lower`, `upper` (n,) [rad] or [m] and `velocity` (n,) [rad/s] or [m/s], infinite where there
    is none; `margin` [rad] or [m] before a position limit; `rate` [N·m/s] or [N/s], (n,) or one
    for all joints.
    """

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    margin: float
    rate: FloatArray | float

    @cached_property
    def soft_lower(self) -> FloatArray:
        """Return where the margin before the lower limits ends, (n,)."""
        return self.lower + self.margin

    @cached_property
    def soft_upper(self) -> FloatArray:
        """Return where the margin before the upper limits begins, (n,)."""
        return self.upper - self.margin

    def is_near(self, q: FloatArray) -> bool:
        """Tell whether any joint is within the margin before a position limit, or past it."""
        lower, upper, _ = self._as_lists
        values = q.tolist()
        return True in map(gt, values, upper) or True in map(gt, lower, values)

    def is_too_fast(self, v: FloatArray | None) -> bool:
        """Tell whether any joint is faster than its limit; a velocity may be unknown (None)."""
        return v is not None and True in map(gt, map(abs, v.tolist()), self._as_lists[2])

    @cached_property
    def _as_lists(self) -> tuple[list[float], list[float], list[float]]:
        """Return soft limits and velocities as lists: for few numbers quicker than arrays."""
        return self.soft_lower.tolist(), self.soft_upper.tolist(), self.velocity.tolist()

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


class GuardedEffort(NamedTuple):
    """An effort (n,) that may go out, and which joints (n,) each limit held back."""

    effort: FloatArray
    by_position: BoolArray
    by_velocity: BoolArray
    by_rate: BoolArray


class EffortLimiter:
    """Keeps efforts within limits; remembers the last one for its rate of change."""

    def __init__(self, limits: EffortLimits) -> None:
        self.limits = limits
        self.last: FloatArray | None = None
        """The effort that went out last, (n,); None where none did."""

    def apply(
        self, effort: FloatArray, hold: FloatArray, q: FloatArray, v: FloatArray | None,
        dt: float, is_near: bool | None = None, is_too_fast: bool | None = None,
    ) -> GuardedEffort:
        """
        Return what may go out dt [s] after the last effort.

        `is_near` and `is_too_fast` are results of the limits for q and v, None to compute them.

        `hold` (n,) is what holds the arm still, and the first effort; `effort`, q and v are (n,).
        Without a velocity (None) its limit does not act.
        """
        limits = self.limits
        by_position = by_velocity = by_rate = limits.no_joint
        allowed = effort
        if (limits.is_near(q) if is_near is None else is_near) or (
                limits.is_too_fast(v) if is_too_fast is None else is_too_fast):
            push = effort - hold
            by_position = ((push > 0.0) & (q > limits.soft_upper)) | (
                (push < 0.0) & (q < limits.soft_lower))
            if v is not None:
                by_velocity = (np.abs(v) > limits.velocity) & (push * v > 0.0)
            allowed = np.where(by_position | by_velocity, hold, effort)
        if self.last is None:
            self.last, dt = hold, 0.0
        moved = self.rate_limited(allowed, dt, in_proportion=allowed is effort)
        if moved is not allowed:
            by_rate = moved != allowed
        return GuardedEffort(moved, by_position, by_velocity, by_rate)

    def rate_limited(
        self, effort: FloatArray, dt: float, in_proportion: bool = True,
    ) -> FloatArray:
        """
        Return the part of the way to `effort` (n,) that the rate limit allows in dt [s].

        All joints change `in_proportion`: an effort between two that accelerate the arm as
        intended does so as well, whereas one joint that lags behind the others would be
        accelerated by their inertia torques. Otherwise each changes as fast as it may.
        """
        last, dt = self.last, min(max(dt, 0.0), LONGEST_STEP)
        if last is None:
            self.last = effort
            return effort
        distance = math.dist(effort.tolist(), last.tolist())
        if distance <= self.limits.least_rate * dt:  # and so no joint changes by more
            self.last = effort
            return effort
        change, rate = effort - last, self.limits.joint_rates
        if not in_proportion:
            self.last = last + np.clip(change, -rate * dt, rate * dt)
            return self.last
        with np.errstate(over='ignore'):
            longest = float(np.max(np.abs(change) / rate))
        self.last = effort if longest <= dt else last + (dt / longest) * change
        return self.last
