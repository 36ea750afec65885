# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Whether an arm has stopped and is held, so that its command can end."""

import numpy as np
from robot_dynamics.arrays import FloatArray

AT_REST, SLOW = 0.002, 0.03
"""[rad] or [m] that no joint moves in REST_TIME when it has stopped, and its velocity then."""
REST_TIME_NS = 100_000_000
"""[ns]"""


class RestCheck:
    """Follows the states of one arm whose stop has ended."""

    def __init__(self) -> None:
        self._first: tuple[int, FloatArray] | None = None

    def is_reached(self, stamp_ns: int, q: FloatArray, v: FloatArray, has_stopped: bool) -> bool:
        """
        Return whether the arm was held for REST_TIME at (q, v), (n,) each.

        `has_stopped` is whether its reference has ended.
        """
        if self._first is None or not has_stopped or not (
                0 <= stamp_ns - self._first[0] <= 2 * REST_TIME_NS) or not bool(
                (np.abs(q - self._first[1]) <= AT_REST).all()):
            self._first = stamp_ns, q
            return False
        return stamp_ns - self._first[0] >= REST_TIME_NS and bool((np.abs(v) <= SLOW).all())

    def restart(self) -> None:
        """Begin with the next state."""
        self._first = None
