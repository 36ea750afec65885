# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Counters of the control path of `dynamics` for the diagnostics."""

from collections import Counter, deque
from dataclasses import dataclass, field
import math
import time

from robot_dynamics.monitoring.event_timing import EventTiming
from robot_dynamics.monitoring.replay_hint import ReplayHint

MOST_ARRIVALS = 5000
"""Number of stored arrivals: those of more than a second at 1 kHz."""


@dataclass
class ControlCounters:
    """Counters of the control path since the start; the diagnostics read them."""

    repeated: int = 0
    incomplete: int = 0
    """Messages with some of the joints that do not complete a state."""
    missing: tuple[str, ...] = ()
    """Joints without a sample that is new enough, at the last message with some of the joints."""
    velocities: str = 'measured'
    answered_at: float = -math.inf
    """Time [s] of the last answer on the steady clock."""
    arrivals: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_ARRIVALS))
    """Times [s] of new states on the steady clock, which `timing` has not evaluated yet."""
    timing: EventTiming = field(default_factory=lambda: EventTiming(time.monotonic()))
    dropped: Counter[str] = field(default_factory=Counter)
    last_drop: str = ''
    replay: ReplayHint = field(default_factory=ReplayHint)
    following: bool = False
