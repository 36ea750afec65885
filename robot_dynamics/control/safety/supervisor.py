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
from dataclasses import replace
from enum import Enum
from functools import partial

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.safety.effort_limiter import (
    EffortLimiter,
    EffortLimits,
    MotionEquation,
)
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.fault_action import FaultAction, SafetyOptions
from robot_dynamics.control.safety.faults import (
    Fault,
    FROZEN_JOINT,
    POSITION_LIMIT,
    RecurringFaults,
)
from robot_dynamics.control.safety.motion_checks import beyond_a_limit, too_fast

HoldingEffort = Callable[[], FloatArray]
"""Returns the command (n,) that holds the arm still; it is computed only when it is needed."""
Coasting = Callable[[FloatArray, float, float], FloatArray]
"""Returns the command (n,) for an arm without states, see `braking.coasting`."""
Brake = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Returns the command (n,) that holds and brakes the arm at (q, v), from the `holding` command."""
BRAKING_TIME = 2.5
"""[s] within which the arm stops before the command ends; then it ends in any case."""
STOP_TIME, CALM = 0.5, 0.1
"""[s] after the loss of a joint in which the others stop, and the fraction of their velocity limit
up to which they are held then: above it the lost joint moves them."""


class Mode(Enum):
    """The state of the supervisor."""

    INACTIVE = 'inactive'
    WAITING = 'waiting for the first state'
    RUNNING = 'running'
    FAULT = 'fault'
    BRAKING = 'stopping the arm'
    STOPPING = 'stopping'


class CommandSupervisor:
    """
    Passes the efforts of n joints on, or replaces them with the fault action; for one thread.

    The caller publishes the effort that a method returns; None means that nothing is published.
    """

    def __init__(
        self, joint_names: tuple[str, ...], limits: EffortLimits, options: SafetyOptions,
    ) -> None:
        self.joint_names = joint_names
        self.limiter = EffortLimiter(limits)
        self.options = options
        self.mode = Mode.INACTIVE
        self.fault: Fault | None = None
        """The active fault, or the last one."""
        self.fault_count = 0
        self._damped_for = self._failed_at = 0.0
        """Time of the states in faults [s], now and when the fault began."""
        self.holding: HoldingEffort = partial(np.zeros, len(joint_names))
        """The command that holds the arm at the last state."""
        self.last_state = self.last_output = 0.0
        """Times [s] of the last valid state and of the last effort."""
        self._action = FaultAction(joint_names, self.limiter)
        self._brake_until, self._stop_has_fault, self._good = 0.0, False, 0
        self.recurring = RecurringFaults()
        self.keeps_law = False
        """Whether the law continues in a fault, because a position limit is its only cause."""
        self.was_inside = False
        """Whether the arm has been inside its position limits since `activate`."""
        self.damping = np.zeros(len(joint_names)), np.zeros(len(joint_names))
        """The effort (n,) that last damped the arm in a fault, within the limits and without."""

    def set_options(self, limits: EffortLimits, options: SafetyOptions) -> None:
        """Apply limits and options, also those of another model of the same joints."""
        self.limiter.limits, self.options = limits, options

    # ------------------------------------------------------------------ begin and end

    def activate(self) -> None:
        """Wait for the first state; a latched fault stays."""
        if self.mode is Mode.INACTIVE:
            self.mode = Mode.FAULT if self.is_latched else Mode.WAITING
            self.was_inside = False

    def end(self, now: float, ending: Ending) -> None:
        """
        Execute an ending, from wherever it was raised.

        A fault begins: a fault that is harder to leave replaces the active one. A command that is
        to be released lets the arm stop first (braking), for at most BRAKING_TIME, if valid states
        arrive. An arm that is released now by its fault runs the fault action although they do.
        """
        kind, fault = ending.kind, ending.fault
        if fault is not None:
            self._fail(now, fault)
        if kind is Kind.HOLD:
            return
        if fault is not None and self.mode is Mode.FAULT:
            self._action.force(now, self.options)
        elif kind is Kind.RELEASE and self.limiter.last is not None and self.mode in (
                Mode.RUNNING, Mode.FAULT) and (
                now - self.last_state <= self.options.state_timeout):
            self._stop_has_fault, self.mode = self.mode is Mode.FAULT, Mode.BRAKING
            self._brake_until = now + BRAKING_TIME
        elif kind is Kind.RELEASE_NOW or self.mode is not Mode.BRAKING:
            self._end_command(now)

    def _end_command(self, now: float) -> None:
        """End the command by the `end_action`: at once, or after the ramp; then be inactive."""
        if self.limiter.last is None or self.options.end_action == 'hold_then_silence':
            self.limiter.last, self.mode = None, Mode.INACTIVE
        elif self.mode is not Mode.STOPPING:
            self.mode = Mode.STOPPING
            self._action.begin(now, self.holding())

    def resume(self) -> None:
        """Continue with the command instead of its end."""
        if self.mode is Mode.BRAKING:
            self.mode = Mode.FAULT if self._stop_has_fault else Mode.RUNNING

    def _fail(self, now: float, fault: Fault) -> None:
        if self.mode not in (Mode.WAITING, Mode.RUNNING, Mode.FAULT, Mode.BRAKING):
            return
        self._good = 0
        self._action.reduce(fault)
        is_new = not self.is_damped
        if self.mode is Mode.BRAKING:
            self._stop_has_fault = True
        elif is_new:
            self.mode = Mode.FAULT
            self._action.begin(now, self.holding())
        if is_new or self.fault is None or fault.replaces(self.fault):
            self.fault, self.fault_count = fault, self.fault_count + 1
            self._failed_at = self._damped_for

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
        persists = f'{fault.name} persists: {fault.message}; '
        if not fault.latched:
            return False, (
                f'{persists}it ends automatically after {fault.recovery} valid joint states')
        if self.mode is Mode.FAULT and not self._good:
            return False, f'{persists}no valid joint state has been received since'
        self.fault = replace(fault, latched=False)
        self.recurring.reset()
        self._good = 0
        return True, f'reset {fault.name}: {fault.message}'

    # ------------------------------------------------------------------ efforts

    def usual(
        self, now: float, q: FloatArray, v: FloatArray, command: FloatArray,
        holding: HoldingEffort, dt: float | None,
    ) -> FloatArray | None:
        """Return what `answer` returns if nothing but the rate limit matters, else None."""
        if self.mode is not Mode.RUNNING or now - self.last_state > self.options.state_timeout or (
                not self.limiter.limits.clear.contains([*q.tolist(), *v.tolist()])):
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
        names, limits = self.joint_names, self.limiter.limits
        beyond = beyond_a_limit(names, limits, q)
        self.was_inside = self.was_inside or beyond is None
        other = too_fast(names, limits, v) or fault
        cause = beyond or other
        if cause is None and self.mode is Mode.RUNNING and (
                now - self.last_state > self.options.state_timeout):
            cause = self._timeout()
        self.last_state, self.holding = now, holding
        if cause is not None:
            self._fail(now, cause)
        elif self.mode is Mode.WAITING:
            self.mode = Mode.RUNNING
        elif self.mode is Mode.FAULT and self._recovers():
            self.mode, dt = Mode.RUNNING, None  # efforts may have been published since that state
            self._action.restart()
        if self.mode is Mode.FAULT and self._action.is_forced and cause is not None:
            return self._acting(now)
        self.keeps_law = self.is_damped and other is None and self.was_inside and (
            self.fault is not None and self.fault.name == POSITION_LIMIT)
        passed = now - self.last_output
        if self.is_damped:
            self._damped_for += dt or 0.0
            passed = passed if dt is None else min(passed, dt)
            still = holding()
            if self.keeps_law and follows and self.limiter.last is not None:
                held = self.limiter.apply(command, holding, q, v, passed, equation)
                effort: FloatArray | None = held
            else:
                effort, held = self._damped(now, q, v, still, passed, brake)
            self._action.postpone(now + self.options.state_timeout, held, still)
            if effort is not None:
                self.last_output = now
            return effort
        if self.mode not in (Mode.RUNNING, Mode.BRAKING):
            return self._acting(now)
        self.last_output = now
        return self.limiter.apply(command, holding, q, v, passed if dt is None else dt, equation)

    def _damped(
        self, now: float, q: FloatArray, v: FloatArray, still: FloatArray, passed: float,
        brake: Brake | None,
    ) -> tuple[FloatArray | None, FloatArray]:
        """Return the effort that holds the arm with damping in a fault, within limits and not."""
        braked = still if brake is None else brake(q, v, still)
        if self.fault is None or self.fault.name != FROZEN_JOINT:  # a lost joint drives others
            fault = self._action.release(
                self._damped_for, v, self.limiter.limits.direction * (braked - still))
            if fault is not None:
                self._fail(now, fault)
        if self.limiter.last is None:  # no effort has begun, or the action has ended
            return None, braked
        limited = self._action.limited(braked, passed)
        self.damping = limited - still, braked - still
        return limited, braked

    def repeat(self) -> FloatArray | None:
        """Return the effort of the last state again, or None if no efforts are published."""
        return self.limiter.last if self.mode in (Mode.RUNNING, Mode.BRAKING) else None

    def tick(self, now: float, coasting: Coasting | None = None) -> FloatArray | None:
        """
        Return the effort that is due without a state (fault action or ramp), or None.

        `coasting` brakes and holds an arm in a fault while no states arrive, by default `holding`.
        """
        timeout, passed = self.options.state_timeout, now - self.last_state
        if coasting is not None and self.mode is Mode.FAULT and (
                0.0 < now - self._action.since <= self.options.hold_time):
            self._action.ramped = coasting(self.holding(), passed, timeout)
        if passed > timeout and self.mode is Mode.RUNNING:
            self._fail(now, self._timeout())
        elif self.mode is Mode.BRAKING and now > self.deadline:
            self._end_command(now)
        return self._acting(now)

    def _acting(self, now: float) -> FloatArray | None:
        """Return the next effort of the fault action, or of the ramp at the end of a command."""
        if self.mode not in (Mode.FAULT, Mode.STOPPING):
            return None
        effort = self._action.effort(
            now, self.options.fault_action if self.mode is Mode.FAULT else 'ramp_to_zero',
            self.options, now - self.last_output)
        if effort is not None:
            self.last_output = now
        if self.mode is Mode.STOPPING and not self.acts_alone:
            self.mode = Mode.INACTIVE
        return effort

    def _timeout(self) -> Fault:
        limit = self.options.state_timeout
        return Fault(
            'state_timeout', f'no valid joint state for {limit:g} s (state_timeout): check the '
            'driver, and the status `joint states` for dropped ones')

    def _recovers(self) -> bool:
        """Count a good state; return whether it ends the fault."""
        self._good += 1
        return self.fault is None or not self.fault.latched and self._good >= self.fault.recovery

    # ------------------------------------------------------------------ what others ask

    @property
    def is_damped(self) -> bool:
        """Whether a fault is active: the arm is held with damping instead of by the law."""
        return self.mode is Mode.FAULT or self.mode is Mode.BRAKING and self._stop_has_fault

    def is_held_in_vain(self, v: FloatArray) -> bool:
        """Return whether joints move at v (n,) although they were damped for STOP_TIME."""
        return self.mode is Mode.FAULT and self._damped_for - self._failed_at > STOP_TIME and bool(
            (np.abs(v) > CALM * self.limiter.limits.velocity).any())

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
        overdue = self.last_state + self.options.state_timeout
        return min(overdue, self._brake_until) if self.mode is Mode.BRAKING else overdue

    @property
    def time_to_stop(self) -> float:
        """Longest duration [s] of a stop and of a ramp from the last effort to zero."""
        last, rate = self.limiter.last, self.limiter.limits.rate
        return BRAKING_TIME + max(
            self.options.ramp_time, 0.0 if last is None else float(np.max(np.abs(last) / rate)))
