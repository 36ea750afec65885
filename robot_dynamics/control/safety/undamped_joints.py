# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joints whose damping in a fault does not damp them: they are released.

A drive whose command acts with the opposite sign, or a velocity with the opposite sign, turns the
damping of a fault into a motor: the speed grows exponentially, by the rate of the damping. A joint
that is faster than its limit, and has become faster for WINDOW although its effort opposes its
motion all the time, is not held by this effort, whatever the cause. Without it, it gets no energy.
A joint moves others: after the first one, all that are too fast are released.

The drive check does not replace this: it checks laws without a reference only at the start. Later
a reversed joint reached 461 times its velocity limit in a second, and 25 times with this class.
"""

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.gains.gain_scaling import LOOP_DELAY

WINDOW = 3.0 * LOOP_DELAY
"""[s]: an effort acts up to 16 ms late; then it brakes a joint within a few states."""
NOISE = 0.05
"""[rad/s] or [m/s] that a measured speed may grow by noise."""
LARGEST_SPEED = 10.0
"""[rad/s] or [m/s], the limit of a joint without one."""


class UndampedJoints:
    """Watches n joints while they are damped; for one thread."""

    def __init__(self, n: int) -> None:
        self.released: BoolArray = np.zeros(n, dtype=bool)
        """Joints (n,) that get no effort, until `restart`."""
        self._opposed: BoolArray = np.zeros(n, dtype=bool)
        self._speed: FloatArray = np.zeros(n)
        self._since = -np.inf

    def restart(self) -> None:
        """Let all joints have efforts again."""
        self.released = np.zeros_like(self.released)
        self._since = -np.inf

    def take(self, time: float, v: FloatArray, damping: FloatArray, limit: FloatArray) -> int:
        """
        Take the velocities v (n,); return a joint that is released now, or −1.

        `time` [s] is that of the states; `damping` (n,) is the effort against the motion, `limit`
        (n,) the velocity limit.
        """
        speed = np.abs(v)
        is_fast = speed > np.minimum(limit, LARGEST_SPEED)
        if self.released.any():
            self.released = self.released | is_fast
            return -1
        opposed, passed = is_fast & (damping * v < 0.0), time - self._since
        if 0.0 <= passed < WINDOW - 1e-9:  # a sum of periods
            self._opposed = self._opposed & opposed
            return -1
        found = self._opposed & opposed & (speed > self._speed + NOISE)
        self._since, self._speed, self._opposed = time, speed, opposed
        if not 0.0 <= passed <= 4.0 * WINDOW or not found.any():
            return -1
        self.released = found
        return int(np.argmax(found))
