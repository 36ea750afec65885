# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""From a joint state message to effort messages: the control path of `dynamics`."""

from collections.abc import Callable
from functools import partial
import math
import time

import numpy as np
from rclpy.qos import QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import NonFiniteEffortError
from robot_dynamics.control.feed_forward import DriveCommand
from robot_dynamics.control.loop import ControlLoop, LoopAnswer
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.monitoring.state_plausibility import ImplausibleStateError
from robot_dynamics.ros.dynamics.command_output import CommandOutput
from robot_dynamics.ros.dynamics.served import ArmMessages, Served
from robot_dynamics.ros.dynamics.state_log import StateLog
from robot_dynamics.ros.middleware.cdr_templates import SensedState
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks
from robot_dynamics.ros.middleware.message_bytes import UnreadableMessageError
from robot_dynamics.ros.middleware.rclpy_internals import raw_publish, subscription_count
from robot_dynamics.ros.middleware.state_assembly import ForeignJointsError, OtherJointsError
from robot_dynamics_interfaces.msg import DynamicsTerms
from sensor_msgs.msg import JointState

DISCOVERY_TIME = 2.0
"""[s] after the start within which a publisher of robot_description may be discovered."""
NEWEST_ONLY = QoSProfile(depth=1)
"""Reliable, which matches all subscribers; older messages are of no use."""


class ControlPath:
    """Publishes the efforts for each joint state, with the stamp of this state."""

    def __init__(
        self, node: GuardedCallbacks, has_several_publishers: Callable[[], bool],
        when_changed: Callable[[], object],
    ) -> None:
        """
        Publish on the topics of a node.

        `has_several_publishers` returns whether joint_states has several; `when_changed` is called
        when a fault begins or ends, and must return soon.
        """
        self._node, self._has_several_publishers = node, has_several_publishers
        self.when_changed = when_changed
        self.states = StateLog(node, lambda: self.loop)
        publishers = [
            node.create_publisher(message_type, topic, NEWEST_ONLY)
            for topic, message_type in (
                ('~/gravity_compensation', JointState), ('~/computed_torque', JointState),
                ('~/terms', DynamicsTerms), ('~/reference', JointState),
                ('~/feed_forward', JointState), ('~/position_offset', JointState))]
        (self._send_gravity, self._send_computed_torque, self._send_terms, self._send_reference,
         self._send_drive_command, self._send_offset) = map(raw_publish, publishers)
        self._counts = [subscription_count(publisher) for publisher in publishers]
        self._paused = 0
        """Number of streams of set-points that had paused at the last state."""
        self.command = CommandOutput(node, NEWEST_ONLY, when_changed)

    @property
    def loop(self) -> ControlLoop | None:
        """The control loop of the arm that is served, or None."""
        return self.command.loop

    # ------------------------------------------------------------------ states

    def on_state(self, state: SensedState) -> None:
        """Publish the efforts for a joint state; an error drops only this state."""
        with self.command.lock:  # what is served changes between two states
            try:
                served = self.command.served
                if served is None:
                    self.states.count('no model yet')
                else:
                    self._answer(served, state)
            except OtherJointsError:
                self.states.dropped['other joints'] += 1
                self.states.other_joints = state.name
            except NonFiniteEffortError as error:
                self.states.drop('no finite effort', str(error))
                self.command.notify()
            except ImplausibleStateError as error:
                self.states.drop(error.reason, str(error))
                if error.is_conflict:
                    self.command.notify()
            except RobotDynamicsError as error:
                self.states.drop('invalid', str(error))
            except Exception as error:  # no message may end the control path
                self.states.drop('internal error', repr(error))

    def _answer(self, served: Served, state: SensedState) -> None:
        """Publish the efforts for a state, and what follows from it."""
        command, messages, steady_ns = self.command, served.messages, time.monotonic_ns()
        values = None
        if messages.is_open and state.layout is messages.reader.layout:  # the usual case
            values = state.numbers[messages.reader.places]
            if not math.isfinite(sum(values.tolist())):
                values = None
        if values is not None:
            n = messages.joint_count
            q, v = values[:n], values[n:] if len(values) > n else None
        else:
            whole = self._completed(messages, state)
            if whole is None:
                return
            state, (q, v) = whole, messages.reader.read(whole)
            if len(whole.velocity) not in (0, len(whole.name)):
                self.states.warn('velocity', (
                    f'Joint states have {len(whole.velocity)} velocities for {len(whole.name)} '
                    'names: all velocities count as missing'))
        answer = served.loop.answer(
            state.stamp_ns, q, v, time.time_ns(), steady_ns, self._has_several_publishers,
            command.order.fault, partial(command.publish, state.stamp))
        mode = served.loop.supervisor.mode
        if mode is not command.mode_seen or mode is not Mode.RUNNING or answer.limits:
            command.counters.count_limits(answer.limits)
            command.log_changes()
        self._follow(served, state, answer, q, v, 1e-9 * steady_ns)

    def refuse(self, error: UnreadableMessageError) -> None:
        """Count and log a joint state that cannot be read."""
        self.states.drop('unreadable', str(error))

    def _completed(self, messages: ArmMessages, received: SensedState) -> SensedState | None:
        """Return the state that a message completes, None if it completes no state."""
        if messages.foreign_joints:
            self.states.refuse_embedded(messages.foreign_joints)
            return None
        if not messages.is_open:  # a description may be published and not received yet
            messages.is_open = time.monotonic() - messages.used_at >= DISCOVERY_TIME
            if self._node.count_publishers('robot_description') > 0:
                self.states.count('robot_description not received yet')
                return None
        try:
            state = messages.assembly.take(received)
        except ForeignJointsError as error:
            messages.foreign_joints, messages.is_open = str(error), False
            self.states.refuse_embedded(str(error))
            return None
        if state is None:
            self.states.part(messages.assembly.missing, messages.used_at)
        return state

    # ------------------------------------------------------------------ after the command

    def _follow(
        self, served: Served, state: SensedState, answer: LoopAnswer, q: FloatArray,
        v: FloatArray | None, now: float,
    ) -> None:
        """Count and publish what follows from a state, after its command."""
        states, output, verdict = self.states, answer.output, answer.verdict
        states.answered_at, states.following = now, output.state.trajectory is not None
        if verdict.is_new:
            states.arrivals.append(now)
        else:
            states.repeated += 1
        if verdict.restart and (offset := served.loop.gate.plausibility.clock_offset) > 0.0:
            states.clock(offset)
        paused, self._paused = self._paused, served.loop.goals.paused_streams
        if self._paused > paused:
            states.warn(
                'paused', 'The stream of set-points paused for more than reference_timeout: the '
                'arm stops and holds its position.')
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
        return self._counts[4]() > 0 or self._counts[5]() > 0

    def _publish(self, state: SensedState, served: Served, answer: LoopAnswer) -> None:
        messages, output = served.messages, answer.output
        gravity, computed_torque, terms_count, reference_count, drive_command, offset = (
            count() for count in self._counts)
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
        command = served.feed_forward.command(answer) if drive_command or offset else None
        if drive_command and command is not None:
            self._send_drive_command(messages.drive_command.filled(state.stamp, *command))
        if offset and command is not None:
            self._publish_offset(state.stamp, served, command)

    def _publish_offset(self, stamp: bytes, served: Served, command: DriveCommand) -> None:
        """Publish the position at which the position loops of the drives give the effort."""
        stiffness, limits = served.loop.controller.options.drive_stiffness, served.arm.limits
        if stiffness is None:
            self.states.warn(
                'no stiffness', 'Nothing is published on ~/position_offset: drive.stiffness is '
                'empty, expected the stiffness k_p of the drives.')
            return
        position = command.position_offset(stiffness, limits.lower, limits.upper)
        self._send_offset(served.messages.motion.filled(stamp, position, command.velocity))
