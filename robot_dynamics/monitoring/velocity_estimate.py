# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint velocities from measured positions, for joint states that contain none.

The velocity is the difference quotient over `SPAN`, or over one period of the states if that is
longer: v = (q_k − q_j) / (t_k − t_j) with t_k − t_j ≥ SPAN. It is exact for constant velocity and
late by half of the span, (t_k − t_j) / 2. White noise of standard deviation σ of the positions
gives a noise of √2 σ / (t_k − t_j). Source: P. R. Bélanger, "Estimation of angular velocity and
acceleration from shaft encoder measurements", IEEE Int. Conf. Robotics and Automation, 1992
(finite differences and their trade of delay against noise).
"""

from collections import deque

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray, NANOSECONDS_PER_SECOND, wrap_to_pi

SPAN = 0.01
"""[s]"""
_SPAN_NS = round(SPAN * NANOSECONDS_PER_SECOND)
_PAUSE_NS = NANOSECONDS_PER_SECOND // 2
"""[ns] between two states after which the difference of their positions gives no velocity."""
_MOST = 100
"""Number of stored states within a span."""


class VelocityEstimate:
    """The velocity of n joints, estimated state by state."""

    def __init__(self, wraps: BoolArray) -> None:
        """Mark the continuous joints with `wraps` (n,): their positions may jump by a turn."""
        self._wraps = wraps
        self._any_wraps = bool(wraps.any())
        self._states: deque[tuple[int, FloatArray]] = deque(maxlen=_MOST)
        self.delay = 0.0
        """[s], half of the span of the last estimate."""

    def restart(self) -> None:
        """Treat the next state as a first one."""
        self._states.clear()

    def update(self, stamp_ns: int, q: FloatArray) -> FloatArray | None:
        """Return the velocity (n,) at a state, None for a first state."""
        states = self._states
        if states and not 0 <= stamp_ns - states[-1][0] <= _PAUSE_NS:
            states.clear()
        if not states or stamp_ns > states[-1][0]:
            states.append((stamp_ns, q))
        while len(states) > 2 and stamp_ns - states[1][0] >= _SPAN_NS:
            states.popleft()
        before_ns, before = states[0]
        span_ns = states[-1][0] - before_ns
        if span_ns == 0:
            return None
        moved = states[-1][1] - before
        if self._any_wraps:
            moved = np.where(self._wraps, wrap_to_pi(moved), moved)
        span = span_ns / NANOSECONDS_PER_SECOND
        self.delay = 0.5 * span
        return np.asarray(moved / span)
