# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The supervisor of the command: decides when efforts are published and how they end.

    inactive -> waiting for the first state -> running <-> fault
    running or fault -> braking [-> stopping] -> inactive

The first effort is the command that holds the arm (`holding`). In a fault, the answer to each
valid state is `holding` with damping; the fault action begins when no valid states arrive any
more. The command resumes automatically once the cause has ended, except after a latched fault.
Before the command ends, the arm stops (braking). Then `end_action` decides: nothing follows the
effort that holds it, so that brakes or the watchdog of a drive act as after a crash, or the effort
is ramped to zero (stopping), for a receiver that keeps the last effort.
The rate limit applies to the efforts of a fault action and of a ramp as well, so that a ramp from
a large effort may take longer than the ramp time. No two consecutive efforts differ by more.
Times are those of a steady clock: a system clock that stops or jumps has no effect.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
import math

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.safety.effort_limiter import (
    EffortLimiter,
    EffortLimits,
    MotionEquation,
)
from robot_dynamics.control.safety.faults import (
    Fault,
    OVERSPEED,
    POSITION_LIMIT,
    RecurringFaults,
)
from robot_dynamics.control.safety.undamped_joints import UndampedJoints

FAULT_ACTIONS = ('hold_gravity_then_ramp', 'ramp_to_zero', 'stop_publishing')
END_ACTIONS = ('hold_then_silence', 'ramp_to_zero')


HoldingEffort = Callable[[], FloatArray]
"""Returns the command (n,) that holds the arm still; it is computed only when it is needed."""
Coasting = Callable[[FloatArray, float, float], FloatArray]
"""Returns the command (n,) for an arm without states, see `braking.coasting`."""
Brake = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Returns the command (n,) that holds and brakes the arm at (q, v), from the `holding` command."""
BRAKING_TIME = 2.5
"""[s] within which the arm stops before the command ends; then it ends in any case."""
LONGEST_PAUSE = 0.25
"""[s] without a state after which a stop before the end of the command has failed."""


class Mode(Enum):
    """The state of the supervisor."""

    INACTIVE = 'inactive'
    WAITING = 'waiting for the first state'
    RUNNING = 'running'
    FAULT = 'fault'
    BRAKING = 'stopping the arm'
    STOPPING = 'stopping'


@dataclass(frozen=True)
class SafetyOptions:
    """
    Times are in [s]. A position `fault_margin` [rad] or [m] past its limit is a fault.

    A velocity above `overspeed` times its limit is a fault; infinite disables this check.
    """

    state_timeout: float = 0.05
    fault_action: str = FAULT_ACTIONS[0]
    hold_time: float = 1.0
    ramp_time: float = 0.5
    fault_margin: float = 0.0087
    overspeed: float = 1.2
    end_action: str = END_ACTIONS[0]
    is_lock_step: bool = False
    """Whether a simulation waits for the answer to each state."""


class CommandSupervisor:
    """
    Passes the efforts of n joints on, or replaces them with the fault action; for one thread.

    The caller publishes the effort that a method returns; None means that nothing is published.
    """

    def __init__(
        self, joint_names: tuple[str, ...], limits: EffortLimits, options: SafetyOptions,
    ) -> None:
        self._names = joint_names
        self.limiter = EffortLimiter(limits)
        self.options = options
        self.mode = Mode.INACTIVE
        self.fault: Fault | None = None
        """The active fault, or the last one."""
        self.fault_count = 0
        self.failed_at = 0.0
        """Time [s] of the active fault, or of the last one."""
        self.holding: HoldingEffort = partial(np.zeros, len(joint_names))
        """The command that holds the arm at the last state."""
        self.last_state = self.last_output = 0.0
        """Times [s] of the last valid state and of the last effort."""
        self._ramped = self._braked = np.zeros(len(joint_names))
        self._since = self._brake_until = 0.0
        self._is_damped = self._acts = False
        self._good = 0
        self.recurring = RecurringFaults()
        self._undamped = UndampedJoints(len(joint_names))
        self.keeps_law = False
        """Whether the law continues in a fault, because a position limit is its only cause."""
        self.was_inside = False
        """Whether the arm has been inside its position limits since `activate`."""

    def set_options(self, limits: EffortLimits, options: SafetyOptions) -> None:
        """Apply limits and options, also those of another model of the same joints."""
        self.limiter.limits, self.options = limits, options

    def activate(self) -> None:
        """Wait for the first state; a latched fault stays."""
        if self.mode is Mode.INACTIVE:
            self.mode = Mode.FAULT if self.is_latched else Mode.WAITING
            self.was_inside = False

    def brake(self, now: float) -> bool:
        """
        Let the caller stop the arm, for at most BRAKING_TIME; return whether there is a command.

        `deactivate` ends the stop. Without a command, or without valid states, it begins at once.
        """
        if self.mode is Mode.BRAKING:
            return True
        is_supplied = now - self.last_state <= min(self.options.state_timeout, LONGEST_PAUSE)
        if self.mode not in (Mode.RUNNING, Mode.FAULT) or self.limiter.last is None or (
                not is_supplied):
            self.deactivate(now)
            return False
        self._is_damped, self.mode = self.mode is Mode.FAULT, Mode.BRAKING
        self._brake_until = now + BRAKING_TIME
        return True

    def resume(self) -> None:
        """Continue with the command instead of its end."""
        if self.mode is Mode.BRAKING:
            self.mode = Mode.FAULT if self._is_damped else Mode.RUNNING

    def deactivate(self, now: float) -> None:
        """End the command by the `end_action`: at once, or after the ramp; then be inactive."""
        if self.limiter.last is None or self.options.end_action == 'hold_then_silence':
            self.limiter.last, self.mode = None, Mode.INACTIVE
        elif self.mode is not Mode.STOPPING:
            self._begin(Mode.STOPPING, now)

    def reset(self) -> tuple[bool, str]:
        """
        Reset a latched fault whose cause has ended; return success and a message.

        A fault that is not latched ends automatically. If faults of the motion have recurred,
        references can be followed again.
        """
        fault, recurring = self.fault, self.recurring.fault
        if recurring is not None and not self.is_latched:
            self.recurring.reset()
            return True, f'reset {recurring.name}: {recurring.message}'
        if fault is None or not (self.is_latched or self.mode is Mode.FAULT):
            return False, 'there is no fault'
        if not fault.latched:
            return False, (
                f'{fault.name} persists: {fault.message}; it ends automatically after '
                f'{fault.recovery} valid joint states')
        if self.mode is Mode.FAULT and not self._good:
            return False, (
                f'{fault.name} persists: {fault.message}; no valid joint state has been received '
                'since')
        self.fault = replace(fault, latched=False)
        self._good = 0
        return True, f'reset {fault.name}: {fault.message}'

    def fail(self, now: float, fault: Fault) -> None:
        """Begin the fault action; a fault that is harder to leave replaces the active fault."""
        if self.mode not in (Mode.WAITING, Mode.RUNNING, Mode.FAULT, Mode.BRAKING):
            return
        self._good = 0
        is_new = not self._is_damped if self.mode is Mode.BRAKING else self.mode is not Mode.FAULT
        if self.mode is Mode.BRAKING:
            self._is_damped = True
        elif is_new:
            self._begin(Mode.FAULT, now)
        if is_new or self.fault is None or (
                (fault.latched, fault.recovery) > (self.fault.latched, self.fault.recovery)):
            self.fault, self.fault_count = fault, self.fault_count + 1
            self.failed_at = now

    def usual(
        self, now: float, q: FloatArray, v: FloatArray, command: FloatArray,
        holding: HoldingEffort, dt: float | None,
    ) -> FloatArray | None:
        """Return what `answer` returns if nothing but the rate limit matters, else None."""
        if self.mode is not Mode.RUNNING or now - self.last_state > self.options.state_timeout or (
                not self.limiter.limits.is_clear(q, v)):
            return None
        passed = dt if dt is not None else now - self.last_output
        self.last_state = self.last_output = now
        self.holding, self.was_inside = holding, True
        return self.limiter.rate_limited(command, passed)

    def answer(
        self, now: float, q: FloatArray, v: FloatArray, command: FloatArray,
        holding: HoldingEffort, dt: float | None = None, brake: Brake | None = None,
        fault: Fault | None = None, equation: MotionEquation | None = None,
        follows: bool = False,
    ) -> FloatArray | None:
        """
        Return the effort for a valid state; `holding` returns the command that holds the arm.

        `dt` [s] is the time since the previous state by the stamps, None if unknown. `fault` is a
        fault that was found with this state. `brake` returns `holding` with damping at (q, v), for
        a fault. `equation` is that of `EffortLimiter.apply`. `follows` is whether the command
        follows a reference.
        """
        beyond = self._beyond_a_limit(q)
        self.was_inside = self.was_inside or beyond is None
        other = self._overspeed(v) or fault
        cause = beyond or other
        if cause is None and self.mode is Mode.RUNNING and (
                now - self.last_state > self.options.state_timeout):
            cause = self._timeout()
        self.last_state, self.holding = now, holding
        if cause is not None:
            self.fail(now, cause)
        elif self.mode is Mode.WAITING:
            self.mode = Mode.RUNNING
        elif self.mode is Mode.FAULT and self._recovers():
            self.mode, dt = Mode.RUNNING, None  # efforts may have been published since that state
            self._undamped.restart()
        if self.mode is Mode.FAULT and self._acts and cause is not None:
            return self._action(now)
        is_damped = self.mode is Mode.FAULT or self.mode is Mode.BRAKING and self._is_damped
        self.keeps_law = is_damped and other is None and self.was_inside and (
            self.fault is not None and self.fault.name == POSITION_LIMIT)
        if self.keeps_law and follows and self.limiter.last is not None:
            passed = min(now - self.last_output, math.inf if dt is None else dt)
            effort = self.limiter.apply(command, holding, q, v, passed, equation)
            self._since, self._braked, self.last_output = (
                now + self.options.state_timeout, effort, now)
            return effort
        if is_damped:
            still = holding()
            braked = still if brake is None else brake(q, v, still)
            self._release(now, v, braked - still)
            return self._hold_on(now, braked, dt)
        if self.mode not in (Mode.RUNNING, Mode.BRAKING):
            return self._action(now)
        passed, self.last_output = now - self.last_output, now
        return self.limiter.apply(command, holding, q, v, passed if dt is None else dt, equation)

    def act(self, now: float) -> None:
        """
        Let the fault action run although states are valid, without its `hold_time`.

        A stop before the end of the command has failed then: the command ends.
        """
        if self.mode is Mode.BRAKING:
            self.deactivate(now)
        elif self.mode is Mode.FAULT and not self._acts:
            self._acts, self._since = True, now
            if self.options.fault_action == 'hold_gravity_then_ramp':
                self._since -= self.options.hold_time

    def repeat(self) -> FloatArray | None:
        """Return the effort of the last state again, or None if no efforts are published."""
        return self.limiter.last if self.mode in (Mode.RUNNING, Mode.BRAKING) else None

    def tick(self, now: float, coasting: Coasting | None = None) -> FloatArray | None:
        """
        Return the effort that is due without a state (fault action or ramp), or None.

        `coasting` brakes and holds an arm in a fault while no states arrive, by default `holding`.
        """
        timeout = self.options.state_timeout
        if coasting is not None and self.mode is Mode.FAULT and now > self._since and (
                now <= self._since + self.options.hold_time):
            self._ramped = coasting(self.holding(), now - self.last_state, timeout)
        is_overdue = now - self.last_state > timeout
        if is_overdue and self.mode is Mode.RUNNING:
            self.fail(now, self._timeout())
        elif self.mode is Mode.BRAKING and now > self.deadline:
            self.deactivate(now)
        return self._action(now)

    def _timeout(self) -> Fault:
        limit = self.options.state_timeout
        return Fault(
            'state_timeout', f'no valid joint state for {limit:g} s (state_timeout): check the '
            'driver, and the status `joint states` for dropped ones')

    def _hold_on(
        self, now: float, braked: FloatArray, dt: float | None,
    ) -> FloatArray | None:
        """Answer a valid state in a fault: hold the arm and postpone the fault action."""
        self._since, self._braked = now + self.options.state_timeout, braked
        self._ramped = self.holding()
        if self.limiter.last is None:  # no effort has begun, or the action has ended
            return None
        passed = now - self.last_output
        effort = self.limiter.rate_limited(braked, passed if dt is None else min(passed, dt))
        self.last_output = now
        return self._without_released(effort)

    def _release(self, now: float, v: FloatArray, damping: FloatArray) -> None:
        """Release a joint that its damping (n,) does not damp."""
        j = self._undamped.take(now, v, damping, self.limiter.limits.velocity)
        if j >= 0:
            self.fail(now, Fault(
                'wrong_drive', f'{self._names[j]!r} becomes faster ({v[j]:.3g}) against its '
                f'effort ({damping[j]:.3g}) and is released: the sign or the unit of its command, '
                'or its measured velocity, is wrong, or a load drives it', latched=True))

    def _without_released(self, effort: FloatArray) -> FloatArray:
        """Return an effort (n,) that is 0 at released joints, whatever the rate limit."""
        if self._undamped.released.any():
            effort = self.limiter.last = np.where(self._undamped.released, 0.0, effort)
        return effort

    @property
    def is_latched(self) -> bool:
        """Return whether a fault requires `reset`."""
        return self.fault is not None and self.fault.latched

    @property
    def standing_fault(self) -> Fault | None:
        """Return the fault because of which no reference can be followed, None if one can."""
        is_active = self.mode is Mode.FAULT or self.is_latched
        return self.fault if is_active else self.recurring.fault

    @property
    def is_commanding(self) -> bool:
        """Return whether efforts are published, in answer to states or without them."""
        return self.mode in (Mode.RUNNING, Mode.BRAKING) or self.acts_alone

    @property
    def acts_alone(self) -> bool:
        """Return whether `tick` returns efforts and must therefore be called often."""
        return self.mode in (Mode.FAULT, Mode.STOPPING) and self.limiter.last is not None

    @property
    def deadline(self) -> float:
        """Time at which `tick` is due while states arrive."""
        if self.mode is Mode.BRAKING:
            wait = min(self.options.state_timeout, LONGEST_PAUSE)
            return min(self.last_state + wait, self._brake_until)
        return self.last_state + self.options.state_timeout

    @property
    def time_to_stop(self) -> float:
        """Longest duration [s] of a stop and of a ramp from the last effort to zero."""
        last, rate = self.limiter.last, self.limiter.limits.rate
        return BRAKING_TIME + max(
            self.options.ramp_time, 0.0 if last is None else float(np.max(np.abs(last) / rate)))

    # ------------------------------------------------------------------ what ends an effort

    def _recovers(self) -> bool:
        """Count a good state; return whether it ends the fault."""
        self._good += 1
        return self.fault is None or not self.fault.latched and self._good >= self.fault.recovery

    def _begin(self, mode: Mode, now: float) -> None:
        self.mode, self._since, self._is_damped, self._acts = mode, now, False, False
        self._braked = self._ramped = self.holding()

    def _action(self, now: float) -> FloatArray | None:
        """Return the next effort of the fault action, or of the ramp of `deactivate`."""
        last = self.limiter.last
        if self.mode not in (Mode.FAULT, Mode.STOPPING) or last is None:
            return None
        action = self.options.fault_action if self.mode is Mode.FAULT else 'ramp_to_zero'
        passed = now - self._since
        if action == 'stop_publishing' and passed >= 0.0:
            self._finish()
            return None
        if action == 'hold_gravity_then_ramp' and passed >= 0.0:
            passed = max(passed - self.options.hold_time, 0.0)
        goal = self._braked if passed < 0.0 else self._fraction_left(passed) * self._ramped
        if action == 'ramp_to_zero' and passed >= 0.0:  # toward zero only
            goal = np.clip(goal, np.minimum(last, 0.0), np.maximum(last, 0.0))
        effort = self._without_released(
            self.limiter.rate_limited(goal, now - self.last_output))
        self.last_output = now
        if passed < self.options.ramp_time or effort.any():
            return effort
        self._finish()
        return np.zeros(len(self._names))

    def _fraction_left(self, passed: float) -> float:
        """Return the remaining fraction of an effort `passed` [s] after its ramp began."""
        if passed <= 0.0:
            return 1.0
        return 0.0 if passed >= self.options.ramp_time else 1.0 - passed / self.options.ramp_time

    def _finish(self) -> None:
        """Publish nothing; the next command begins with `holding`."""
        self.limiter.last = None
        if self.mode is Mode.STOPPING:
            self.mode = Mode.INACTIVE

    def _beyond_a_limit(self, q: FloatArray) -> Fault | None:
        limits, margin = self.limiter.limits, self.options.fault_margin
        past = np.maximum(q - limits.upper, limits.lower - q)
        j = int(np.argmax(past))
        if not past[j] > margin:
            return None
        return Fault(
            POSITION_LIMIT, f'position of {self._names[j]!r} is {q[j]:g}, {past[j]:g} past its '
            f'limit, expected at most {margin:g} (position_limit_tolerance)', recovery=5)

    def _overspeed(self, v: FloatArray) -> Fault | None:
        limit, factor = self.limiter.limits.velocity, self.options.overspeed
        ratio = np.abs(v) / limit
        j = int(np.argmax(ratio))
        if not ratio[j] > factor:
            return None
        return Fault(
            OVERSPEED, f'velocity of {self._names[j]!r} is {v[j]:g}, {ratio[j]:.3g} times its '
            f'limit, expected at most {factor:g} times (overspeed_factor)')
