# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The force of a follower at the joints of a leader arm, without a gain of energy.

The force arrives late: a delayed spring gives back more energy than it has received, and a leader
that bounces off a wall of its follower would bounce higher each time. An energy tank per joint
prevents that (B. Hannaford, J.-H. Ryu, IEEE Trans. Robotics and Automation 18(1), 2002: time
domain passivity). A force against the motion fills it with the share RETURNED of the energy that
the leader spends, and remaining dry friction with what it dissipates; a force along the motion
takes out of the tank what it gives, and ends when the tank is empty.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import LOOP_DELAY

LIMIT_SHARE, UNLIMITED = 0.25, 1.0
"""The largest force by the effort limit, and of a joint without one [N·m] or [N]."""
RETURNED = 0.5
"""The rest covers the energy that a force gives while it acts late."""
RESERVE_WAY = 0.05
"""[rad] or [m] of motion at the largest force whose energy a tank holds at most."""
DELAY = 2.0 * LOOP_DELAY
"""[s] until a force ends, in addition to a period of the joint states."""


class ForceFeedback:
    """The force of n joints."""

    def __init__(self, gain: FloatArray, effort_limit: FloatArray) -> None:
        """`effort_limit` (n,) [N·m] or [N] is infinite for no limit."""
        self._gain = gain
        self._limit = np.where(
            np.isfinite(effort_limit), LIMIT_SHARE * effort_limit, UNLIMITED)
        self.restart()

    def restart(self) -> None:
        """Empty the tanks; the leader has moved unobserved."""
        self._energy = np.zeros_like(self._gain)
        self._last = np.zeros_like(self._gain)

    def effort(
        self, external: FloatArray, moved: FloatArray, v: FloatArray, dt: float,
        friction: FloatArray,
    ) -> FloatArray:
        """
        Return the effort (n,) for the external effort of the follower (n,).

        The leader has `moved` (n,) [rad] or [m] in the last dt [s], and has the velocity v (n,).
        `friction` (n,) is the dry friction that remains at the leader.
        """
        given = self._last * moved
        self._energy = np.clip(
            self._energy - np.where(given < 0.0, RETURNED, 1.0) * given, 0.0,
            RESERVE_WAY * self._limit)
        wanted = np.clip(self._gain * external, -self._limit, self._limit)
        speed = np.maximum(np.maximum(v * np.sign(wanted), moved * np.sign(wanted) / dt), 0.0)
        free = friction + self._energy / np.maximum(speed * (dt + DELAY), 1e-12)
        self._last = np.where(speed > 0.0, np.clip(wanted, -free, free), wanted)
        return self._last
