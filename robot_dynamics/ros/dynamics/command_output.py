# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The command of `dynamics` on its topics, with a watchdog thread.

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
from robot_dynamics.control.laws.law_table import NO_COMMAND
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.ros.dynamics.command_status import (
    command_obstacle,
    command_verdict,
    CommandCounters,
)
from robot_dynamics.ros.dynamics.controller_order import ControllerOrder
from robot_dynamics.ros.dynamics.served import Served
from robot_dynamics.ros.dynamics.silence import no_receiver, Silence
from robot_dynamics.ros.middleware.diagnostics import Status
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD
from robot_dynamics.ros.middleware.rclpy_internals import raw_publish, RclError, subscription_count
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

LONGEST_ACKNOWLEDGEMENT = 2.0
"""[s] in which subscribers must acknowledge the last command before the node ends."""
ACTION_PERIOD = 0.002
"""[s] between efforts of a fault action."""
END_SLACK = 5.0
"""[s] after the end for the thread to publish the last effort, long for a busy machine."""
IDLE = 1.0
"""[s] between two checks while no joint state can be overdue."""


class CommandOutput:
    """
    Publishes the efforts of the control loop that is served; thread-safe.

    `lock` protects `served` and the publishers; the loops of all models use it.
    """

    def __init__(
        self, node: Node, qos: QoSProfile, when_changed: Callable[[], object],
    ) -> None:
        """`when_changed` is called when a fault begins or ends, and must return soon."""
        self._node, self._when_changed = node, when_changed
        self.counters = CommandCounters()
        self.lock = threading.RLock()
        self._changed = threading.Condition(self.lock)
        self._command = self._publisher(JointState, 'effort_command', qos)
        self._send = raw_publish(self._command)
        self._count = subscription_count(self._command)
        self._commands = self._publisher(Float64MultiArray, '~/commands', qos)
        self._count_bare = subscription_count(self._commands)
        self.topics: dict[str, str] = {
            'effort_command': self._command.topic_name, '~/commands': self._commands.topic_name}
        """The full names of the command topics by their documented names."""
        self.served: Served | None = None
        """What is served, the only reference of the node to it."""
        self._stamp = bytes(8)
        self.is_active = self._ends = False
        """Whether commands are enabled."""
        self._silence = Silence(
            lambda words: node.get_logger().warning(f'No receiver: {words}'))
        self._is_missed = False
        """Whether no receiver was found at the last status."""
        self._latched: Fault | None = None
        self._faults_seen = 0
        self.mode_seen = Mode.INACTIVE
        """The mode that was logged last."""
        self.order = ControllerOrder(
            node, self._commands,
            lambda: [] if self.loop is None else list(self.loop.controller.arm.joint_names),
            self.fail)
        self._thread = threading.Thread(target=self._watch, name='command watch', daemon=True)
        self._thread.start()

    def _publisher(self, message_type: type, topic: str, qos: QoSProfile) -> Any:
        def report(event: Any) -> None:
            policy = qos_policy_name_from_kind(event.last_policy_kind)
            self.counters.others[f'incompatible subscribers of {topic}'] = event.total_count
            self.counters.incompatible = (
                f'a subscriber of {topic} requests an incompatible {policy}')
            self._node.get_logger().warning(
                f'Incompatible QoS: a subscriber of {topic} requests a different {policy} and '
                'receives nothing. Offered: reliable (matches best effort), volatile, no '
                'deadline.')
            self._when_changed()

        return self._node.create_publisher(
            message_type, topic, qos, event_callbacks=PublisherEventCallbacks(
                incompatible_qos=report))

    # ------------------------------------------------------------------ the loop

    @property
    def loop(self) -> ControlLoop | None:
        """The control loop of the arm that is served, or None."""
        return None if self.served is None else self.served.loop

    def serve(self, served: Served) -> None:
        """Serve this from the next joint state on; its efforts continue those of the last loop."""
        with self._changed:
            loop, before = served.loop, self.loop
            # with use_sim_time stamps have no age
            loop.gate.plausibility.has_age = (
                lambda: not self._node.get_clock().ros_time_is_active)
            if before is not None:
                before.goals.end(Ending(Kind.HOLD, 'another model was loaded'))
                if before.controller.trajectory is not None:
                    loop.goals.interruption = 'another model was loaded'
            elif self._latched is not None:
                loop.supervisor.fault, self._latched = self._latched, None
            if self.is_active and not loop.is_active:
                loop.activate()
            self.served = served
            self._faults_seen = loop.supervisor.fault_count
            self.order.look_now()
            self._changed.notify()

    def forget(self) -> None:
        """Publish nothing; a latched fault persists for the next loop."""
        with self._changed:
            loop, self.served = self.loop, None
            if loop is not None:
                loop.goals.end(Ending(Kind.HOLD, 'the model was unloaded'))
                if loop.supervisor.is_latched:
                    self._latched = loop.supervisor.fault

    def notify(self) -> None:
        """Let the watchdog check the loop at once."""
        with self._changed:
            self._changed.notify()

    @property
    def is_commanding(self) -> bool:
        """Return whether commands are published."""
        with self.lock:
            return self.loop is not None and self.loop.supervisor.is_commanding

    def has_listeners(self) -> bool:
        """Return whether the command has subscribers that do more than observe."""
        return bool(self._count() or self._count_bare()) and not self._is_missed

    # ------------------------------------------------------------------ start and end

    def activate(self) -> None:
        """Publish commands from the next joint state on."""
        with self._changed:
            self.is_active = True
            if self.loop is not None:
                self.loop.activate()

    def request_shutdown(self) -> None:
        """Begin to stop the arm and to end the command."""
        with self._changed:
            self.is_active = False
            if self.loop is not None:
                self.loop.deactivate(time.monotonic())
            self._changed.notify()

    def deactivate(self) -> None:
        """Stop the arm, end the command by `end_action`, and return at its end."""
        with self._changed:
            self.request_shutdown()
            loop = self.loop
            if loop is not None:
                supervisor = loop.supervisor
                self._changed.wait_for(
                    lambda: supervisor.mode is Mode.INACTIVE, supervisor.time_to_stop + END_SLACK)

    def reset(self) -> tuple[bool, str]:
        """Reset a latched fault whose cause has ended; return success and a message."""
        with self._changed:
            if self.loop is not None:
                done, words = self.loop.reset()
            else:
                fault, self._latched = self._latched, None
                done, words = fault is not None, (
                    f'reset {fault.name}' if fault is not None else 'there is no fault')
            self._node.get_logger().info(f'~/reset_fault: {words}')
            return done, words

    def close(self) -> None:
        """Stop, end the command and the thread, before the node is destroyed."""
        self.deactivate()
        with self._changed:
            self._ends = True
            self._changed.notify()
        self._thread.join()
        for publisher in (self._command, self._commands):  # a lost sample delays the last ones
            with suppress(RclError):  # the context may have ended
                publisher.wait_for_all_acked(Duration(seconds=LONGEST_ACKNOWLEDGEMENT))

    # ------------------------------------------------------------------ efforts

    def publish(self, stamp: bytes, effort: FloatArray) -> None:
        """Publish the effort (n,) for a state with this stamp; the caller holds `lock`."""
        self._stamp, served = stamp, self.served
        if served is None:
            return
        messages = served.messages
        try:
            if self._count():
                self._send(messages.effort.filled(stamp, effort))
            if self._count_bare() and self.order.allows():
                self._commands.publish(messages.bare_command.filled(stamp, effort))
        except Exception:
            if self._node.context.ok():
                raise
            return  # a context that has ended publishes nothing
        self.counters.published += 1

    def fail(self, fault: Fault) -> None:
        """Start the fault action."""
        with self._changed:
            if self.loop is not None:
                self.loop.end(time.monotonic(), Ending.by(fault))
                self.log_changes()
                self._changed.notify()

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
        loop = self.loop
        if loop is None:
            return IDLE
        supervisor = loop.supervisor
        effort = loop.tick(time.monotonic())
        if effort is not None:
            self.publish(self._stamp, effort)
        self.log_changes()
        self._changed.notify_all()
        if supervisor.acts_alone:
            return ACTION_PERIOD
        if supervisor.mode in (Mode.RUNNING, Mode.BRAKING):
            return max(supervisor.deadline - time.monotonic(), 0.0) + 1e-4
        return supervisor.options.state_timeout

    def log_changes(self) -> None:
        """Log a fault that begins or ends, and wake the watchdog; the caller holds `lock`."""
        loop = self.loop
        if loop is None:
            return
        supervisor, logger = loop.supervisor, self._node.get_logger()
        if supervisor.fault_count != self._faults_seen and supervisor.fault is not None:
            self._faults_seen = supervisor.fault_count
            self.counters.others[f'faults: {supervisor.fault.name}'] += 1
            logger.error(
                f'Fault {supervisor.fault.name}: {supervisor.fault.message}',
                throttle_duration_sec=LOG_PERIOD)
        if self.mode_seen is supervisor.mode:
            return
        if self.mode_seen is Mode.FAULT and supervisor.mode is Mode.RUNNING:
            logger.info(
                'The fault has ended: commanding again, from the measured state.' if (
                    supervisor.recurring.fault is None) else
                'The fault has ended: the arm is held. References wait for ~/reset_fault.',
                throttle_duration_sec=LOG_PERIOD)
        if supervisor.mode is Mode.RUNNING and self.mode_seen in (Mode.INACTIVE, Mode.WAITING):
            logger.info(
                f'Joint states arrive: commanding on {" and ".join(self.topics.values())}, from '
                'the measured state.', throttle_duration_sec=LOG_PERIOD)
        self.mode_seen = supervisor.mode
        self._changed.notify_all()
        self._when_changed()

    def status(self) -> Status:
        """Return the state of the command for the diagnostics."""
        with self._changed:
            loop = self.loop
            mode, fault = (None, self._latched) if loop is None else (
                loop.supervisor.mode, loop.supervisor.standing_fault)
            is_off = self.is_active and loop is not None and (
                loop.controller.options.command == NO_COMMAND)
            obstacle = '' if self.served is None else command_obstacle(
                self.served.arm, self.served.values['command'])
        missing = ''
        if mode is Mode.RUNNING and not self.counters.incompatible:
            missing = no_receiver(self._node, list(self.topics.values()))
        self._is_missed = bool(missing)
        return Status(
            'command', *command_verdict(
                self.counters, mode, fault, is_off, obstacle, self._silence.reason(missing)),
            self.counters.figures)
