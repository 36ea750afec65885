# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""From a joint state message to effort messages: the control path of `dynamics`."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
import math
import time
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import NonFiniteEffortError
from robot_dynamics.control.loop import ControlLoop, LoopAnswer
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.ros.dynamics.command_output import CommandOutput
from robot_dynamics.ros.dynamics.drive_commands import DriveCommands
from robot_dynamics.ros.dynamics.served import ArmMessages, Served
from robot_dynamics.ros.dynamics.state_log import ControlCounters, StateLog
from robot_dynamics.ros.middleware.cdr_templates import SensedState
from robot_dynamics.ros.middleware.joint_state_reader import OtherJointsError
from robot_dynamics.ros.middleware.message_bytes import UnreadableMessageError
from robot_dynamics.ros.middleware.rclpy_internals import raw_publish, subscription_count
from robot_dynamics.ros.middleware.state_assembly import ForeignJointsError
from robot_dynamics.ros.parameters.declared_parameters import Values
from robot_dynamics_interfaces.msg import DynamicsTerms
from sensor_msgs.msg import JointState

DISCOVERY_TIME = 2.0
"""[s] after the start within which a publisher of robot_description may be discovered."""
NEWEST_ONLY = QoSProfile(depth=1)
"""Reliable, which matches all subscribers; older messages are of no use."""


class ControlPath:
    """Publishes the efforts for each joint state, with the stamp of this state."""

    def __init__(
        self, node: Node, count_publishers: Callable[[], int],
        when_changed: Callable[[], object],
    ) -> None:
        """
        Publish on the topics of a node.

        `count_publishers` returns the number of publishers of joint states; `when_changed` is
        called when a fault begins or ends, and must return soon.
        """
        self._node = node
        self._has_several_publishers = lambda: count_publishers() > 1
        self.when_changed = when_changed
        self.counters = ControlCounters()
        self._log = StateLog(node, self.counters)

        def publisher(message_type: type, topic: str) -> Any:
            return node.create_publisher(message_type, topic, NEWEST_ONLY)

        gravity = publisher(JointState, '~/gravity_compensation')
        computed_torque = publisher(JointState, '~/computed_torque')
        terms = publisher(DynamicsTerms, '~/terms')
        reference = publisher(JointState, '~/reference')
        (self._send_gravity, self._send_computed_torque, self._send_terms,
         self._send_reference) = map(raw_publish, (gravity, computed_torque, terms, reference))
        self._drives = DriveCommands(node, NEWEST_ONLY)
        self._counts = [*(subscription_count(one) for one in (
            gravity, computed_torque, terms, reference)), *self._drives.counts]
        self.command = CommandOutput(node, NEWEST_ONLY, when_changed)

    @property
    def served(self) -> Served | None:
        """What is served, or None."""
        return self.command.served

    @property
    def loop(self) -> ControlLoop | None:
        """The control loop of the arm that is served, or None."""
        return self.command.loop

    @property
    def lock(self) -> AbstractContextManager[object]:
        """The lock of the control path, which it holds while it answers a state."""
        return self.command.lock

    def serve(self, served: Served) -> None:
        """Serve this from the next joint state on; the goal before ends."""
        loop = served.loop
        loop.gate.plausibility.has_age = self._has_age
        with self.lock:
            before = self.loop
            if before is not None:
                before.goals.end(Ending(Kind.HOLD, 'another model was loaded'))
                if before.controller.trajectory is not None:
                    loop.goals.interruption = 'another model was loaded'
            self.command.serve(served)

    def set_values(self, values: Values) -> None:
        """Serve the same arm with other parameters."""
        served = self.served
        if served is not None:
            self.command.served = replace(served, values=values)

    def forget(self) -> None:
        """Serve no arm."""
        with self.lock:
            if self.loop is not None:
                self.loop.goals.end(Ending(Kind.HOLD, 'the model was unloaded'))
            self.command.forget()

    # ------------------------------------------------------------------ states

    def on_state(self, state: SensedState) -> None:
        """Publish the efforts for a joint state; an error drops only this state."""
        with self.command.lock:  # what is served changes between two states
            try:
                served = self.command.served
                if served is None:
                    self._log.count('no model yet')
                else:
                    self._answer(served, state)
            except OtherJointsError:
                self.counters.dropped['other joints'] += 1
            except NonFiniteEffortError as error:
                self._log.drop('no finite effort', f'Dropped a joint state: {error}')
                self.command.notify()
            except ImplausibleStateError as error:
                self._log.drop(error.reason, f'Dropped a joint state: {error}')
                if error.is_conflict:
                    self.command.notify()
            except RobotDynamicsError as error:
                self._log.drop('invalid', f'Dropped a joint state: {error}')
            except Exception as error:  # no message may end the control path
                self._log.drop('internal error', f'Dropped a joint state: {error!r}')

    def _answer(self, served: Served, state: SensedState) -> None:
        """Publish the efforts for a state, and what follows from it."""
        command, messages, steady_ns = self.command, served.messages, time.monotonic_ns()
        values = None
        if state.layout is messages.layout and not messages.foreign_joints:  # the usual case
            values = state.numbers[messages.places]
            if not math.isfinite(sum(values.tolist())):
                values = None
        if values is not None:
            n = messages.joint_count
            q, v = values[:n], values[n:] if len(values) > n else None
        else:
            whole = self._completed(messages, state, 1e-9 * steady_ns)
            if whole is None:
                return
            state, (q, v) = whole, self._read(served, whole)
        answer = served.loop.answer(
            state.stamp_ns, q, v, time.time_ns(), steady_ns, self._has_several_publishers,
            command.order.fault, partial(command.publish, state.stamp))
        mode = served.loop.supervisor.mode
        if mode is not command.mode_seen or mode is not Mode.RUNNING or answer.limits is not None:
            command.follow(answer)
        self._follow(served, state, answer, q, v, 1e-9 * steady_ns)

    def refuse(self, error: UnreadableMessageError) -> None:
        """Count and log a joint state that cannot be read."""
        self._log.drop('unreadable', f'Dropped a joint state: {error}')

    def _completed(
        self, messages: ArmMessages, received: SensedState, now: float,
    ) -> SensedState | None:
        """Return the state that a message completes, None if it completes no state."""
        if messages.foreign_joints:
            self._log.refuse_embedded(messages.foreign_joints)
            return None
        if messages.awaits_description and self._description_is_published(messages):
            self._log.count('robot_description not received yet')
            return None
        try:
            state = messages.assembly.take(received)
        except ForeignJointsError as error:
            messages.foreign_joints = str(error)
            self._log.refuse_embedded(str(error))
            return None
        if state is None:
            self._log.part(
                messages.assembly.missing,
                now - max(messages.used_at, self.counters.answered_at))
        return state

    def _read(
        self, served: Served, state: SensedState,
    ) -> tuple[FloatArray, FloatArray | None]:
        """Return position and velocity (n,) of a state, and learn where its layout has them."""
        messages = served.messages
        q, v = messages.reader.read(state)
        if len(state.velocity) not in (0, len(state.name)) and not messages.lacks_velocity:
            messages.lacks_velocity = True
            self._log.warn('velocity', (
                f'Joint states have {len(state.velocity)} velocities for {len(state.name)} names: '
                'all velocities count as missing'))
        if state.layout is messages.assembly.whole and not messages.awaits_description:
            messages.layout, messages.places = state.layout, messages.reader.places
        return q, v

    def _description_is_published(self, messages: ArmMessages) -> bool:
        """Return whether a description that is not received yet will replace the embedded arm."""
        messages.awaits_description = time.monotonic() - messages.used_at < DISCOVERY_TIME
        return bool(self._node.count_publishers('robot_description') > 0)

    # ------------------------------------------------------------------ after the command

    def _follow(
        self, served: Served, state: SensedState, answer: LoopAnswer, q: FloatArray,
        v: FloatArray | None, now: float,
    ) -> None:
        """Count and publish what follows from a state, after its command."""
        counters, output, verdict = self.counters, answer.output, answer.verdict
        counters.answered_at, counters.following = now, output.state.trajectory is not None
        if verdict.is_new:
            counters.arrivals.append(now)
        else:
            counters.repeated += 1
        if verdict.restart and (offset := served.loop.gate.plausibility.clock_offset) > 0.0:
            self._log.clock(offset)
        if output.scale != self._log.bandwidth_scale:
            self._log.bandwidth(served.loop.controller)
        if served.loop.goals.notice:
            self._log.warn('notice', served.loop.goals.notice)
            served.loop.goals.notice = ''
        for count in self._counts:
            if count():
                self._publish(state, served, answer)
                break
        if served.loop.drives.samples.wants_report:
            served.drives.take(served.messages.reader, state, output)
        if served.external.is_on:
            fault = served.external.fault(
                served.messages.reader, state, q, output.state.v, verdict, output.robot_gravity)
            if fault is not None:
                self.command.fail(fault)

    def has_position_drives(self) -> bool:
        """Return whether drives with their own stiffness are commanded."""
        return self._drives.has_listeners()

    def _has_age(self) -> bool:
        """Return whether stamps have an age: with use_sim_time they have none."""
        return not self._node.get_clock().ros_time_is_active

    def _publish(self, state: SensedState, served: Served, answer: LoopAnswer) -> None:
        messages, output = served.messages, answer.output
        gravity, computed_torque, terms_count, reference_count = (
            count() for count in self._counts[:4])
        if gravity:
            self._send_gravity(messages.effort.filled(state.stamp, output.gravity_compensation))
        if computed_torque and output.computed_torque is not None:
            self._send_computed_torque(messages.effort.filled(state.stamp, output.computed_torque))
        if terms_count:
            terms = output.terms
            if terms is not None:
                self._send_terms(messages.terms.filled(
                    state.stamp, *terms[:6], np.array(terms[6:])))
        reference = output.reference if reference_count else None
        if reference is not None:
            self._send_reference(messages.motion.filled(
                state.stamp, reference.position, reference.velocity))
        self._drives.publish(state.stamp, served, answer)
