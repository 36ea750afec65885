# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""From joint states to the measured states of the arm, judged as in the control loop."""

from collections import Counter
from collections.abc import Callable
import time
from typing import NamedTuple

from robot_dynamics.arrays import all_finite, FloatArray
from robot_dynamics.control.gate import Gate
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.monitoring.external_effort import joint_effort
from robot_dynamics.ros.middleware.cdr_templates import SensedState
from robot_dynamics.ros.middleware.diagnostics import OK, Status, WARN
from robot_dynamics.ros.middleware.joint_state_reader import JointStateReader
from robot_dynamics.ros.middleware.state_assembly import OtherJointsError, StateAssembly
from robot_dynamics_tools.monitor.followed_model import Followed


class MeasuredState(NamedTuple):
    """
    A state of the arm: the stamp as bytes and in ns, position and velocity (n,).

    `effort` (n,) is the measured effort at the joints, None for the reason `obstacle`. `restart`
    states why estimates restart with this state; it is empty if they continue.
    """

    stamp: bytes
    stamp_ns: int
    q: FloatArray
    v: FloatArray
    effort: FloatArray | None
    obstacle: str
    restart: str


class StateInput:
    """Assembles, reads and judges the joint states of one arm; for one thread."""

    def __init__(self, model: Followed, has_several_publishers: Callable[[], bool]) -> None:
        """`has_several_publishers` returns whether joint_states has several publishers."""
        self._model, self._has_several_publishers = model, has_several_publishers
        arm = model.arm
        self._assembly = StateAssembly(arm.joint_names, model.is_embedded)
        self._reader = JointStateReader(arm.joint_names)
        self._dropped: Counter[str] = Counter()
        self._last_drop = ''
        self._is_first = True
        self._begin()

    def set_model(self, model: Followed) -> None:
        """Continue with other loads, gravity or ages of the same arm."""
        self._model = model
        self._gate.plausibility.max_age = model.values['state_max_age']

    def rest(self) -> None:
        """Treat the next state as a first one."""
        if not self._is_first:
            self._is_first = True
            self._begin()

    def _begin(self) -> None:
        arm, values = self._model.arm, self._model.values
        self._gate = Gate(
            arm.joint_names, arm.is_continuous, arm.limits.velocity, values['state_max_age'])
        self._gate.plausibility.is_lock_step = values['lock_step']
        self._gate.plausibility.has_age = lambda: not values['use_sim_time']

    def take(self, received: SensedState) -> MeasuredState | None:
        """Return the new state that a message completes, None if there is none."""
        try:
            state = self._assembly.take(received)
            return None if state is None else self._judged(state)
        except OtherJointsError:
            return None
        except RobotDynamicsError as error:
            self.refuse(error)
            return None

    def refuse(self, error: Exception) -> None:
        """Count a joint state that cannot be used."""
        self._last_drop = str(error)
        self._dropped[getattr(error, 'reason', 'invalid')] += 1

    def _judged(self, state: SensedState) -> MeasuredState | None:
        self._is_first = False
        q, v = self._reader.read(state)
        signals = self._gate.take(
            state.stamp_ns, q, v, time.time_ns(), time.monotonic_ns(),
            self._has_several_publishers)
        verdict = signals.verdict
        if not verdict.is_new:
            return None
        if verdict.restart and v is not None:  # the gate starts with 0
            signals = signals._replace(v=v)
        effort, obstacle = None, ''
        try:
            effort = self._effort(state, signals.q, signals.v)
        except RobotDynamicsError as error:
            obstacle = str(error)
        return MeasuredState(
            state.stamp, verdict.stamp, signals.q, signals.v, effort, obstacle, verdict.restart)

    def _effort(self, state: SensedState, q: FloatArray, v: FloatArray) -> FloatArray:
        model = self._model
        if model.convention.measured_effort == 'none':
            raise InvalidInputError("measured_effort is 'none'")
        measured = self._reader.effort(state)
        if measured is None or not all_finite(measured):
            raise InvalidInputError('joint states have no effort')
        return joint_effort(model.arm, model.convention, measured, v, model.robot_gravity(q))

    def status(self) -> Status:
        """Return which joint states were not used, for the diagnostics."""
        missing, dropped = self._assembly.missing, dict(self._dropped)
        return Status(
            'joint states', WARN if missing else OK,
            f'no newer sample of {missing}' if missing else self._last_drop or 'used',
            {f'dropped: {reason}': count for reason, count in sorted(dropped.items())})
