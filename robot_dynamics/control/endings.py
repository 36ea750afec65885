# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The execution of endings: of the reference by the controller, of the command by the supervisor.

The law stops the arm along its reference; in a fault, and if the states restart, it stops the arm
from the next measured state. Before the command ends, the arm has stopped and was held.
"""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.gains.oscillation import REST_SPEED
from robot_dynamics.control.goal_execution import GoalExecution
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.supervisor import CommandSupervisor, Mode

REST_TIME_NS = 100_000_000
"""[ns] for which no joint moves faster than REST_SPEED when the arm has stopped."""


class Endings:
    """The endings of one arm; `ControlLoop` calls with its lock held. Times are steady [s]."""

    def __init__(
        self, controller: Controller, goals: GoalExecution, supervisor: CommandSupervisor,
    ) -> None:
        self._controller, self._goals, self._supervisor = controller, goals, supervisor
        self._fault_count = supervisor.fault_count
        self._rest: tuple[int, FloatArray] | None = None
        self.awaiting: ControllerOptions | None = None
        """Options that are applied when the command has ended, or None."""

    def end(self, now: float, ending: Ending) -> str:
        """Execute an ending, from wherever it was raised; return a report of the stop."""
        supervisor = self._supervisor
        was_braking = supervisor.mode is Mode.BRAKING
        supervisor.end(now, ending)
        if ending.fault is not None:
            self.follow(now)
            return ''
        self._goals.end(ending)
        if ending.kind is Kind.HOLD or supervisor.mode is Mode.BRAKING and not was_braking:
            self._rest = None
            return self._stop()
        return ''

    def restart(self, now: float, reason: str) -> None:
        """End the reference: the next states continue from another place or time."""
        controller, ending = self._controller, Ending(
            Kind.HOLD, f'joint states restarted: {reason}')
        controller.state = None  # the next one need not be consistent with the last one
        if controller.trajectory is None:
            self._goals.end(ending)
        else:
            self.end(now, ending)

    def _stop(self) -> str:
        """Stop along the reference, or from the next measured state; return a report."""
        supervisor, controller = self._supervisor, self._controller
        restarts = controller.state is None and controller.trajectory is not None
        if not restarts and (not supervisor.is_damped or supervisor.keeps_law):
            return controller.stop()
        controller.stop_from_state()
        return 'stopping from the next state, then holding the position'

    def follow(self, now: float) -> None:
        """End the reference if a fault has begun; apply the options that await the end."""
        supervisor, controller, fault = self._supervisor, self._controller, self._supervisor.fault
        mode = supervisor.mode
        if supervisor.fault_count != self._fault_count and fault is not None:
            self._fault_count = supervisor.fault_count
            was_followed = controller.trajectory is not None
            if was_followed:
                fault = supervisor.recurring.count(fault, now)
                if supervisor.recurring.is_driven:
                    supervisor.fault = fault
            self._goals.end(Ending.by(fault))
            if was_followed:
                self._stop()
        controller.may_hold = supervisor.keeps_law or (
            mode in (Mode.WAITING, Mode.RUNNING, Mode.BRAKING))
        if not controller.may_hold and mode is Mode.FAULT and controller.trajectory is not None:
            controller.stop_from_state()
        if mode in (Mode.STOPPING, Mode.INACTIVE):
            if controller.trajectory is not None:
                controller.followed.end()  # the arm may move until the next command
            if self.awaiting is not None:
                options, self.awaiting = self.awaiting, None
                controller.set_options(options)

    def follow_state(self, now: float, stamp_ns: int, q: FloatArray, v: FloatArray) -> None:
        """Do the same after a state (q, v), (n,) each; end a command whose arm is at rest."""
        if self._supervisor.mode is Mode.BRAKING and self._is_at_rest(stamp_ns, q, v):
            self._supervisor.end(now, Ending(Kind.RELEASE_NOW, 'the arm has stopped'))
        self.follow(now)

    def _is_at_rest(self, stamp_ns: int, q: FloatArray, v: FloatArray) -> bool:
        """Return whether the reference has ended, and the arm was held for REST_TIME since."""
        if self._rest is None or not self._controller.has_stopped or not (
                0 <= stamp_ns - self._rest[0] <= 2 * REST_TIME_NS) or not bool(
                (np.abs(q - self._rest[1]) <= 1e-9 * REST_TIME_NS * REST_SPEED).all()):
            self._rest = stamp_ns, q
            return False
        return stamp_ns - self._rest[0] >= REST_TIME_NS and bool((np.abs(v) <= REST_SPEED).all())
