# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The end of a command: the arm stops and is held, until the supervisor can end the command."""

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.goal_execution import GoalExecution
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.control.safety.supervisor import CommandSupervisor, Mode

AT_REST, SLOW = 0.002, 0.03
"""[rad] or [m] that no joint moves in REST_TIME when it has stopped, and its velocity then."""
REST_TIME_NS = 100_000_000
"""[ns]"""


class CommandEnd:
    """The stop of one arm before the end; `ControlLoop` calls with its lock held."""

    def __init__(self, controller: Controller, goals: GoalExecution) -> None:
        self._controller, self._goals = controller, goals
        self._rest: tuple[int, FloatArray] | None = None
        self.options: ControllerOptions | None = None
        """Options that await the end, or None."""

    def begin(self, supervisor: CommandSupervisor, now: float, reason: str) -> None:
        """Begin the stop; the reference is that of the stop."""
        if self._controller.trajectory is not None:
            self._goals.interruption = reason
        self._goals.stream.end()
        was_braking = supervisor.mode is Mode.BRAKING
        if supervisor.brake(now) and not was_braking:
            self._rest = None
            self._controller.stop()

    def is_reached(self, stamp_ns: int, q: FloatArray, v: FloatArray) -> bool:
        """Return whether the arm has stopped at (q, v), and was held for REST_TIME."""
        if self._rest is None or not self._controller.has_stopped or not (
                0 <= stamp_ns - self._rest[0] <= 2 * REST_TIME_NS) or not bool(
                (np.abs(q - self._rest[1]) <= AT_REST).all()):
            self._rest = stamp_ns, q
            return False
        return stamp_ns - self._rest[0] >= REST_TIME_NS and bool((np.abs(v) <= SLOW).all())
