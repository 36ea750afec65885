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
When efforts go out, and how they end: the supervisor of the command.

    inactive -> waiting for the first state -> running <-> fault
    running or fault -> stopping -> inactive

The first effort to an arm is what holds it; after a fault the fault action runs its course, and
once states are good again the command comes back by itself, except after a fault that is latched.
Times are of a steady clock, so that a clock that stops or jumps changes nothing.
"""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from robot_dynamics.effort_guard import EffortGuard, GuardedEffort, GuardLimits
from robot_dynamics.validation import FloatArray

FAULT_ACTIONS = ('hold_gravity_then_ramp', 'ramp_to_zero', 'stop_publishing')

class Mode(Enum):
    """What the supervisor does."""

    INACTIVE = 'inactive'
    WAITING = 'waiting for the first state'
    RUNNING = 'running'
    FAULT = 'fault'
    STOPPING = 'stopping'


@dataclass(frozen=True)
class SafetyOptions:
    """Times [s]; `fault_margin` [rad] or [m] past a position limit that is a fault."""

    state_timeout: float = 0.05
    fault_action: str = FAULT_ACTIONS[0]
    hold_time: float = 1.0
    ramp_time: float = 0.5
    fault_margin: float = 0.0087


@dataclass(frozen=True)
class Fault:
    """
    What went wrong: a name for machines, words for people, and whether it needs a reset.

    Otherwise it is over after `recovery` good states in a row.
    """

    name: str
    words: str
    latched: bool = False
    recovery: int = 1


class CommandSupervisor:
    """
    Lets efforts of n joints out, or what the fault action says; not for two threads at a time.

    What a method returns is to be published, None for nothing.
    """

    def __init__(
        self, joint_names: tuple[str, ...], limits: GuardLimits, options: SafetyOptions,
    ) -> None:
        self._names = joint_names
        self._guard = EffortGuard(limits)
        self.options = options
        self.mode = Mode.INACTIVE
        self.fault: Fault | None = None
        """The fault in force, or the last one."""
        self.fault_count = 0
        self.guarded: GuardedEffort | None = None
        """What the limits did to the last effort, while running."""
        self._hold = np.zeros(len(joint_names))
        self._last_state = self._last_output = self._since = 0.0
        self._from: FloatArray | None = None
        self._good = 0

    def set_options(self, limits: GuardLimits, options: SafetyOptions) -> None:
        """Take over limits and options."""
        self._guard.limits, self.options = limits, options

    def activate(self) -> None:
        """Wait for the first state; a latched fault stays."""
        if self.mode is Mode.INACTIVE:
            self._guard.last = None
            latched = self.fault is not None and self.fault.latched
            self.mode = Mode.FAULT if latched else Mode.WAITING
            self._from = None

    def go_on_from(self, other: 'CommandSupervisor') -> None:
        """Let no command jump where another model of the same joints takes over."""
        if other._names == self._names:
            self._guard.last, self._last_output = other._guard.last, other._last_output

    def deactivate(self, now: float) -> None:
        """Ramp the effort out over the ramp time, then be inactive."""
        if self._guard.last is None:
            self.mode = Mode.INACTIVE
        elif self.mode is not Mode.STOPPING:
            self._begin(Mode.STOPPING, now)

    def reset(self) -> str:
        """Forget a latched fault; return in words what was reset."""
        if self.fault is None or self.mode is not Mode.FAULT:
            return 'there is no fault'
        self.fault = replace(self.fault, latched=False)
        self._good = 0
        return f'reset {self.fault.name}: {self.fault.words}'

    def fail(self, now: float, fault: Fault) -> None:
        """Begin the fault action."""
        if self.mode in (Mode.RUNNING, Mode.WAITING):
            self.fault, self.fault_count = fault, self.fault_count + 1
            self._good = 0
            self._begin(Mode.FAULT, now)
        elif self.mode is Mode.FAULT and fault.latched and self.fault is not None and (
                not self.fault.latched):
            self.fault, self.fault_count = fault, self.fault_count + 1

    def answer(
        self, now: float, q: FloatArray, v: FloatArray | None, command: FloatArray,
        hold: FloatArray, dt: float | None = None,
    ) -> FloatArray | None:
        """
        Return the effort that answers a good state; `hold` (n,) is what holds the arm.

        The state is dt [s] after the one before by their stamps; None where these do not tell.
        """
        self._last_state, self._hold = now, hold
        beyond = self._beyond_a_limit(q)
        if beyond is not None:
            self.fail(now, beyond)
        if self.mode is Mode.FAULT:
            self._good = 0 if beyond is not None else self._good + 1
            if self.fault is not None and not self.fault.latched and (
                    self._good >= self.fault.recovery):
                self.mode = Mode.RUNNING
        if self.mode is Mode.WAITING:
            self.mode = Mode.RUNNING
        if self.mode is not Mode.RUNNING:
            return self._action(now)
        self.guarded = self._guard.apply(
            command, hold, q, v, now - self._last_output if dt is None else dt)
        self._last_output = now
        return self.guarded.effort

    def repeat(self) -> FloatArray | None:
        """Return the effort of the last state once more, where efforts go out."""
        return self._guard.last if self.mode is Mode.RUNNING else None

    def tick(self, now: float) -> FloatArray | None:
        """Return what is due without a state: nothing, or the next effort of a fault action."""
        if self.mode is Mode.RUNNING and now - self._last_state > self.options.state_timeout:
            self.fail(now, Fault(
                'state_timeout', f'no valid joint state for {self.options.state_timeout:g} s '
                '(state_timeout)'))
        return self._action(now)

    @property
    def is_commanding(self) -> bool:
        """Tell whether efforts go out, in answer to states or alone."""
        return self.mode is Mode.RUNNING or self.acts_alone

    @property
    def acts_alone(self) -> bool:
        """Tell whether `tick` has efforts to give, so that it is due often."""
        return self.mode in (Mode.FAULT, Mode.STOPPING) and self._from is not None

    @property
    def deadline(self) -> float:
        """When `tick` is due while states arrive."""
        return self._last_state + self.options.state_timeout

    # ------------------------------------------------------------------ what ends an effort

    def _begin(self, mode: Mode, now: float) -> None:
        self.mode, self._since, self._from = mode, now, self._guard.last

    def _action(self, now: float) -> FloatArray | None:
        """Return the next effort of the fault action, or of the ramp of `deactivate`."""
        if self.mode not in (Mode.FAULT, Mode.STOPPING) or self._from is None:
            return None
        passed = now - self._since
        if self.mode is Mode.FAULT and self.options.fault_action == 'stop_publishing':
            self._finish()
            return None
        if self.mode is Mode.FAULT and self.options.fault_action == 'hold_gravity_then_ramp':
            if passed < self.options.hold_time:
                step = self._guard.limits.rate * passed
                effort = np.clip(self._hold, self._from - step, self._from + step)
                return self._out(effort, now)
            if self._guard.last is not None and passed - self.options.hold_time < (
                    self.options.ramp_time):
                share = 1.0 - (passed - self.options.hold_time) / self.options.ramp_time
                return self._out(share * self._hold, now)
        elif passed < self.options.ramp_time:
            return self._out((1.0 - passed / self.options.ramp_time) * self._from, now)
        self._out(np.zeros(len(self._names)), now)
        self._finish()
        return np.zeros(len(self._names))

    def _out(self, effort: FloatArray, now: float) -> FloatArray:
        self._guard.last, self._last_output = effort, now
        return effort

    def _finish(self) -> None:
        """Be silent; whatever comes next begins with what holds the arm."""
        self._from = self._guard.last = None
        if self.mode is Mode.STOPPING:
            self.mode = Mode.INACTIVE

    def _beyond_a_limit(self, q: FloatArray) -> Fault | None:
        limits, margin = self._guard.limits, self.options.fault_margin
        past = np.maximum(q - limits.upper, limits.lower - q)
        j = int(np.argmax(past))
        if not past[j] > margin:
            return None
        return Fault(
            'position_limit', f'position of {self._names[j]!r} is {q[j]:g}, {past[j]:g} past its '
            f'limit, expected at most {margin:g} (position_fault_margin)', recovery=5)
