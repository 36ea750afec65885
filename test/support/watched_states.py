# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A check of measured states of two joints, with times in seconds."""

from typing import Any

import numpy as np
import pytest
from robot_dynamics.monitoring.state_plausibility import (
    ImplausibleStateError,
    StatePlausibility,
    StateVerdict,
)

NAMES = ('shoulder', 'wrist')  # the wrist is continuous
LIMIT = np.array([2.0, 3.0])
SECOND = 1_000_000_000
NOW = 1_790_000_000 * SECOND
MAX_AGE = 0.2
Q = np.array([0.3, -0.4])
PERIOD = 0.002
CONFIRMATIONS = 5
"""States that must follow one that does not follow the old ones."""


def nanoseconds(seconds: float) -> int:
    return round(seconds * SECOND)


class Watched:
    """A check with times in seconds after NOW; `crowd` declares several publishers."""

    def __init__(
        self, max_age: float = MAX_AGE, limit: np.ndarray = LIMIT, offset: float = 0.0,
        crowd: bool = False,
    ) -> None:
        self.watch = StatePlausibility(NAMES, limit, max_age, np.array([False, True]))
        self.offset, self.crowd = offset, crowd

    def judge(self, stamp: float, clock: float | None = None, q: Any = Q) -> StateVerdict:
        """
        Check a state that arrives at `clock`, which by default is its stamp.

        The stamp is the time of the state, and is not part of the result.
        """
        stamp_ns = NOW + nanoseconds(stamp) + nanoseconds(self.offset)
        judgement = self.watch.judge(
            stamp_ns, NOW + nanoseconds(stamp if clock is None else clock),
            np.array(q), lambda: self.crowd)
        assert judgement.stamp == stamp_ns
        return judgement._replace(stamp=0)

    def refusal(self, *args: Any, **more: Any) -> ImplausibleStateError:
        """Return the rejection of a state; fail if the state is accepted."""
        with pytest.raises(ImplausibleStateError) as caught:
            self.judge(*args, **more)
        return caught.value

    def confirmed(self, stamp: float, clock: float | None = None, q: Any = Q) -> StateVerdict:
        """Return the verdict on the last of six states, of which the first five are rejected."""
        clock = stamp if clock is None else clock
        for k in range(CONFIRMATIONS):
            assert not self.refusal(stamp + k * PERIOD, clock + k * PERIOD, q).is_conflict
        return self.judge(stamp + CONFIRMATIONS * PERIOD, clock + CONFIRMATIONS * PERIOD, q)


def started(**options: Any) -> Watched:
    """Return a check that has accepted a state at 0 s."""
    one = Watched(**options)
    assert one.judge(0.0) == StateVerdict(True, None, 'first state')
    return one
