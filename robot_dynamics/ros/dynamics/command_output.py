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
The command of `dynamics` on its topics, with its supervisor and a watchdog thread.

The thread sleeps until a joint state is overdue. It uses the steady clock, so that /clock has no
effect. If a state is overdue, and while the effort is ramped to zero, it publishes the efforts.
"""

from collections.abc import Callable
from contextlib import suppress
import threading
import time
from typing import Any

from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import qos_policy_name_from_kind, QoSProfile
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.effort_limiter import EffortLimits
from robot_dynamics.control.supervisor import Brake, CommandSupervisor, Fault, Mode, SafetyOptions
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.cdr_templates import array_template, effort_template, MessageTemplate
from robot_dynamics.ros.diagnostics import Status
from robot_dynamics.ros.dynamics.command_status import command_status, CommandCounters
from robot_dynamics.ros.dynamics.controller_order import ControllerOrder
from robot_dynamics.ros.message_loop import LOG_PERIOD
from robot_dynamics.ros.rclpy_internals import raw_publish, RclError
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

LONGEST_ACKNOWLEDGEMENT = 2.0
"""[s] in which subscribers must acknowledge the last command before the node ends."""
ACTION_PERIOD = 0.002
"""[s] between efforts of a fault action."""
END_SLACK = 5.0
"""[s] after the ramp for the thread to publish the last effort, long for a busy machine."""
IDLE = 1.0
"""[s] between two checks while no joint state can be overdue."""


class SafeCommand:
    """Publishes the efforts of one arm that its supervisor permits; thread-safe."""

    def __init__(
        self, node: Node, qos: QoSProfile, when_interrupted: Callable[[str, bool], None],
        when_recovered: Callable[[], None], when_changed: Callable[[], object],
    ) -> None:
        """
        Report interruptions of the reference.

        `when_interrupted` is called when no reference can be followed any more, with the reason
        and whether commands resume automatically.

        `when_recovered` is called when commands resume after a fault. `when_changed` is called
        when a fault begins or ends, in the thread that detects it, and must return soon.
        """
        self._node, self._when_interrupted = node, when_interrupted
        self._when_recovered, self._when_changed = when_recovered, when_changed
        self.counters = CommandCounters()
        self._command = self._publisher(JointState, 'effort_command', qos)
        self._send = raw_publish(self._command)
        self._commands = self._publisher(Float64MultiArray, '~/commands', qos)
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self._supervisor: CommandSupervisor | None = None
        self._names: list[str] = []
        self._templates: tuple[MessageTemplate, MessageTemplate] | None = None
        self._stamp = bytes(8)
        self._is_active = self._ends = False
        self._is_wanted = True
        self._latched: Fault | None = None
        self._faults_seen = 0
        self._mode_seen = Mode.INACTIVE
        self._order = ControllerOrder(node, self._commands, lambda: self._names, self.fail)
        self._thread = threading.Thread(target=self._watch, name='command watch', daemon=True)
        self._thread.start()

    def _publisher(self, message_type: type, topic: str, qos: QoSProfile) -> Any:
        def report(event: Any) -> None:
            policy = qos_policy_name_from_kind(event.last_policy_kind)
            self.counters.incompatible[topic] = event.total_count
            self._node.get_logger().warning(
                f'Incompatible QoS: a subscriber of {topic} requests a different {policy} and '
                'receives nothing. Offered: reliable (matches best effort), volatile, no '
                'deadline.')
            self._when_changed()

        return self._node.create_publisher(
            message_type, topic, qos, event_callbacks=PublisherEventCallbacks(
                incompatible_qos=report))

    # ------------------------------------------------------------------ the served arm

    def use(self, arm: ArmModel, limits: EffortLimits, options: SafetyOptions) -> None:
        """
        Serve this arm from now on.

        For another model of the same joints the effort continues from the last one without a
        step; for other joints the supervisor is reset. A latched fault persists.
        """
        with self._changed:
            old = self._supervisor
            if old is not None and self._names == list(arm.joint_names):
                old.set_options(limits, options)
            else:
                self._supervisor = CommandSupervisor(arm.joint_names, limits, options)
                self._names, self._faults_seen = list(arm.joint_names), 0
                self._templates = (
                    effort_template(arm.joint_names), array_template(arm.joint_count))
                if old is not None and old.is_latched:
                    self._latched = old.fault
                self._supervisor.fault, self._latched = self._latched, None
                if self._is_active:
                    self._supervisor.activate()
            self._changed.notify()

    def forget(self) -> None:
        """Serve no arm; a latched fault persists for the next arm."""
        with self._changed:
            old, self._supervisor = self._supervisor, None
            if old is not None and old.is_latched:
                self._latched = old.fault

    def set_options(self, limits: EffortLimits, options: SafetyOptions) -> None:
        """Apply limits and options."""
        with self._changed:
            if self._supervisor is not None:
                self._supervisor.set_options(limits, options)
            self._changed.notify()

    @property
    def is_commanding(self) -> bool:
        """Return whether commands are published."""
        with self._changed:
            return self._supervisor is not None and self._supervisor.is_commanding

    @property
    def is_waiting(self) -> bool:
        """Return whether commands are enabled but none has been published yet."""
        with self._lock:
            return self._is_active and self._supervisor is not None and self._supervisor.mode in (
                Mode.INACTIVE, Mode.WAITING)

    @property
    def obstacle(self) -> str:
        """The reason why no reference can be followed now, empty if one can."""
        with self._lock:
            supervisor = self._supervisor
            mode = supervisor.mode if supervisor is not None else Mode.INACTIVE
            if not self._is_active:
                return 'the node is not active'
            if mode is Mode.FAULT and supervisor is not None and supervisor.fault is not None:
                return f'fault {supervisor.fault.name}: {supervisor.fault.words}'
            if mode is Mode.STOPPING:
                return 'the command is being ramped to zero'
            return ''

    @property
    def is_faulty(self) -> bool:
        """Whether a fault is active."""
        with self._lock:
            return self._supervisor is not None and self._supervisor.mode is Mode.FAULT

    def has_listeners(self) -> bool:
        """Return whether the command has subscribers."""
        return bool(
            self._command.get_subscription_count() or self._commands.get_subscription_count())

    @property
    def topics(self) -> dict[str, str]:
        """The full names of the command topics by their documented names."""
        return {
            'effort_command': self._command.topic_name, '~/commands': self._commands.topic_name}

    # ------------------------------------------------------------------ start and end

    def activate(self) -> None:
        """Publish commands from the next joint state on."""
        with self._changed:
            self._is_active = True
            if self._supervisor is not None:
                self._supervisor.activate()

    def request_shutdown(self) -> None:
        """Start to ramp the effort to zero."""
        with self._changed:
            self._is_active = False
            self._when_interrupted('the node was deactivated', False)
            if self._supervisor is not None:
                self._supervisor.deactivate(time.monotonic())
            self._changed.notify()

    def deactivate(self) -> None:
        """Ramp the effort to zero, and return at the end of the ramp."""
        with self._changed:
            self.request_shutdown()
            supervisor = self._supervisor
            if supervisor is not None:
                self._changed.wait_for(
                    lambda: supervisor.mode is Mode.INACTIVE, supervisor.time_to_stop + END_SLACK)

    def reset(self) -> tuple[bool, str]:
        """Reset a latched fault whose cause has ended; return success and a message."""
        with self._changed:
            if self._supervisor is not None:
                done, words = self._supervisor.reset()
            else:
                fault, self._latched = self._latched, None
                done, words = fault is not None, (
                    f'reset {fault.name}' if fault is not None else 'there is no fault')
            self._node.get_logger().info(f'~/reset_fault: {words}')
            return done, words

    def close(self) -> None:
        """Ramp the effort to zero and end the thread, before the node is destroyed."""
        self.deactivate()
        with self._changed:
            self._ends = True
            self._changed.notify()
        self._thread.join()
        for publisher in (self._command, self._commands):  # a lost sample delays the last ones
            with suppress(RclError):  # the context may have ended
                publisher.wait_for_all_acked(Duration(seconds=LONGEST_ACKNOWLEDGEMENT))

    # ------------------------------------------------------------------ efforts

    def answer(
        self, stamp: bytes, q: FloatArray, v: FloatArray | None, output: ControlOutput,
        dt: float | None, brake: Brake, fault: Fault | None = None,
    ) -> FloatArray | None:
        """
        Publish the effort for a state dt [s] after the last state; return it, None for none.

        `brake` returns the hold torque with damping; `fault` is the fault of this state, if any.
        If the output has no command, the effort is ramped to zero, as at deactivation.
        """
        with self._lock:
            supervisor = self._supervisor
            if supervisor is None:
                return None
            now = time.monotonic()
            self._is_wanted = output.command is not None
            if output.command is None:
                supervisor.deactivate(now)
                if supervisor.acts_alone:
                    self._changed.notify()
                return None
            if self._is_active and supervisor.mode is Mode.INACTIVE:
                supervisor.activate()
            self._stamp = stamp
            effort = supervisor.answer(
                now, q, v, output.command, output.hold, dt, brake, self._order.fault or fault)
            self._publish(effort)
            if supervisor.mode is Mode.RUNNING:
                self.counters.count_limits(output, supervisor.guarded)
            self._look_for_faults()
            return effort

    def repeat(self, stamp: bytes) -> FloatArray | None:
        """Publish the last effort again for a repeated state; return it."""
        with self._changed:
            effort = None if self._supervisor is None else self._supervisor.repeat()
            self._stamp = stamp
            self._publish(effort)
            return effort

    def fail(self, fault: Fault) -> None:
        """Start the fault action."""
        with self._changed:
            if self._supervisor is not None:
                self._supervisor.fail(time.monotonic(), fault)
                self._look_for_faults()
                self._changed.notify()

    def _publish(self, effort: FloatArray | None) -> None:
        if effort is None or self._templates is None:
            return
        named, bare = self._templates
        try:
            self._send(named.filled(self._stamp, effort))
            if self._order.allows():
                self._commands.publish(bare.filled(self._stamp, effort))
        except Exception:
            if self._node.context.ok():
                raise
            return  # a context that has ended publishes nothing
        self.counters.published += 1

    # ------------------------------------------------------------------ the watchdog

    def _watch(self) -> None:
        with self._changed:
            while not self._ends:
                try:
                    self._changed.wait(self._tick())
                except Exception as error:  # the watchdog must outlive all errors
                    self._node.get_logger().error(
                        f'Internal error in the command watchdog: {error!r}',
                        throttle_duration_sec=LOG_PERIOD)
                    self._changed.wait(ACTION_PERIOD)

    def _tick(self) -> float:
        """Publish what is due; return the time [s] until the next check."""
        supervisor = self._supervisor
        if supervisor is None:
            return IDLE
        self._publish(supervisor.tick(time.monotonic()))
        self._look_for_faults()
        self._changed.notify_all()
        if supervisor.acts_alone:
            return ACTION_PERIOD
        if supervisor.mode is Mode.RUNNING:
            return max(supervisor.deadline - time.monotonic(), 0.0) + 1e-4
        return supervisor.options.state_timeout

    def _look_for_faults(self) -> None:
        """Log a fault that has begun, and one that has ended."""
        supervisor = self._supervisor
        if supervisor is None:
            return
        if supervisor.fault_count != self._faults_seen and supervisor.fault is not None:
            self._faults_seen = supervisor.fault_count
            self.counters.faults[supervisor.fault.name] += 1
            self._when_interrupted(
                f'fault {supervisor.fault.name}: {supervisor.fault.words}', True)
            self._node.get_logger().error(
                f'Fault {supervisor.fault.name}: {supervisor.fault.words}',
                throttle_duration_sec=LOG_PERIOD)
        if self._mode_seen is Mode.FAULT and supervisor.mode is Mode.RUNNING:
            self._when_recovered()
            self._node.get_logger().info(
                'The fault has ended: commanding again, from the measured state.',
                throttle_duration_sec=LOG_PERIOD)
        if supervisor.mode is Mode.RUNNING and self._mode_seen in (Mode.INACTIVE, Mode.WAITING):
            self._node.get_logger().info(
                f'Joint states arrive: commanding on {" and ".join(self.topics.values())}, from '
                'the measured state.', throttle_duration_sec=LOG_PERIOD)
        if self._mode_seen is not supervisor.mode:
            self._mode_seen = supervisor.mode
            self._when_changed()

    def status(self) -> Status:
        """Return the state of the command for the diagnostics."""
        with self._changed:
            supervisor = self._supervisor
            mode, fault = (None, self._latched) if supervisor is None else (
                supervisor.mode, supervisor.fault)
            return command_status(
                self.counters, mode, fault, is_off=self._is_active and not self._is_wanted)
