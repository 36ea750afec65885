# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The efforts while no law acts: in a fault, and in a ramp to zero.

Each valid state is answered with `hold`: the arm is held with damping, joints that their damping
does not damp are released, and the fault action is postponed. Without states, `effort` is first
the last held one, then that of the fault action.
"""

from dataclasses import dataclass

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.safety.effort_limiter import EffortLimiter
from robot_dynamics.control.safety.faults import Fault, STATE_TIMEOUT
from robot_dynamics.control.safety.undamped_joints import UndampedJoints

FAULT_ACTIONS = ('hold_gravity_then_ramp', 'ramp_to_zero', 'stop_publishing')
END_ACTIONS = ('hold_then_silence', 'ramp_to_zero')


@dataclass(frozen=True)
class SafetyOptions:
    """Times are in [s]."""

    state_timeout: float = STATE_TIMEOUT
    fault_action: str = FAULT_ACTIONS[0]
    hold_time: float = 1.0
    ramp_time: float = 0.5
    end_action: str = END_ACTIONS[0]
    is_lock_step: bool = False
    """Whether a simulation waits for the answer to each state."""
    requires_velocities: bool = False
    """Whether a state without measured velocities is dropped."""


class FaultAction:
    """The efforts (n,) of one fault after the other; times are those of a steady clock [s]."""

    def __init__(self, joint_names: tuple[str, ...], limiter: EffortLimiter) -> None:
        self._names, self._limiter = joint_names, limiter
        self._held = self.ramped = np.zeros(len(joint_names))
        """The efforts until `since`, and from then on, which end with a ramp."""
        self.since = 0.0
        self.is_forced = False
        """Whether the action runs although states are valid."""
        self.undamped = UndampedJoints(len(joint_names))
        self._share = np.ones(len(joint_names))
        """Share of the effort (n,) that is published."""

    def restart(self) -> None:
        """Let all joints have all of their efforts again."""
        self.undamped.restart()
        self._share = np.ones_like(self._share)

    def reduce(self, fault: Fault) -> None:
        """Reduce the efforts of joints, or release them, as a fault demands."""
        before = self._share.copy()
        for j, share in fault.shares:
            if share > 0.0:
                self._share[j] = min(share, self._share[j])
            else:
                self.undamped.released[j] = True
        if self._limiter.last is not None:
            self._limiter.last = self._limiter.last * self._share / before

    def begin(self, now: float, holding: FloatArray) -> None:
        """Begin with the effort that holds the arm."""
        self.is_forced = False
        self.postpone(now, holding, holding)

    def force(self, now: float, options: SafetyOptions) -> None:
        """Run the action although states are valid, without its `hold_time`."""
        if not self.is_forced:
            self.is_forced, self.since = True, now
            if options.fault_action == 'hold_gravity_then_ramp':
                self.since -= options.hold_time

    def postpone(self, until: float, held: FloatArray, ramped: FloatArray) -> None:
        """Return `held` until a time [s]; the action then begins with `ramped`."""
        self.since, self._held, self.ramped = until, held, ramped

    def release(self, time: float, v: FloatArray, damping: FloatArray) -> Fault | None:
        """
        Return the fault of a joint that its damping (n,) does not damp at v (n,), or None.

        `time` is that of the states [s]: a simulation may be slower than the clock.
        """
        j = self.undamped.take(time, v, damping, self._limiter.limits.velocity)
        return None if j < 0 else Fault(
            'wrong_drive', f'{self._names[j]!r} becomes faster ({v[j]:.3g}) against its '
            f'effort ({damping[j]:.3g}) and is released: the sign or the unit of its command, '
            'or its measured velocity, is wrong, or a load drives it', latched=True)

    def limited(self, effort: FloatArray, passed: float) -> FloatArray:
        """Return an effort (n,) within the rate limit; 0 at released joints, whatever it is."""
        effort = self._limiter.rate_limited(self._share * effort, passed)
        if self.undamped.released.any():
            effort = self._limiter.last = np.where(self.undamped.released, 0.0, effort)
        return effort

    def effort(
        self, now: float, action: str, options: SafetyOptions, passed: float,
    ) -> FloatArray | None:
        """
        Return the next effort, None if nothing is published any more.

        `passed` [s] is the time since the last effort. The last effort of a ramp is 0.
        """
        last, since = self._limiter.last, now - self.since
        if last is None or action == 'stop_publishing' and since >= 0.0:
            self._limiter.last = None
            return None
        if action == 'hold_gravity_then_ramp' and since >= 0.0:
            since = max(since - options.hold_time, 0.0)
        left = 1.0 if since <= 0.0 else 0.0 if since >= options.ramp_time else (
            1.0 - since / options.ramp_time)
        goal = self._held if since < 0.0 else left * self.ramped
        if action == 'ramp_to_zero' and since >= 0.0:  # toward zero only
            goal = np.clip(goal, np.minimum(last, 0.0), np.maximum(last, 0.0))
        effort = self.limited(goal, passed)
        if since < options.ramp_time or effort.any():
            return effort
        self._limiter.last = None
        return np.zeros(len(self._names))
