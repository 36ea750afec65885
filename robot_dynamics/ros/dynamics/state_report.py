# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The statuses of the joint states on /diagnostics: dropped messages, and timing."""

from collections.abc import Callable
import time

from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.ros.diagnostics import ERROR, OK, Status, WARN
from robot_dynamics.ros.dynamics.control_counters import ControlCounters


class StateReport:
    """Reports whether joint states arrive, how regularly, and why some were dropped."""

    def __init__(
        self, counters: ControlCounters, loop: Callable[[], ControlLoop | None],
    ) -> None:
        """`loop` returns the control loop, or None without a model."""
        self._counters, self._loop = counters, loop
        self._dropped_before = 0
        self._dropped_at = -float('inf')

    def statuses(self, state_timeout: float) -> list[Status]:
        """
        Return the present statuses; a drop is reported for 1 s.

        An interval of more than half of `state_timeout` [s] is a warning.
        """
        now = time.monotonic()
        arrivals, events = self._counters.arrivals, self._counters.timing
        for _ in range(len(arrivals)):
            events.happened(arrivals.popleft())
        timing = events.look(now)
        return [self._arrival(now, timing.rate), self._timing(state_timeout)]

    def _arrival(self, now: float, rate: float) -> Status:
        counters = self._counters
        # Atomic copies: the control path counts in another thread.
        loop = self._loop()
        drops, restarts = dict(counters.dropped), {} if loop is None else dict(loop.restarts)
        dropped = sum(drops.values()) - drops.get('other joints', 0)
        if dropped > self._dropped_before:
            self._dropped_before, self._dropped_at = dropped, now
        level, words = OK, 'arriving'
        if now - self._dropped_at < 1.0:
            level, words = ERROR, counters.last_drop
        elif rate == 0.0:
            level, words = WARN, 'none arrive'
            if counters.missing:
                level, words = ERROR, (
                    f'incomplete: no samples of {list(counters.missing)} that are new enough '
                    '(joint_sample_max_age)')
        if counters.replay.text:
            level, words = max(level, WARN), f'{words}; {counters.replay.text}'
        if loop is not None and not loop.consistency.is_consistent:
            level, words = max(level, WARN), f'{words}; {loop.consistency.reason}'
        return Status('joint states', level, words, {
            'answered': 0 if loop is None else loop.states,
            'not new (stamp repeated)': counters.repeated,
            'parts of a state': counters.incomplete,
            'velocities': counters.velocities,
            **{f'dropped: {reason}': count for reason, count in sorted(drops.items())},
            **{f'restarted: {reason}': count for reason, count in sorted(restarts.items())}})

    def _timing(self, state_timeout: float) -> Status:
        timing, late = self._counters.timing.timing, self._counters.timing.late
        level, words = OK, 'regular'
        if timing.longest > 0.5 * state_timeout:
            level, words = WARN, 'an interval of more than half of state_timeout'
        return Status('timing', level, words, {
            'rate [Hz]': f'{timing.rate:.1f}',
            'jitter, standard deviation [ms]': f'{1e3 * timing.jitter:.3f}',
            'longest interval [ms]': f'{1e3 * timing.longest:.3f}',
            'late states': late})
