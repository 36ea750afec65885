# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The joint states of `dynamics` in log and diagnostics: counters, reasons, rate and jitter."""

from collections import Counter, deque
from collections.abc import Callable
import math
import time
from typing import NamedTuple

import numpy as np
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.ros.dynamics.silence import no_states, Silence
from robot_dynamics.ros.middleware.diagnostics import ERROR, OK, Status, WARN
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks

MOST_ARRIVALS = 5000
"""Number of stored arrivals: those of more than a second at 1 kHz."""
WINDOW = 1.0
"""[s] of arrivals that are evaluated together."""
COMPLETION_TIME = 1.0
"""[s] without a complete state after which the missing joints are logged."""
REPLAY = ('play a recording with `ros2 bag play --clock`, and start this node with '
          '`use_sim_time:=true`')
REMEDIES = {
    'too old': f'synchronise the clocks of driver and computer, or set `state_max_age`; {REPLAY}',
    'from the future': 'synchronise the clocks of driver and computer, or set `state_max_age`',
    'stamp went back': 'stop all but one publisher of the joints of this arm',
    'jump': 'stop all but one publisher of the joints of this arm; publish rad, not degrees',
    'stamp jumped ahead': 'stop all but one publisher of the joints of this arm',
    'unreadable': 'expected a sensor_msgs/msg/JointState: check the driver',
}
"""Remedy for dropped joint states, by reason."""


class Timing(NamedTuple):
    """
    The intervals between the states of one window.

    `rate` [Hz]; `jitter` [s], the standard deviation of the intervals; `longest` [s].
    """

    rate: float = 0.0
    jitter: float = 0.0
    longest: float = 0.0


class ArrivalTiming:
    """Evaluates windows of at least a second of the arrivals of states; for one thread."""

    def __init__(self, now: float) -> None:
        self._began, self._usual = now, math.inf
        self._last: list[float] = []
        self.late = 0
        """Intervals closer to two mean intervals of the window before than to one."""
        self.timing = Timing()
        """The last complete window."""

    def take(self, arrivals: deque[float], now: float) -> Timing:
        """Return the last complete window, which may end now and then takes its arrivals."""
        passed = now - self._began
        if passed >= WINDOW:
            times = self._last + [arrivals.popleft() for _ in range(len(arrivals))]
            between = np.diff(times)
            self.late += int(np.count_nonzero(np.rint(between / self._usual) > 1.0))
            self.timing, self._usual = Timing(), math.inf
            if len(between):
                self.timing = Timing(
                    len(between) / passed, float(between.std()), float(between.max()))
                self._usual = float(between.mean())
            self._began, self._last = now, times[-1:]
        return self.timing


class StateLog:
    """
    Counts the joint states; logs and reports why some were dropped, and how they arrive.

    The control path counts; the thread of the diagnostics calls `statuses`.
    """

    def __init__(
        self, node: GuardedCallbacks, loop: Callable[[], ControlLoop | None],
    ) -> None:
        """`loop` returns the control loop, or None without a model."""
        self._node, self._loop = node, loop
        self.repeated = 0
        self._incomplete = 0
        """Messages with some of the joints that do not complete a state."""
        self._part_at = -math.inf
        self._missing: tuple[str, ...] = ()
        """Joints without a sample that is new enough, at the last message with some of them."""
        self.answered_at = -math.inf
        """Time [s] of the last answer on the steady clock."""
        self.following = False
        self.arrivals = deque[float](maxlen=MOST_ARRIVALS)
        """Times [s] of new states on the steady clock that are not evaluated yet."""
        self.dropped = Counter[str]()
        self.other_joints: list[str] | None = None
        """The joints of the last message with none of the arm, None without one."""
        self._silence = Silence(
            lambda words: node.get_logger().warning(f'No joint states: {words}'))
        self.last_drop = self._refused = ''
        self._timing = ArrivalTiming(time.monotonic())
        self._dropped_before, self._dropped_at = 0, -math.inf

    def warn(self, kind: str, words: str) -> None:
        """Log a warning, at most one of a kind in LOG_PERIOD."""
        self._node.log_rarely(f'joint states: {kind}', self._node.get_logger().warning, words)

    def count(self, reason: str) -> None:
        """Count a dropped state without logging it."""
        self.dropped[reason] += 1
        self.last_drop = f'Dropped a joint state: {reason}'

    def drop(self, reason: str, words: str) -> None:
        """Count and log a dropped state, with the remedy."""
        remedy = REMEDIES.get(reason)
        self.dropped[reason] += 1
        self.last_drop = f'Dropped a joint state: {words}' + (f'; {remedy}' if remedy else '')
        self.warn('dropped', self.last_drop)

    def clock(self, offset: float) -> None:
        """Log the offset [s] of another clock than that of this computer."""
        self._node.get_logger().warning(_other_clock(offset))

    def part(self, missing: list[str], used_at: float) -> None:
        """Count a message that completes no state; log it if none was complete for long."""
        self._incomplete += 1
        self._missing, self._part_at = tuple(missing), time.monotonic()
        if self._part_at - max(used_at, self.answered_at) > COMPLETION_TIME:
            self.warn(
                'incomplete',
                f'No joint state is complete: there are no new samples of {missing}. Publish '
                'them on joint_states, or set the parameter joints to the joints in use.')

    def refuse_embedded(self, words: str) -> None:
        """Count a state of another robot than the embedded arm; log the first one."""
        self.dropped['not the embedded arm'] += 1
        self.last_drop = f'Nothing is published: {words}'
        if words != self._refused:
            self._refused = words
            self._node.get_logger().error(self.last_drop)

    def statuses(self, state_timeout: float) -> list[Status]:
        """
        Return the present statuses; a drop is reported for 1 s.

        An interval of more than half of `state_timeout` [s] is a warning.
        """
        now = time.monotonic()
        timing = self._timing.take(self.arrivals, now)
        return [self._arrival(now, timing.rate), self._regularity(timing, state_timeout)]

    def _arrival(self, now: float, rate: float) -> Status:
        # Atomic copies: the control path counts in another thread.
        loop = self._loop()
        drops, restarts = dict(self.dropped), {} if loop is None else dict(loop.restarts)
        dropped = sum(drops.values()) - drops.get('other joints', 0)
        if dropped > self._dropped_before:
            self._dropped_before, self._dropped_at = dropped, now
        level, words, silence = OK, 'arriving', ''
        if now - self._dropped_at < 1.0:
            level, words = ERROR, self.last_drop
        elif rate == 0.0 and now - self._part_at < 2.0 * WINDOW:
            level, words = ERROR, (
                f'incomplete: no samples of {list(self._missing)} that are at most half '
                'a period old')
        elif rate == 0.0:
            expected = () if loop is None else loop.controller.arm.joint_names
            if now - self.answered_at > WINDOW:
                silence = no_states(self._node, expected, self.other_joints)
            level, words = WARN, 'none arrive yet'
        words = self._silence.reason(silence) or words
        offset = 0.0 if loop is None else loop.gate.plausibility.clock_offset
        if offset > 0.0:
            level, words = max(level, WARN), f'{words}; {_other_clock(offset)}'
        wrong = [] if loop is None else [name for name, is_doubtful in zip(
            loop.controller.arm.joint_names, loop.gate.doubtful) if is_doubtful]
        if wrong:
            level, words = max(level, WARN), (
                f'{words}; the velocity of {wrong} contradicts the position and is not used: '
                'check its sign and its unit, and that positions are in rad, not in degrees')
        return Status('joint states', level, words, {
            'answered': 0 if loop is None else loop.states,
            'not new (stamp repeated)': self.repeated,
            'parts of a state': self._incomplete,
            **{f'dropped: {reason}': count for reason, count in sorted(drops.items())},
            **{f'restarted: {reason}': count for reason, count in sorted(restarts.items())}})

    def _regularity(self, timing: Timing, state_timeout: float) -> Status:
        level, words = OK, 'regular'
        if timing.longest > 0.5 * state_timeout:
            level, words = WARN, 'an interval of more than half of state_timeout'
        return Status('timing', level, words, {
            'rate [Hz]': f'{timing.rate:.1f}',
            'jitter, standard deviation [ms]': f'{1e3 * timing.jitter:.3f}',
            'longest interval [ms]': f'{1e3 * timing.longest:.3f}',
            'late states': self._timing.late})


def _other_clock(offset: float) -> str:
    return (f'joint states are {offset:.1f} s old by the clock of this computer: synchronise the '
            f'clocks of driver and computer; {REPLAY}')
